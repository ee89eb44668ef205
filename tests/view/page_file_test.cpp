// Scenes and assets as pages.
#include "limber/view/page_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "block_model.h"
#include "folders.h"
#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/scene/scene_file.h"
#include "limber/scene/scene_model.h"

namespace limber {
namespace {

constexpr const char* kMarkup = "</script><script>alert(1)</script><!--";

struct Folder {
  explicit Folder(const char* name) : path(std::filesystem::path(::testing::TempDir()) / name) {
    std::filesystem::create_directories(path / "deep");
  }
  ~Folder() { std::filesystem::remove_all(path); }
  std::filesystem::path path;
};

/// What stands between the two halves of a page.
std::string inside(const std::string& page) {
  EXPECT_TRUE(page.starts_with("<before>") && page.ends_with("<after>")) << page.substr(0, 40);
  return page.substr(8, page.size() - 15);
}

TEST(PageFile, NamesWithMarkupAreTextAlone) {
  const Folder folder("page_file_markup");
  write_asset(folder.path / "deep" / "b.glb", {.bodies = {testing::block_model(2, kMarkup)}});
  nlohmann::json scene = {{"step", 0.01}, {"duration", 1}, {"assets", {{kMarkup, "deep/b.glb"}}}};
  scene["bodies"].push_back({{"name", kMarkup}, {"asset", kMarkup}});
  write_file(folder.path / "s.json", scene.dump());
  const PageContent content = page_of_scene(folder.path / "s.json");
  const std::string json = inside(page_with("<before>@FILES@<after>", content));
  EXPECT_EQ(json.find_first_of("<>&"), json.npos);
  EXPECT_THAT(json, ::testing::Not(::testing::HasSubstr("deep"))) << "nor where files were";
}

/// The page's files alone make the same scene.
TEST(PageFile, TheFilesInsideAreTheWholeScene) {
  const Folder folder("page_file_whole"), other("page_file_unpacked");
  write_asset(folder.path / "deep" / "b.glb", testing::block_asset(3));
  write_file(folder.path / "tet.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n");
  write_file(folder.path / "s.json", R"({"step": 0.01, "duration": 1, "contact": {},
    "assets": {"x": "deep/b.glb", "y": "deep/../deep/b.glb"},
    "statics": [{"name": "rock", "shape": {"hull": {"file": "tet.obj"}}}],
    "bodies": [{"name": "a", "asset": "x", "position": [0, 0, 3]}, {"name": "b", "asset": "y", "position": [3, 0, 3]}]})");
  const PageContent content = page_of_scene(folder.path / "s.json");
  EXPECT_EQ(content.files.size(), 3u) << "one asset, one shape, the scene";
  for (const PageFile& file : content.files)
    write_file(other.path / std::filesystem::path(file.path).filename(), file.bytes);
  const Scene scene = read_scene(other.path / "s.json");
  EXPECT_EQ(load_models(scene).of_body[0]->modes(), 3);
  EXPECT_EQ(scene.bodies.size(), 2u);
}

TEST(PageFile, AnAssetFallsOnTheGround) {
  const Folder folder("page_file_asset");
  write_asset(folder.path / "b.glb", {.bodies = {testing::block_model(2), testing::block_model(1, "other")}});
  const PageContent content = page_of_asset(folder.path / "b.glb");
  for (const PageFile& file : content.files)
    write_file(folder.path / std::filesystem::path(file.path).filename(), file.bytes);
  const Scene scene = read_scene(folder.path / std::filesystem::path(content.scene).filename());
  ASSERT_EQ(scene.bodies.size(), 2u);
  EXPECT_TRUE(scene.contacts.options.has_value());
  EXPECT_NEAR(scene.bodies[0].placement.pose.p.z(), 1.0, 1e-6);
  EXPECT_GT(scene.bodies[1].placement.pose.p.x() - scene.bodies[0].placement.pose.p.x(), testing::kBlockLength);
}

/// Two blocks on a hinge.
Asset hinged_blocks(bool tied) {
  ModalModelData first = testing::block_data(2, "first"), other = testing::block_data(1, "other");
  first.origin_in_input = Vec3::Zero(), other.origin_in_input = {3, 0, 0};
  Asset asset;
  for (ModalModelData* data : {&first, &other})
    asset.bodies.push_back(std::make_shared<const ModalModel>(std::move(*data)));
  asset.joints.push_back({.a = 0, .b = 1, .spec = {.type = JointType::kRevolute, .frame = {.origin = {1.5, 0, 0}}}});
  if (tied) asset.joints.push_back({.b = 0, .spec = {.type = JointType::kFixed}});
  return asset;
}

Scene scene_of(const Asset& asset, const Folder& folder) {
  write_asset(folder.path / "asset.glb", asset);
  write_file(folder.path / "s.json", page_of_asset(folder.path / "asset.glb").files[1].bytes);
  return read_scene(folder.path / "s.json");
}

TEST(PageFile, AMachineStandsAsDrawnOrFallsAsAWhole) {
  const Folder folder("page_file_machine");
  for (const bool tied : {true, false}) {
    const Scene scene = scene_of(hinged_blocks(tied), folder);
    ASSERT_EQ(scene.bodies.size(), 2u);
    ASSERT_EQ(scene.joints.size(), tied ? 2u : 1u);
    EXPECT_NEAR((scene.bodies[1].placement.pose.p - scene.bodies[0].placement.pose.p - Vec3(3, 0, 0)).norm(), 0.0,
                1e-12);
    EXPECT_NEAR(scene.bodies[0].placement.pose.p.z(), tied ? 0.5 : 1.0, 1e-6) << "on the ground, or half its height";
    EXPECT_TRUE(scene.contacts.options.has_value());
    EXPECT_EQ(scene.statics.size(), 1u);
  }
}

/// A hinge holds the weight of what hangs on it, however far it sticks out; one in free fall holds nothing.
TEST(PageFile, FrictionInAMachinesJointsHoldsIt) {
  const Folder folder("page_file_friction");
  const Scene tied = scene_of(hinged_blocks(true), folder);
  ASSERT_EQ(tied.joints[0].coordinates.size(), 1u);
  const double arm = 1.5;  // m, from the hinge to the centre of the block that hangs on it
  EXPECT_NEAR(tied.joints[0].coordinates[0].friction, 9.80665 * testing::kBlockMass * arm, 1e-9);
  EXPECT_TRUE(scene_of(hinged_blocks(false), folder).joints[0].coordinates.empty());
  Asset oiled = hinged_blocks(true);
  oiled.joints[0].coordinates = {{.friction = 0.25}};
  EXPECT_EQ(scene_of(oiled, folder).joints[0].coordinates[0].friction, 0.25) << "the asset's own";
}

/// On the first hinge of an arm of two links hangs all of it, stretched out though it is drawn folded.
TEST(PageFile, FrictionReckonsWithAnArmStretchedOut) {
  const Folder folder("page_file_stretched");
  Asset asset = hinged_blocks(true);
  ModalModelData last = testing::block_data(0, "last");
  last.origin_in_input = {3, 2, 0};
  asset.bodies.push_back(std::make_shared<const ModalModel>(std::move(last)));
  asset.joints.push_back({.a = 1, .b = 2, .spec = {.type = JointType::kRevolute, .frame = {.origin = {4, 0, 0}}}});
  const Scene scene = scene_of(asset, folder);
  const double link = 2.5, beyond = std::sqrt(5.0);  // m: from hinge to hinge, and from there to the centre
  EXPECT_NEAR(scene.joints[0].coordinates[0].friction, 9.80665 * testing::kBlockMass * (1.5 + link + beyond), 1e-9);
  EXPECT_NEAR(scene.joints[2].coordinates[0].friction, 9.80665 * testing::kBlockMass * beyond, 1e-9);
}

TEST(PageFile, AModelToBePosedTakesItsTrianglesAndJointsAlong) {
  const Folder folder("page_file_pose");
  write_file(folder.path / "m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 2 0 0\nf 1 3 2\nf 1 2 4\nf 2 3 5\n");
  write_file(folder.path / "j.json",
             R"({"components": [{"name": "</script>", "faces": [[2, 1]]}, {"name": "b", "faces": [[0, 2]]}],
    "joints": [{"a": 0, "b": 1, "type": "ball", "origin": [1, 0, 0]}]})");
  Warnings warnings;
  const GroupedSurface surface = read_grouped_surface(folder.path / "m.obj", warnings);
  const JointsFile joints = read_joints(folder.path / "j.json");
  const PageContent content = page_of_pose(surface, joints, "m", "\"j.json\"");
  for (const PageFile& file : content.files)
    write_file(folder.path / "deep" / std::filesystem::path(file.path).filename(), file.bytes);
  const JointsFile again = read_joints(folder.path / "deep" / std::filesystem::path(content.joints).filename());
  EXPECT_EQ(again.components[0].name, "</script>");
  const std::string page = page_with("<before>@FILES@<after>", content);
  EXPECT_EQ(inside(page).find_first_of("<>&"), std::string::npos);
  EXPECT_EQ(nlohmann::json::parse(inside(page))["joints"], content.joints);
}

