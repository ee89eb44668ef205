// What the page drives, without a page.
#include "limber/view/page_world.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "block_model.h"
#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/core/stage_times.h"
#include "limber/dynamics/reconstruct.h"
#include "limber/scene/recording.h"
#include "limber/scene/run.h"
#include "limber/view/page_file.h"

namespace limber {
namespace {

constexpr Index kModes = 3;
constexpr const char* kScene = R"({"step": 0.01, "duration": 10, "assets": {"block": "block.glb"}, "contact": {},
  "statics": [{"name": "ground", "shape": {"half_space": {}}}],
  "sensors": [{"name": "low", "shape": {"box": {"half_extents": [2, 2, 0.2]}}, "position": [0, 0, 0], "meets": [0]},
              {"name": "aside", "shape": {"sphere": {"radius": 0.5}}, "position": [0, 9, 5]}],
  "bodies": [{"name": "a", "asset": "block", "position": [0, 0, 0.8]},
             {"name": "b", "asset": "block", "position": [5, 0, 0.8]}],
  "joints": [{"b": "b", "type": "ball", "origin": [5, 0, 2]}],
  "strikes": [{"body": "a", "time": 0.2, "at": {"vertex": 0}, "impulse": [0, 0.3, 0]}]})";

/// A scene in a folder of its own.
class PageWorldTest : public ::testing::Test {
 protected:
  PageWorldTest() {
    std::filesystem::create_directories(folder_);
    write_asset(folder_ / "block.glb", testing::block_asset(kModes));
    write_file(scene(), kScene);
  }
  ~PageWorldTest() override { std::filesystem::remove_all(folder_); }
  std::filesystem::path scene() const { return folder_ / "falls.json"; }
  void make_it_sound() const { write_asset(folder_ / "block.glb", testing::sounding_block_asset(kModes)); }

 private:
  const std::filesystem::path folder_ =
      std::filesystem::path(::testing::TempDir()) / ::testing::UnitTest::GetInstance()->current_test_info()->name();
};

void step(PageWorld& page, int count) {
  for (int i = 0; i < count; ++i) page.step(), page.keep();
}

TEST_F(PageWorldTest, LeftAloneItIsTheSceneThatSimulatePlays) {
  PageWorld page(scene());
  step(page, 50);
  const Scene told = read_scene(scene());
  EXPECT_EQ(page.state_hash(), run_scene(told, load_models(told), {.steps = 50}).state_hash);
}

TEST_F(PageWorldTest, ABentSurfaceAndAFrameGiveWhatTheEngineReconstructs) {
  PageWorld page(scene());
  step(page, 40);
  page.show_mode(0, 1, 0.2);
  const std::size_t vertices = page.models()[0].rest.size() / 3;
  const std::span<const float> frame = page.frame();
  const RigidTransform X{.q = normalized(Quaternion{frame[3], frame[4], frame[5], frame[6]}),
                         .p = {frame[0], frame[1], frame[2]}};
  std::vector<float> positions(3 * vertices), normals(3 * vertices);
  page.reconstruct(0, positions.data());
  vertex_normals(testing::block_data(kModes).render.triangles, positions, normals);
  const PageSurface bent = page.bent(0, 0.0);
  ASSERT_EQ(bent.modes, 2);
  ASSERT_EQ(bent.positions.size(), positions.size());
  for (std::size_t v = 0; v < vertices; ++v) {
    const auto at = [v](std::span<const float> of) { return Vec3(of[3 * v], of[3 * v + 1], of[3 * v + 2]); };
    EXPECT_LT((X * at(bent.positions) - at(positions)).norm(), 1e-6) << v;  // m, of a block of 2 m in single precision
    EXPECT_LT((X.q * at(bent.normals) - at(normals)).norm(), 1e-5) << v;
  }
}

