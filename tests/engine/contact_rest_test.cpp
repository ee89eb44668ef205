// Bodies that fall or are laid down come to rest: alone, stacked, in piles, rigid and flexible.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "asked.h"
#include "bar_model.h"
#include "grounded_world.h"
#include "pile.h"

namespace limber::testing {
namespace {

constexpr int kStepsToRest = kSanitized ? 60 : 300;  // of the largest stack

TEST(WorldContact, AFallingBoxComesToRestOnTheGround) {
  for (const int modes : {0, 12}) {
    GroundedWorld scene;
    World& world = scene.world;
    const BodyId box = world.add_body(damped_box(modes, 30.0), {.pose = {{}, {0.0, 0.0, 0.6}}});
    for (int i = 0; i < 300; ++i) world.step();
    const Vec3 before = world.body(box).pose.p;
    for (int i = 0; i < 60; ++i) world.step();
    EXPECT_GT(lowest(world, box), -1e-3 * kSampleSize) << modes;
    EXPECT_LT((world.body(box).pose.p - before).norm(), 1e-4) << modes;
  }
}

TEST(WorldContact, ABoxOnABoxStands) {
  constexpr double kHeight = 0.2, kPenetration = 1e-3 * kSampleSize, kShift = 1e-4;  // m
  for (const int modes : {0, 6}) {
    GroundedWorld scene;
    World& world = scene.world;
    const auto model = damped_box(modes, 60.0);
    const BodyId lower = world.add_body(model, {.pose = {{}, {0.0, 0.0, 0.13}}});
    const BodyId upper = world.add_body(
        model, {.pose = {quaternion_from_rotation_vector({0.0, 0.0, 0.05}), {0.02, 0.015, 0.13 + kHeight + 0.02}}});
    for (int i = 0; i < 300; ++i) world.step();
    const Vec3 before = world.body(upper).pose.p;
    for (int i = 0; i < 60; ++i) world.step();
    EXPECT_LT((world.body(upper).pose.p - before).norm(), kShift) << modes;
    EXPECT_GT(lowest(world, lower), -kPenetration) << modes;
    EXPECT_NEAR(lowest(world, upper), kHeight, 2.0 * kPenetration) << modes;
  }
}

/// A rigid box on one that is ten thousand times lighter.
TEST(WorldContact, ABoxStandsOnAMuchLighterOne) {
  constexpr double kHeight = 0.2;  // m, of the one below
  GroundedWorld scene(exactly({.recovery_speed = 0.0}));
  World& world = scene.world;
  const auto light = sample_model({.modes = 0});
  ModalModelData d = sample_model_data({.modes = 0});
  d.mass *= 1e4, d.inertia *= 1e4;
  const double half = depth_below_origin(*light);
  const BodyId below = world.add_body(light, {.pose = {.p = {0.0, 0.0, half}}});
  const BodyId above =
      world.add_body(std::make_shared<const ModalModel>(std::move(d)), {.pose = {.p = {0.0, 0.0, kHeight + half}}});
  const Vec3 start = world.body(above).pose.p;
  for (int i = 0; i < 300; ++i) {
    world.step();
    ASSERT_TRUE(world.constraint_report().solved) << i;
  }
  EXPECT_LE(world.constraint_report().residual, 1.0);
  EXPECT_LT((world.body(above).pose.p - start).norm(), 1e-4 * kSampleSize);
  EXPECT_GT(lowest(world, below), -1e-5 * kSampleSize);
  EXPECT_LT(world.body(above).velocity.norm(), 1e-6);
}

TEST(WorldContact, AStackOfTenRigidBoxesStands) {
  constexpr int kBoxes = 10;
  constexpr double kHeight = 0.2, kApart = 1e-5;                      // of a box; between boxes, m
  constexpr double kPenetration = 1e-3 * kSampleSize, kShift = 1e-4;  // m
  GroundedWorld scene(exactly());
  World& world = scene.world;
  const auto model = damped_box(0, 60.0);
  std::vector<BodyId> boxes;
  for (int i = 0; i < kBoxes; ++i) {
    const Vec3 place(0.02 * (i % 2), 0.015 * (i % 3), depth_below_origin(*model) + kApart + i * (kHeight + kApart));
    boxes.push_back(world.add_body(model, {.pose = {quaternion_from_rotation_vector({0.0, 0.0, 0.05 * i}), place}}));
  }
  for (int i = 0; i < kStepsToRest; ++i) world.step();
  std::vector<Vec3> before;
  for (const BodyId box : boxes) before.push_back(world.body(box).pose.p);
  for (int i = 0; i < 60; ++i) world.step();
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    EXPECT_LT((world.body(boxes[i]).pose.p - before[i]).norm(), kShift) << i;
    EXPECT_NEAR(lowest(world, boxes[i]), static_cast<double>(i) * kHeight, kPenetration) << i;
  }
}

TEST(WorldContact, StacksOfRigidBoxesThatAreDroppedStand) {
  constexpr double kHeight = 0.2, kApart = 0.02;                      // of a box; between boxes, m
  constexpr double kPenetration = 1e-3 * kSampleSize, kShift = 1e-4;  // m
  const auto model = damped_box(0, 60.0);
  for (const int count : {3, 5}) {
    GroundedWorld scene(exactly());
    World& world = scene.world;
    std::vector<BodyId> boxes;
    for (int i = 0; i < count; ++i) {
      const Vec3 place(0.02 * (i % 2), 0.015 * (i % 3), depth_below_origin(*model) + kApart + i * (kHeight + kApart));
      boxes.push_back(world.add_body(model, {.pose = {quaternion_from_rotation_vector({0.0, 0.0, 0.05 * i}), place}}));
    }
    scene.step(300);
    std::vector<Vec3> before;
    for (const BodyId box : boxes) before.push_back(world.body(box).pose.p);
    scene.step(60);
    for (std::size_t i = 0; i < boxes.size(); ++i) {
      EXPECT_LT((world.body(boxes[i]).pose.p - before[i]).norm(), kShift) << count << ", box " << i;
      EXPECT_NEAR(lowest(world, boxes[i]), static_cast<double>(i) * kHeight, kPenetration) << count << ", box " << i;
    }
  }
}

// An island of more than a hundred contacts is solved in blocks.
TEST(WorldContact, APileOfBoxesComesToRest) {
  constexpr double kPenetration = 1e-3 * kPileSize, kShift = 1e-4;  // m
  Pile pile(kPileBoxes, -1, false, exactly());
  for (int i = 0; i < 120; ++i) pile.step_once();
  std::vector<Vec3> before;
  for (const BodyId id : pile.bodies) before.push_back(pile.world.body(id).pose.p);
  for (int i = 0; i < 30; ++i) pile.step_once();
  EXPECT_TRUE(pile.world.constraint_report().solved);
  EXPECT_GE(pile.contacts, 3 * kPileBoxes);
  EXPECT_GT(pile.deepest, -kPenetration);
  for (std::size_t i = 0; i < before.size(); ++i)
    EXPECT_LT((pile.world.body(pile.bodies[i]).pose.p - before[i]).norm(), kShift) << i;
}

/// Flexible boxes share loads between their contacts in many ways; each step finds one of them, and they come to rest.
TEST(WorldContact, StacksOfFlexibleBoxesThatAreDroppedStandAndEveryStepSettles) {
  constexpr double kHeight = 0.2, kApart = 0.02;                      // of a box; between boxes, m
  constexpr double kPenetration = 1e-3 * kSampleSize, kShift = 1e-4;  // m
  for (const int dropped : {0, 14}) {
    const auto model = sample_model({.modes = 6, .dropped = dropped, .lowest_hz = 60.0, .decay = 12.0});
    GroundedWorld scene(exactly());
    World& world = scene.world;
    std::vector<BodyId> boxes;
    for (int i = 0; i < 3; ++i) {
      const Vec3 place(0.02 * (i % 2), 0.015 * (i % 3), depth_below_origin(*model) + kApart + i * (kHeight + kApart));
      boxes.push_back(world.add_body(model, {.pose = {quaternion_from_rotation_vector({0.0, 0.0, 0.05 * i}), place}}));
    }
    int unsettled = 0;
    for (int i = 0; i < kStepsToRest; ++i) {
      world.step();
      unsettled += world.constraint_report().solved ? 0 : 1;
    }
    EXPECT_EQ(unsettled, 0) << dropped;
    std::vector<Vec3> before;
    for (const BodyId box : boxes) before.push_back(world.body(box).pose.p);
    scene.step(60);
    for (std::size_t i = 0; i < boxes.size(); ++i) {
      EXPECT_LT((world.body(boxes[i]).pose.p - before[i]).norm(), kShift) << dropped << ", box " << i;
      EXPECT_NEAR(lowest(world, boxes[i]), static_cast<double>(i) * kHeight, kPenetration) << dropped << ", box " << i;
    }
  }
}

/// Bars that fall across each other have no vertex within the other: the crossings of their rims carry them.
TEST(WorldContact, FlexibleBarsDroppedAcrossEachOtherLieStill) {
  constexpr double kLength = 0.6, kDepth = 1e-3 * kLength, kShift = 1e-4;
  const auto bar = sample_model({.modes = 6, .lowest_hz = 60.0, .decay = 12.0, .half_extent = {0.3, 0.06, 0.05}});
  const double low = depth_below_origin(*bar);
  for (const double roll : {0.1, 0.3, 0.5}) {
    GroundedWorld scene(exactly());
    const Quaternion across = quaternion_from_rotation_vector({0.0, 0.0, 1.2}),
                     tilted = quaternion_from_rotation_vector({roll, 0.1, 0.0});
    scene.world.add_body(bar, {.pose = {{}, {0.0, 0.0, low}}});
    const BodyId upper = scene.world.add_body(bar, {.pose = {across * tilted, {0.0, 0.0, 3.0 * low + 0.05}}});
    scene.step(90);
    double deepest = 0.0;
    scene.world.set_contact_veto([&](const ContactPoint& contact) {
      deepest = std::min(deepest, contact.gap);
      return true;
    });
    const Vec3 place = scene.world.body(upper).pose.p;
    scene.step(60);
    EXPECT_GT(deepest, -kDepth) << "rolled by " << roll;
    EXPECT_LT((scene.world.body(upper).pose.p - place).norm(), kShift) << "rolled by " << roll;
  }
}

/// Four corners can share a weight in many ways that no gap shows but by what each contact yields: all of a step has to
/// see that they do, or forces jump between them and the bar sinks. Without recovery nothing would push it out again.
TEST(WorldContact, ABarThatTopplesLiesStill) {
  constexpr double kPenetration = 1e-3;  // m, of a bar of 1 m
  GroundedWorld scene(exactly({.recovery_speed = 0.0}));
  ModalModelData bar = bar_data(20, false);
  for (double& decay : bar.decays) decay = 0.03 * std::sqrt(bar.eigenvalues[0]);
  for (double& lambda : bar.eigenvalues) lambda *= 1e4;
  const Quaternion upright = quaternion_from_rotation_vector({0.0, -0.5 * std::numbers::pi + 0.1, 0.0});
  const BodyId body =
      scene.world.add_body(std::make_shared<const ModalModel>(std::move(bar)), {.pose = {upright, {0, 0, 0.8}}});
  for (int i = 0; i < 300; ++i) {
    scene.step(1);
    EXPECT_TRUE(scene.world.constraint_report().solved) << "step " << i;
  }
  EXPECT_GT(lowest(scene.world, body), -kPenetration);
  EXPECT_LT(scene.world.body(body).velocity.norm(), 1e-6);
}

/// What the dropped modes yield to the contacts at rest is what they would yield if they were kept.
TEST(WorldContact, ABoxWithResidualComplianceRestsAsOneWithAllItsModes) {
  constexpr double kHz = 30.0, kFloat = 1e-5;  // of what the dropped modes yield, which is stored in single precision
  constexpr double kGap = 1e-9;                // m, to which contacts are solved
  const double decay = 0.05 * 2.0 * std::numbers::pi * kHz;
  const auto rest_height = [](const SampleOptions& sample) {
    GroundedWorld scene(exactly({.friction = 0.0}));
    ModalModelData data = sample_model_data(sample);
    const auto model = std::make_shared<const ModalModel>(std::move(data));
    const BodyId box = scene.world.add_body(model, {.pose = {{}, {0.0, 0.0, depth_below_origin(*model)}}});
    scene.step(300);
    return scene.world.body(box).pose.p.z();
  };
  const SampleOptions few{.modes = 6, .dropped = 14, .lowest_hz = kHz, .decay = decay};
  const double all = rest_height({.modes = 20, .lowest_hz = kHz, .decay = decay});
  const double without = rest_height({.modes = 6, .lowest_hz = kHz, .decay = decay});
  const double with = rest_height(few);
  EXPECT_GT(std::abs(without - all), 1e-6);
  EXPECT_NEAR(with, all, kFloat * std::abs(without - all) + kGap);
}

TEST(WorldContact, BoxesExactlyOnEachOtherStand) {
  constexpr double kShift = 1e-4;  // m
  GroundedWorld scene(exactly());
  World& world = scene.world;
  const auto model = damped_box(0, 60.0);
  std::vector<BodyId> boxes;
  for (int i = 0; i < 5; ++i)
    boxes.push_back(world.add_body(model, {.pose = {{}, {0.0, 0.0, depth_below_origin(*model) + 0.2 * i}}}));
  scene.step(300);
  for (int i = 0; i < 5; ++i) {
    const Vec3 place(0.0, 0.0, depth_below_origin(*model) + 0.2 * i);
    EXPECT_LT((world.body(boxes[static_cast<std::size_t>(i)]).pose.p - place).norm(), kShift) << i;
  }
}

}  // namespace
}  // namespace limber::testing
