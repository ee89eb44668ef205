// Assets whose bodies are joined, in a world and in scenes.
#include "limber/scene/machine.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <numbers>

#include "block_model.h"
#include "limber/collision/contact_finder.h"
#include "limber/collision/manifold_finder.h"
#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/scene/run.h"
#include "limber/scene/scene_player.h"

namespace limber {
namespace {

using ::testing::HasSubstr;

constexpr Index kBlockModes = 2;
const RigidTransform kPose{quaternion_from_rotation_vector({0.3, -0.5, 0.9}), {3.0, 1.0, 2.0}};

std::shared_ptr<const ModalModel> block_at(const char* name, const Vec3& place) {
  ModalModelData data = testing::block_data(kBlockModes, name);
  data.origin_in_input = place;
  return std::make_shared<const ModalModel>(std::move(data));
}

/// Two blocks end to end, hinged where they meet, the first one tied to the world by a ball; a third one overlaps the
/// second.
Asset chain() {
  constexpr double kL = testing::kBlockLength;
  Asset asset{.bodies = {block_at("upper", {0, 0, 0}), block_at("lower", {kL, 0, 0}), block_at("loose", {kL, 0, 0.5})}};
  Mat3 about_y;
  about_y << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  asset.joints.push_back(
      {.b = 0, .spec = {.type = JointType::kBall, .frame = {.origin = {-0.5 * kL, 0, 0}}}, .patch_radius = 0.8});
  asset.joints.push_back({.a = 0,
                          .b = 1,
                          .spec = {.type = JointType::kRevolute,
                                   .frame = {.origin = {0.5 * kL, 0, 0}, .axes = about_y},
                                   .limits = {.rotation = {-0.4, 0.3}}},
                          .patch_radius = 0.8,
                          .coordinates = {{.friction = 0.2}}});
  asset.apart.push_back({1, 2});
  return asset;
}

World world_with(ContactSource& finder, ContactSolver solver = kDefaultContactSolver) {
  World world({.step = 0.01});
  world.set_contact_source(&finder, {.solver = solver});
  return world;
}

TEST(Machine, StandsWhereItIsPutAndMovesByItsJoints) {
  ContactFinder finder;
  World world = world_with(finder, ContactSolver::kExact);
  const Asset asset = chain();
  const Machine machine = add_machine(world, asset, {.pose = kPose});
  ASSERT_EQ(machine.bodies.size(), 3u);
  ASSERT_EQ(machine.joints.size(), 2u);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_LT((world.body(machine.bodies[i]).pose.p - kPose * asset.bodies[i]->data().origin_in_input).norm(), 1e-15);
  double swing = 0.0;
  for (int step = 0; step < 200; ++step) {
    world.step();
    for (const JointId id : machine.joints) EXPECT_LT(world.joint(id).distance_error, 1e-9);
    const double q = world.joint(machine.joints[1]).position[0];
    EXPECT_GT(q, -0.4 - 1e-6);
    EXPECT_LT(q, 0.3 + 1e-6);
    swing = std::max(swing, std::abs(q));
  }
  EXPECT_GT(swing, 0.05) << "rad";
}

TEST(Machine, PairsOfTheAssetHaveNoContacts) {
  ManifoldFinder finder;
  World world = world_with(finder);
  const Machine machine = add_machine(world, chain());
  const auto touch = [&] {
    world.step();
    const auto low = static_cast<Index>(machine.bodies[1].index), high = static_cast<Index>(machine.bodies[2].index);
    for (const ContactEvent& e : world.contact_events())
      if (std::min(e.a, e.b) == low && std::max(e.a, e.b) == high && e.phase != ContactPhase::kEnded) return true;
    return false;
  };
  EXPECT_FALSE(touch());
  world.ignore_collision(machine.bodies[2], machine.bodies[1], false);
  EXPECT_TRUE(touch()) << "they overlap by half";
  world.ignore_collision(machine.bodies[2], machine.bodies[1], true);
  EXPECT_FALSE(touch());
  EXPECT_THROW(world.ignore_collision(machine.bodies[0], machine.bodies[0], true), InvalidArgument);
}

TEST(Machine, UntiedItFallsAsOneThing) {
  World world({.step = 0.01});
  world.set_contact_source(nullptr, {.solver = ContactSolver::kExact});
  const Machine machine = add_machine(world, chain(), {.pose = kPose, .velocity = {1, 0, 0}, .tied = false});
  EXPECT_EQ(machine.joints[0], JointId{});
  const Vec3 start = world.body(machine.bodies[1]).pose.p;
  for (int step = 0; step < 50; ++step) world.step();
  const double g = world.options().gravity.z();
  EXPECT_LT((world.body(machine.bodies[1]).pose.p - start - Vec3(0.5, 0, 0.125 * g)).norm(), 1e-6);
}

/// A folder with the chain's asset in it.
class MachineScene : public ::testing::Test {
 protected:
  MachineScene() {
    std::filesystem::create_directories(folder_);
    write_asset(folder_ / "chain.glb", chain());
  }
  ~MachineScene() override { std::filesystem::remove_all(folder_); }
  Scene parse(const std::string& machines, const std::string& more = "") const {
    return parse_scene(R"({"step": 0.01, "steps": 40, "contact": {}, "assets": {"chain": "chain.glb"}, "machines": [)" +
                           machines + "]" + more + "}",
                       "scene.json", folder_);
  }
  std::string refusal(const std::string& machines, const std::string& more = "") const {
    try {
      parse(machines, more);
    } catch (const InputError& e) {
      return e.what();
    }
    return "accepted";
  }