TEST_F(PageWorldTest, ASurfaceIsBentByNoMoreModesThanOneSees) {
  PageWorld page(scene());
  EXPECT_EQ(page.bent(0, 0.0).modes, 0) << "at rest";
  page.poke(page.cast_ray({-10, 0.1, 0.9}, {1, 0, 0}), {1, 0.3, 0.2});
  step(page, 3);
  const PageSurface all = page.bent(0, 0.0);
  ASSERT_EQ(all.modes, kModes);
  const std::vector<float> exact(all.positions.begin(), all.positions.end());
  bool fewer = false;
  for (double tolerance = 1.0; tolerance > 1e-7; tolerance *= 0.5) {
    const PageSurface seen = page.bent(0, tolerance);
    fewer = fewer || (seen.modes > 0 && seen.modes < kModes);
    const std::span<const float> drawn = seen.modes > 0 ? seen.positions : std::span(page.models()[0].rest);
    for (std::size_t i = 0; i < exact.size(); i += 3)
      EXPECT_LE(std::hypot(drawn[i] - exact[i], drawn[i + 1] - exact[i + 1], drawn[i + 2] - exact[i + 2]),
                tolerance + 1e-6);
  }
  EXPECT_TRUE(fewer);
}

TEST_F(PageWorldTest, AModelMadeSoftGoesOnFromWhereItIs) {
  PageWorld page(scene());
  page.poke(page.cast_ray({-10, 0.1, 0.9}, {1, 0, 0}), {1, 0.3, 0.2});
  step(page, 3);
  const std::vector<double> baked = page.models()[0].frequencies;
  const auto frame = [&] { return std::vector<float>(page.frame().begin(), page.frame().end()); };
  const std::vector<float> before = frame();
  page.set_stiffness(0, 0.25);
  for (std::size_t i = 0; i < kModes; ++i)
    EXPECT_NEAR(page.models()[0].frequencies[i], 0.5 * baked[i], 1e-12 * baked[i]);
  EXPECT_EQ(frame(), before);
  const std::vector<std::byte> soft = page.saved();
  step(page, 5);
  const std::uint64_t hash = page.state_hash();
  page.restore(soft);
  EXPECT_DOUBLE_EQ(page.settings().stiffness[0], 0.25);
  step(page, 5);
  EXPECT_EQ(page.state_hash(), hash) << "a page that is shared is as soft";

  constexpr std::size_t kPose = 7;
  const std::vector<float> moved = frame();
  page.set_stiffness(0, kUnbounded);
  EXPECT_TRUE(page.models()[0].frequencies.empty());
  ASSERT_EQ(page.frame().size(), 2 * kPose);
  EXPECT_TRUE(std::equal(moved.begin(), moved.begin() + kPose, page.frame().begin()));
  step(page, 100);
  page.set_stiffness(0, 1.0);
  EXPECT_EQ(page.models()[0].frequencies, baked);
  EXPECT_THROW(page.set_stiffness(0, 0.0), InvalidArgument);
  EXPECT_THROW(page.set_stiffness(1, 1.0), InvalidArgument);
  EXPECT_EQ(page.models()[0].frequencies, baked);
}

TEST_F(PageWorldTest, ARayMeetsTheNearestBody) {
  const PageWorld page(scene());
  const PageHit hit = page.cast_ray({-10, 0.1, 0.9}, {2, 0, 0});
  EXPECT_EQ(hit.body, 0);
  EXPECT_NEAR(hit.point.x(), -1.0, 1e-6);
  EXPECT_NEAR(hit.distance, 9.0, 1e-6);
  EXPECT_EQ(page.cast_ray({-10, 0.1, 5.0}, {1, 0, 0}).body, -1);
}

TEST_F(PageWorldTest, ADragLiftsTheBodyAndLetsItGo) {
  PageWorld page(scene());
  step(page, 60);
  ASSERT_TRUE(page.grab(page.cast_ray({0, 0, 10}, {0, 0, -1})));
  page.drag_to({0, 0, 4});
  step(page, 200);
  EXPECT_TRUE(page.holds());
  EXPECT_GT(page.frame()[2], 2.0f);
  // It swings there, and stays up: in the mean the hand bears the weight, but for what momentum is left at the end.
  constexpr int kSteps = 1000;
  constexpr double kWeight = testing::kBlockMass * 9.80665;
  double mean = 0.0;
  for (int i = 0; i < kSteps; ++i) {
    page.step();
    mean += page.hand().force.z() / kSteps;
  }
  EXPECT_NEAR(mean, kWeight, 0.1 * kWeight);
  page.let_go();
  EXPECT_FALSE(page.holds());
  step(page, 300);
  EXPECT_LT(page.frame()[2], 1.2f) << "it has fallen";
}

