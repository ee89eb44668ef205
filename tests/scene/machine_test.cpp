// Machines of scenes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <numbers>

#include "jointed_blocks.h"
#include "limber/collision/manifold_finder.h"
#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/machine/machine.h"
#include "limber/scene/run.h"
#include "limber/scene/scene_player.h"

namespace limber {
namespace {

using ::testing::HasSubstr;

/// A folder with the chain's asset in it.
class MachineScene : public ::testing::Test {
 protected:
  MachineScene() {
    std::filesystem::create_directories(folder_);
    write_asset(folder_ / "chain.glb", testing::jointed_blocks());
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
  World world({.step = 0.01});
  world.set_contact_source(&finder, {});
  add_machine(world, testing::jointed_blocks(),
              {.pose = {quaternion_from_rotation_vector({std::numbers::pi / 6.0, 0, 0}), {3, 1, 2}}});
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