/// Who builds the page is told of no host by it, and gets the same packages from whatever registry is configured.
TEST(PageFile, TheLockFileNamesNoHostAndFixesEveryPackage) {
  const auto lock =
      nlohmann::json::parse(read_file(std::filesystem::path(LIMBER_SOURCE_DIR) / "view/web/package-lock.json"));
  ASSERT_GT(lock["packages"].size(), 3u);
  for (const auto& [name, package] : lock["packages"].items()) {
    EXPECT_FALSE(package.contains("resolved")) << name;
    if (name.empty()) continue;  // the page's own
    EXPECT_THAT(package.value("integrity", ""), ::testing::StartsWith("sha512-")) << name;
  }
  EXPECT_EQ(lock.dump().find("://"), std::string::npos);
}

TEST(PageFile, AnAssetDrawnWithYUpStandsUpright) {
  const Folder folder("page_file_up");
  ModalModelData data = testing::block_data(1);
  for (Vec3f& p : data.render.rest) p.y() *= 3.0f;
  write_asset(folder.path / "b.glb", {.bodies = {std::make_shared<const ModalModel>(std::move(data))}});
  const PageContent content = page_of_asset(folder.path / "b.glb", UpAxis::kY);
  write_file(folder.path / "asset.glb", content.files[0].bytes);
  write_file(folder.path / "s.json", content.files[1].bytes);
  const BodyPlacement placed = read_scene(folder.path / "s.json").bodies[0].placement;
  EXPECT_NEAR((placed.pose.q * Vec3::UnitY() - Vec3::UnitZ()).norm(), 0.0, 1e-12);
  EXPECT_NEAR(placed.pose.p.z(), 1.5 + 1.5, 1e-6) << "its lowest point half its height above the ground";
}