TEST_F(PageWorldTest, GoingBackAndForthGivesTheSameHashes) {
  PageWorld page(scene());
  std::vector<std::uint64_t> hashes{page.state_hash()};
  for (int i = 0; i < 60; ++i) {
    if (i == 10) page.grab(page.cast_ray({0, 0, 10}, {0, 0, -1})), page.drag_to({1, 0, 3});
    if (i == 25) page.let_go();
    if (i == 30) page.drop(0, {0, 0, 3});
    if (i == 40) page.drop(0, {0.5, 0, 5});
    step(page, 1);
    hashes.push_back(page.state_hash());
  }
  ASSERT_EQ(page.kept(), 61);
  for (const int key : {60, 0, 35, 20, 59, 10, 45, 31, 60}) {
    page.go_to(key);
    EXPECT_EQ(page.steps_taken(), page.kept_step(key));
    EXPECT_EQ(page.state_hash(), hashes[static_cast<std::size_t>(key)]) << key;
  }
  page.go_to(26);
  page.let_go();
  step(page, 1);
  EXPECT_EQ(page.kept(), 28) << "what came after belongs to another future";
  EXPECT_EQ(page.state_hash(), hashes[27]);
}

/// Of a run that nobody touched it is the file that simulate writes.
TEST_F(PageWorldTest, ASavedPageGoesOnToTheBit) {
  PageWorld page(scene());
  PageSettings settings = page.settings();
  settings.modes = 2;
  settings.gravity.z() = -5.0;
  page.restart(settings);
  step(page, 20);
  page.drop(0, {0, 0, 5});
  page.pin(page.cast_ray({5, 0, 10}, {0, 0, -1}));
  page.grab(page.cast_ray({0, 0, 3}, {0, 0, -1}));
  page.drag_to({0, 0, 4});
  page.lead_joint(0, 1, 0.3);
  step(page, 10);
  const std::vector<std::byte> saved = page.saved();
  PageWorld other(scene());
  step(other, 5);
  other.restore(saved);
  EXPECT_EQ(other.state_hash(), page.state_hash());
  EXPECT_EQ(other.settings().modes, 2);
  EXPECT_TRUE(other.holds());
  EXPECT_EQ(other.pins(), 1);
  EXPECT_EQ(other.joint_wishes()[2], 0.3);
  EXPECT_EQ(other.kept(), 2) << "the start and here";
  step(page, 30), step(other, 30);
  EXPECT_EQ(other.state_hash(), page.state_hash());
  EXPECT_EQ(other.saved(), page.saved());
  EXPECT_THROW(other.restore(std::span(saved).first(saved.size() / 2)), InvalidArgument);
  EXPECT_EQ(other.steps_taken(), 0) << "it starts anew";
}

TEST_F(PageWorldTest, ARecordingIsThatOfTheRun) {
  PageWorld page(scene());
  step(page, 30);
  const std::uint64_t before = page.state_hash();
  const std::string glb = page.recording();
  EXPECT_EQ(page.state_hash(), before);
  const Scene told = read_scene(scene());
  const RunResult run = run_scene(told, load_models(told), {.steps = 30, .key_rate = 1e6});
  EXPECT_EQ(glb, make_recording(run.trajectory).glb);
}

TEST_F(PageWorldTest, BodiesDroppedOnTheWayAreInTheRecording) {
  PageWorld page(scene());
  step(page, 5);
  page.drop(0, {0, 0, 4});
  step(page, 5);
  page.go_to(3);
  const std::string glb = page.recording();
  EXPECT_EQ(page.steps_taken(), 3);
  EXPECT_EQ(page.frame().size(), 2u * (7 + kModes)) << "the third body is not there yet";
  EXPECT_NE(glb.find("dropped[0]"), glb.npos);
}