 private:
  const std::filesystem::path folder_ =
      std::filesystem::path(::testing::TempDir()) / ::testing::UnitTest::GetInstance()->current_test_info()->name();
};

TEST_F(MachineScene, IsTheMachineOfTheWorld) {
  const Scene scene = parse(R"({"name": "m", "asset": "chain", "position": [3, 1, 2],
    "orientation": {"axis": [1, 0, 0], "degrees": 30}})");
  const RunResult run = run_scene(scene, load_models(scene));
  ManifoldFinder finder;
  World world = world_with(finder);
  add_machine(world, chain(), {.pose = {quaternion_from_rotation_vector({std::numbers::pi / 6.0, 0, 0}), {3, 1, 2}}});
  for (int step = 0; step < 40; ++step) world.step();
  EXPECT_EQ(run.state_hash, world.state_hash());
}

TEST_F(MachineScene, CopiesAreMachinesOfTheirOwnAndLoadsNameTheirBodies) {
  const Scene scene = parse(
      R"({"name": "m", "asset": "chain", "tied": false, "copies": {"count": [3, 1, 1], "spacing": [0, 9, 0]},
          "drives": [{"a": "upper", "b": "lower", "coordinates": [{"motor": {"velocity": 1, "max_force": 5}}]}]})",
      R"(, "strikes": [{"body": "m/lower", "time": 0, "at": {"vertex": 0}, "impulse": [0, 0, 1]}])");
  ASSERT_EQ(scene.bodies.size(), 9u);
  EXPECT_EQ(scene.bodies[3].name, "m[1]/upper");
  ASSERT_EQ(scene.joints.size(), 3u) << "the ball to the world is left out";
  EXPECT_EQ(scene.joints[1].a, "m[1]/upper");
  EXPECT_EQ(scene.joints[1].coordinates[0].motor_max_force, 5.0);
  EXPECT_EQ(scene.joints[1].coordinates[0].friction, 0.0) << "the asset's own is replaced";
  EXPECT_EQ(scene.contacts.apart.size(), 3u);
  const SceneModels models = load_models(scene);
  EXPECT_EQ(ScenePlayer(scene, models, 10).strikes().size(), 3u);
}

TEST_F(MachineScene, WhatIsWrongIsNamed) {
  EXPECT_THAT(refusal(R"({"name": "m", "asset": "chan"})"), HasSubstr("did you mean \"chain\""));
  EXPECT_THAT(refusal(R"({"name": "m", "asset": "chain", "tide": true})"), HasSubstr("\"tied\""));
  EXPECT_THAT(refusal(R"({"name": "m", "asset": "chain", "shape": {"sphere": {"radius": 1}}})"), HasSubstr(".shape"));
  EXPECT_THAT(refusal(R"({"name": "m", "asset": "chain", "drives": [{"a": "upper", "b": "lowr", "coordinates": []}]})"),
              HasSubstr("did you mean \"lower\""));
  EXPECT_THAT(
      refusal(R"({"name": "m", "asset": "chain", "drives": [{"a": "upper", "b": "loose", "coordinates": []}]})"),
      HasSubstr("no joint from \"upper\" to \"loose\""));
  EXPECT_THAT(refusal(R"({"name": "m", "asset": "chain"}, {"name": "m", "asset": "chain"})"),
              HasSubstr("the name of another body"));
  EXPECT_THAT(refusal(R"({"name": "m", "asset": "chain"})", R"(, "apart": [["m/upper", "m/uper"]])"),
              HasSubstr("did you mean \"m/upper\""));
}

}  // namespace
}  // namespace limber