TEST(PageFile, AnAssetThatWasBakedFromGltfStandsUpright) {
  const Folder folder("page_file_gltf");
  for (const auto& [input, y_up] : std::vector<std::pair<const char*, bool>>{
           {"duck.glb", true}, {"duck.gltf", true}, {"duck.obj", false}, {"", false}}) {
    write_asset(folder.path / "b.glb", {.bodies = {testing::block_model(1)}, .provenance = {.input = input}});
    const auto turned = [&](std::optional<UpAxis> up) {
      const auto scene = nlohmann::json::parse(page_of_asset(folder.path / "b.glb", up).files[1].bytes);
      return scene["bodies"][0].contains("orientation");
    };
    EXPECT_EQ(turned({}), y_up) << input;
    EXPECT_FALSE(turned(UpAxis::kZ)) << input;
  }
}

TEST(PageFile, WhatIsWrongIsToldBeforeThereIsAPage) {
  const Folder folder("page_file_wrong");
  write_file(folder.path / "b.glb", "no asset");
  write_file(folder.path / "s.json", R"({"step": 0.01, "duration": 1, "assets": {"x": "b.glb"},
    "bodies": [{"name": "a", "asset": "x"}]})");
  EXPECT_THROW(page_of_scene(folder.path / "s.json"), InputError);
  EXPECT_THROW(page_of_asset(folder.path / "b.glb"), InputError);
  EXPECT_THROW(page_with("<html>", {}), InvalidArgument);
}

}  // namespace
}  // namespace limber