TEST_F(PageWorldTest, PokesPushPinsHoldAndGravityTurns) {
  PageWorld page(scene());
  PageSettings settings = page.settings();
  settings.poke_speed = 2.0;
  page.set_live(settings);
  page.poke(page.cast_ray({0, 10, 0.8}, {0, -1, 0}), {0, -3, 0});
  EXPECT_NEAR(page.world().linear_momentum({0, 1}).y(), -2.0 * testing::kBlockMass, 1e-9);
  page.pin(page.cast_ray({0, 0, 10}, {0, 0, -1}));
  EXPECT_EQ(page.pins(), 1);
  settings.gravity = {0, 0, 3};
  page.set_live(settings);
  step(page, 100);
  EXPECT_LT(page.frame()[2], 2.5f) << "it is held";
  page.unpin();
  step(page, 100);
  EXPECT_GT(page.frame()[2], 1.5f) << "it rises";
}

TEST_F(PageWorldTest, BlowsAreNotedWhileSomebodyListens) {
  EXPECT_EQ(PageWorld(scene()).models()[0].sound, nullptr);
  EXPECT_THROW(PageWorld(scene()).sounding(0), InvalidArgument);
  make_it_sound();
  PageWorld page(scene());
  ASSERT_NE(page.models()[0].sound, nullptr);
  page.poke(page.cast_ray({0, 10, 0.8}, {0, -1, 0}), {0, -3, 0});
  step(page, 60);
  EXPECT_TRUE(page.take_blows().empty());
  page.restart(page.settings());
  page.listen(true);
  page.poke(page.cast_ray({0.25, 10, 0.9}, {0, -1, 0}), {0, -3, 0}, 2e-4);
  const std::span<const double> poke = page.take_blows();
  ASSERT_EQ(poke.size(), PageWorld::kBlowNumbers);
  EXPECT_EQ(poke[0], 0.0);
  const std::vector<Vec3f>& rest = page.world().model({0, 1}).collision().rest;
  Vec3 struck = Vec3::Zero();
  for (std::size_t i = 1; i <= 3; ++i) struck += poke[3 + i] * rest[static_cast<std::size_t>(poke[i])].cast<double>();
  EXPECT_LT((struck - Vec3(0.25, 0.5, 0.1)).norm(), 1e-6);
  EXPECT_LT((Vec3(poke[7], poke[8], poke[9]) - Vec3(0, -testing::kBlockMass, 0)).norm(), 1e-12);
  EXPECT_EQ(poke[10], 2e-4);
  EXPECT_EQ(poke[11], 0.0);
  EXPECT_LT((Vec3(poke[12], poke[13], poke[14]) - Vec3(0.25, 0.5, 0.9)).norm(), 1e-6);

  // The scene's strike at 0.2 s, and the ground: as a run notes them.
  step(page, 60);
  const std::span<const double> noted = page.take_blows();
  ASSERT_FALSE(noted.empty());
  EXPECT_EQ(noted.size() % PageWorld::kBlowNumbers, 0u);
  EXPECT_TRUE(page.take_blows().empty());
  page.restart(page.settings());
  step(page, 60);
  const std::size_t untouched = page.take_blows().size();
  const Scene told = read_scene(scene());
  RunResult run = run_scene(told, load_models(told), {.steps = 60, .keep_blows = true});
  std::erase_if(run.trajectory.blows, [&](const BlowRecord& b) {  // of what slides, of which a page is silent
    return b.other == BlowRecord::kNobody &&
           std::ranges::none_of(told.strikes, [&](const Strike& s) { return s.contact_time == b.contact_time; });
  });
  EXPECT_EQ(untouched, PageWorld::kBlowNumbers * run.trajectory.blows.size());
  EXPECT_GT(untouched, PageWorld::kBlowNumbers);
}

