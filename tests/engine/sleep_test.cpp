#include <gtest/gtest.h>

#include "grounded_world.h"
#include "limber/core/error.h"

namespace limber::testing {
namespace {

const WorldOptions kSleepy{.sleep = {.enabled = true}};
constexpr double kHeight = 0.2;  // of a box, m

/// Boxes laid on each other, at rest and asleep.
struct SleepingStack : GroundedWorld {
  explicit SleepingStack(int count = 3, int modes = 0, const ContactOptions& options = {})
      : GroundedWorld(options, kSleepy) {
    const auto model = damped_box(modes, 60.0);
    for (int i = 0; i < count; ++i) boxes.push_back(world.add_body(model, {.pose = {{}, place(*model, i)}}));
    step(120);
  }
  static Vec3 place(const ModalModel& model, int i) {
    return {0.02 * (i % 2), 0.01 * i, depth_below_origin(model) + kHeight * i};
  }
  int asleep() const {
    return static_cast<int>(std::count_if(boxes.begin(), boxes.end(), [&](BodyId b) { return world.is_asleep(b); }));
  }
  std::vector<BodyId> boxes;
};

TEST(Sleep, AStackFallsAsleepAndKeepsItsPlaceAndEnergyToTheBit) {
  for (const int modes : {0, 6}) {
    const int count = 3;
    SleepingStack scene(count, modes);
    ASSERT_EQ(scene.asleep(), count);
    std::vector<RigidTransform> poses;
    std::vector<double> energies;
    for (const BodyId b : scene.boxes) {
      poses.push_back(scene.world.body(b).pose);
      energies.push_back(scene.world.energy(b).total());
    }
    scene.step(600);
    for (std::size_t i = 0; i < scene.boxes.size(); ++i) {
      EXPECT_EQ(scene.world.body(scene.boxes[i]).pose.p, poses[i].p);
      EXPECT_EQ(scene.world.energy(scene.boxes[i]).total(), energies[i]);
    }
    EXPECT_EQ(scene.world.constraint_report().rows, 0);
  }
}

/// Its lowest modes pass through rest at 13 mm/s, between the impulses of two substeps.
TEST(Sleep, AStackWhoseSlowModesCarryMuchFallsAsleep) {
  GroundedWorld scene({}, kSleepy);
  const auto model = damped_box(6, 25.0);
  std::vector<BodyId> boxes;
  for (int i = 0; i < 6; ++i)
    boxes.push_back(scene.world.add_body(model, {.pose = {{}, SleepingStack::place(*model, i)}}));
  scene.step(300);
  for (const BodyId b : boxes) EXPECT_TRUE(scene.world.is_asleep(b));
}

TEST(Sleep, NobodySleepsUnlessAskedTo) {
  GroundedWorld scene;
  const auto model = damped_box(0, 60.0);
  const BodyId box = scene.world.add_body(model, {.pose = {{}, {0.0, 0.0, depth_below_origin(*model)}}});
  scene.step(200);
  EXPECT_FALSE(scene.world.is_asleep(box));
}

TEST(Sleep, TheWholeStackWakesWhenItIsHit) {
  SleepingStack scene;
  ASSERT_EQ(scene.asleep(), 3);
  scene.world.add_body(damped_box(0, 60.0), {.pose = {{}, {0.0, 0.0, 1.0}}});
  scene.step(5);
  EXPECT_EQ(scene.asleep(), 3) << "it is still far";
  scene.step(20);
  EXPECT_EQ(scene.asleep(), 0);
}

TEST(Sleep, WhatIsHitFallsAsleepAgainUnderWhatHitIt) {
  SleepingStack scene(1);
  const BodyId falling = scene.world.add_body(damped_box(0, 60.0), {.pose = {{}, {0.0, 0.0, 0.6}}});
  scene.step(25);
  EXPECT_EQ(scene.asleep(), 0);
  scene.step(300);
  EXPECT_EQ(scene.asleep(), 1);
  EXPECT_TRUE(scene.world.is_asleep(falling));
  EXPECT_NEAR(scene.world.body(falling).pose.p.z(), SleepingStack::place(scene.world.model(falling), 1).z(), 1e-2);
}

TEST(Sleep, WakingChangesNothingAboutWhatStands) {
  SleepingStack scene(3, 0, exactly());
  const Vec3 before = scene.world.body(scene.boxes[2]).pose.p;
  scene.world.wake(scene.boxes[1]);
  EXPECT_EQ(scene.asleep(), 0);
  scene.world.step();
  for (const ContactEvent& e : scene.world.contact_events()) EXPECT_EQ(e.phase, ContactPhase::kLasting);
  EXPECT_FALSE(scene.world.contact_events().empty());
  scene.step(10);
  EXPECT_LT((scene.world.body(scene.boxes[2]).pose.p - before).norm(), 1e-7);
}

TEST(Sleep, RemovingTheSupportWakesWhatRestsOnIt) {
  {
    SleepingStack scene;
    scene.world.remove_body(scene.boxes[0]);
    scene.step(60);
    EXPECT_NEAR(lowest(scene.world, scene.boxes[1]), 0.0, 1e-3);
  }
  SleepingStack scene;
  scene.world.remove_body(scene.ground);
  scene.step(60);
  EXPECT_LT(lowest(scene.world, scene.boxes[0]), -1.0);
}

TEST(Sleep, LoadsStatesAndConstraintsWake) {
  const SurfacePoint at{.triangle = 0};
  const auto wakes = [&](auto&& what) {
    SleepingStack scene(1);
    const BodyId box = scene.boxes[0];
    EXPECT_TRUE(scene.world.is_asleep(box));
    what(scene.world, box);
    return !scene.world.is_asleep(box);
  };
  EXPECT_TRUE(wakes([&](World& w, BodyId b) { w.apply_force(b, at, {1.0, 0.0, 0.0}); }));
  EXPECT_TRUE(wakes([&](World& w, BodyId b) { w.apply_impulse(b, at, {1.0, 0.0, 0.0}); }));
  EXPECT_TRUE(wakes([&](World& w, BodyId b) { w.set_velocity(b, {1.0, 0.0, 0.0}, Vec3::Zero()); }));
  EXPECT_TRUE(wakes([&](World& w, BodyId b) { w.set_pose(b, {{}, {0.0, 0.0, 1.0}}); }));
  EXPECT_TRUE(wakes([&](World& w, BodyId b) { w.add_handle(b, at); }));
  EXPECT_TRUE(wakes([&](World& w, BodyId b) { w.add_joint({}, b, {.type = JointType::kBall}); }));
  EXPECT_TRUE(wakes([&](World& w, BodyId) { w.set_contact_source(nullptr); }));
  EXPECT_FALSE(wakes([&](World& w, BodyId) { w.step(); }));
}

TEST(Sleep, AHandleThatMovesKeepsItsBodyAwake) {
  GroundedWorld scene({}, kSleepy);
  const auto model = damped_box(0, 60.0);
  const BodyId box = scene.world.add_body(model, {.pose = {{}, {0.0, 0.0, 1.0}}});
  const HandleId hand = scene.world.add_handle(box, {.triangle = 0});
  scene.world.add_handle(box, {.triangle = 6});
  scene.world.add_handle(box, {.triangle = 2});
  scene.step(120);
  EXPECT_TRUE(scene.world.is_asleep(box));
  const Vec3 start = scene.world.handle(hand).target.position;
  scene.world.set_handle_target(hand, {.position = start, .velocity = {0.0, 0.0, 1e-5}});
  scene.step(120);
  EXPECT_FALSE(scene.world.is_asleep(box));
}

TEST(Sleep, TheSameCallsGiveTheSameBits) {
  const auto hash = [] {
    SleepingStack scene;
    scene.world.apply_impulse(scene.boxes[2], {.triangle = 0}, {0.3, 0.1, 0.0});
    scene.step(200);
    return scene.world.state_hash();
  };
  EXPECT_EQ(hash(), hash());
}

TEST(Sleep, OptionsAreChecked) {
  EXPECT_THROW(World({.sleep = {.time = -1.0}}), InvalidArgument);
  EXPECT_THROW(World({.sleep = {.speed = -1.0}}), InvalidArgument);
}

}  // namespace
}  // namespace limber::testing