TEST_F(PageWorldTest, SettingsOfTheNextStartAreTaken) {
  PageWorld page(scene());
  PageSettings settings = page.settings();
  settings.modes = 1;
  settings.damping = 2.0;
  settings.step = 1.0 / 30.0;
  settings.friction = 0.1;
  page.restart(settings);
  EXPECT_EQ(page.steps_taken(), 0);
  EXPECT_EQ(page.models()[0].frequencies.size(), 1u);
  EXPECT_EQ(page.world().model({0, 1}).data().decays[0], 2.0 * testing::block_decay(0));
  EXPECT_EQ(page.world().options().step, 1.0 / 30.0);
  settings.step = -1.0;
  EXPECT_THROW(page.restart(settings), InvalidArgument);
  EXPECT_EQ(page.world().options().step, 1.0 / 30.0);
}

TEST_F(PageWorldTest, StagesOfAStepAreTimed) {
  PageWorld page(scene());
  step(page, 30);
  const std::span<const double> stages = page.stage_seconds();
  ASSERT_EQ(stages.size(), kStages);
  for (const Stage stage : {Stage::kBookkeeping, Stage::kBroadPhase, Stage::kSolve})
    EXPECT_GT(stages[static_cast<std::size_t>(stage)], 0.0) << to_string(stage);
  EXPECT_EQ(stages[static_cast<std::size_t>(Stage::kReconstruct)], 0.0) << "is no part of a step";
}

TEST_F(PageWorldTest, SensorsCountWhoIsInside) {
  PageWorld page(scene());
  step(page, 1);
  const auto counts = [&] { return std::vector<double>(page.sensor_counts().begin(), page.sensor_counts().end()); };
  EXPECT_EQ(counts(), (std::vector<double>{1, 0}));  // the ground is in a layer too
  step(page, 60);
  EXPECT_EQ(counts(), (std::vector<double>{2, 0}));
  page.go_to(1);
  EXPECT_EQ(counts(), (std::vector<double>{1, 0}));
}

TEST_F(PageWorldTest, ARayMeetsTheBodiesInItsWayAndTheGround) {
  PageWorld page(scene());
  step(page, 1);
  const std::span<const double> places = page.ray_places({0, 0, 5}, {0, 0, -2});
  ASSERT_EQ(places.size(), 14u);
  const PageHit first = page.cast_ray({0, 0, 5}, {0, 0, -2});
  EXPECT_EQ(places[0], 0.0);
  EXPECT_EQ(places[3], first.point.z());
  EXPECT_EQ(places[7], -1.0);
  EXPECT_NEAR(places[10], 0.0, 1e-12);
  EXPECT_NEAR(places[13], 1.0, 1e-12);
  EXPECT_TRUE(page.ray_places({0, 0, 5}, {0, 0, 1}).empty());
}

/// The coordinate of a joint, as the page is told it.
double coordinate(PageWorld& page, int c) { return page.joint_frames()[static_cast<std::size_t>(6 + c)]; }

TEST_F(PageWorldTest, AJointGoesWhereItIsLedRunsAndIsLeft) {
  PageWorld page(scene());
  page.lead_joint(0, 1, 0.4);
  step(page, 200);
  EXPECT_NEAR(coordinate(page, 1), 0.4, 0.05);
  EXPECT_EQ(page.joint_wishes()[2], 0.4);
  const int led = page.kept() - 1;
  page.run_joint(0, 1, -1.0);
  step(page, 50);
  EXPECT_NEAR(coordinate(page, 1), 0.4 - 0.5, 0.1) << "half a second at a radian a second";
  EXPECT_TRUE(std::isnan(page.joint_wishes()[2]));
  EXPECT_EQ(page.joint_wishes()[3], -1.0);
  page.leave_joint(0, 1);
  EXPECT_TRUE(std::isnan(page.joint_wishes()[3]));
  page.go_to(led);
  EXPECT_EQ(page.joint_wishes()[2], 0.4) << "it is led again, as then";
  step(page, 50);
  EXPECT_NEAR(coordinate(page, 1), 0.4, 0.05);
  EXPECT_THROW(page.lead_joint(1, 0, 0.0), InvalidArgument);
  EXPECT_THROW(page.lead_joint(0, 3, 0.0), InvalidArgument);
}

/// A post that stands, and a block on a hinge at its side.
TEST_F(PageWorldTest, AMachineStaysWhereItIsPut) {
  ModalModelData post = testing::block_data(2, "post"), arm = testing::block_data(3, "arm");
  post.origin_in_input = Vec3::Zero(), arm.origin_in_input = {2.1, 0, 0};
  Asset asset;
  for (ModalModelData* data : {&post, &arm})
    asset.bodies.push_back(std::make_shared<const ModalModel>(std::move(*data)));
  JointSpec hinge{.type = JointType::kRevolute, .frame = {.origin = {1.05, 0, 0.5}}};
  hinge.frame.axes << 0, 0, 1, 1, 0, 0, 0, 1, 0;  // about y
  asset.joints = {{.a = 0, .b = 1, .spec = hinge}, {.b = 0, .spec = {.type = JointType::kFixed}, .patch_radius = 2.0}};
  const std::filesystem::path folder = scene().parent_path();
  write_asset(folder / "machine.glb", asset);
  const PageContent content = page_of_asset(folder / "machine.glb");
  for (const PageFile& file : content.files)
    write_file(folder / std::filesystem::path(file.path).filename(), file.bytes);
  PageWorld page(folder / "machine.json");
  step(page, 120);
  EXPECT_NEAR(coordinate(page, 0), 0.0, 0.02) << "rad; by friction";
  page.drop(1, {0, 0, 4});
  step(page, 120);
  EXPECT_NEAR(coordinate(page, 0), 0.0, 0.02);
  EXPECT_FALSE(page.contacts().empty()) << "on the post";
}

TEST_F(PageWorldTest, ContactsBearWhatLiesOnThem) {
  PageWorld page(scene());
  double sum = 0.0;
  constexpr int kLast = 50;  // steps of the mean
  for (int i = 0; i < 400; ++i) {
    page.step();
    const std::span<const double> contacts = page.contacts();
    for (std::size_t c = 0; c < contacts.size() && i >= 400 - kLast; c += 6) {
      sum += contacts[c + 5] / kLast;
      EXPECT_NEAR(contacts[c + 2], 0.0, 0.05) << "on the ground";
    }
  }
  EXPECT_NEAR(sum, 9.80665 * testing::kBlockMass, 0.05 * 9.80665 * testing::kBlockMass) << "the block that lies, alone";
}

TEST_F(PageWorldTest, WhatTouchesIsTheDrawnSurfaceWhereThereIsNoOther) {
  PageWorld page(scene());
  EXPECT_EQ(&page.touching(0), &page.models()[0]);
  ModalModelData data = testing::block_data(kModes);
  data.collision = testing::block_surface(2, kModes);
  write_asset(scene().parent_path() / "block.glb", {.bodies = {std::make_shared<const ModalModel>(std::move(data))}});
  PageWorld other(scene());
  EXPECT_EQ(other.touching(0).rest.size(), 3u * 12u);
  EXPECT_GT(other.models()[0].rest.size(), 3u * 12u);
  EXPECT_THROW(other.touching(1), InvalidArgument);
}

TEST_F(PageWorldTest, TheDescriptionNamesWhatIsThere) {
  const PageWorld page(scene());
  const auto json = nlohmann::json::parse(page.description());
  EXPECT_EQ(json["bodies"].size(), 2u);
  EXPECT_EQ(json["models"].size(), 1u);
  EXPECT_EQ(json["models"][0]["vertices"], 68);
  EXPECT_EQ(json["joints"][0]["type"], "ball");
  EXPECT_EQ(json["statics"][0]["ground"], true);
  ASSERT_EQ(json["sensors"].size(), 2u);
  EXPECT_EQ(json["sensors"][1]["name"], "aside");
  const auto& points = json["sensors"][0]["points"];
  ASSERT_GE(points.size(), 24u);  // a box
  for (std::size_t i = 0; i < points.size(); i += 3) EXPECT_NEAR(std::abs(points[i + 2].get<double>()), 0.2, 1e-12);
}

}  // namespace
}  // namespace limber
