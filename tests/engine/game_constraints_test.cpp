// Handles, joints, led bodies and what the world keeps, by small steps (ContactSolver::kGame).
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "counted_new.h"
#include "pile.h"
#include "thread_jobs.h"

namespace limber::testing {
namespace {

const ContactOptions kGame{.solver = ContactSolver::kGame};

JointSpec hinge_at(const Vec3& origin, JointType type = JointType::kRevolute) {
  JointSpec spec;
  spec.type = type;
  spec.frame.origin = origin;
  return spec;
}

/// A link on a hinge of the world about y, let go level.
struct Pendulum : GroundedWorld {
  explicit Pendulum(int substeps) : GroundedWorld({.solver = ContactSolver::kGame, .small_steps = {substeps}}) {
    const auto model = sample_model({.modes = 0});
    link = world.add_body(model, {.pose = {{}, {0.3, 0.0, 3.0}}});
    joint = world.add_joint(BodyId{}, link, hinge_about_y({0.0, 0.0, 3.0}));
    scale = model->data().mass * kGravity * 0.3;
  }
  static JointSpec hinge_about_y(const Vec3& origin) {
    JointSpec spec = hinge_at(origin);
    spec.frame.axes << Vec3::UnitY(), -Vec3::UnitX(), Vec3::UnitZ();
    return spec;
  }
  /// What its energy is off by at most in two seconds, in units of `scale`.
  double energy_error() {
    const double energy = world.energy(link).total();
    double worst = 0.0;
    for (int i = 0; i < 120; ++i) {
      step(1);
      worst = std::max(worst, std::abs(world.energy(link).total() - energy) / scale);
      const JointView view = world.joint(joint);
      EXPECT_LT(view.distance_error + view.angle_error, 1e-3);
    }
    return worst;
  }
  BodyId link;
  JointId joint;
  double scale = 0.0;
};

TEST(GameConstraints, APendulumKeepsItsJointAndItsEnergyToFirstOrderInTheSubstep) {
  const double coarse = Pendulum(8).energy_error(), fine = Pendulum(16).energy_error();
  EXPECT_LT(coarse, 0.05);
  EXPECT_LT(fine, 0.6 * coarse);
}

TEST(GameConstraints, AllJointsHoldTheirLockedFreedoms) {
  for (const JointType type : {JointType::kFixed, JointType::kRevolute, JointType::kPrismatic, JointType::kCylindrical,
                               JointType::kBall, JointType::kPlanar}) {
    GroundedWorld scene(kGame, {.gravity = Vec3::Zero()});
    const auto model = sample_model({.modes = 4, .lowest_hz = 40.0, .decay = 5.0});
    const BodyId a = scene.world.add_body(model, {.pose = {{}, {0.0, 0.0, 3.0}}, .angular_velocity = {0.4, 0.3, 0.2}});
    const BodyId b = scene.world.add_body(model, {.pose = {{}, {0.7, 0.0, 3.0}}, .velocity = {0.0, 0.3, 0.1}});
    const JointId joint = scene.world.add_joint(a, b, hinge_at({0.35, 0.0, 3.0}, type));
    const Vec3 momentum = scene.world.linear_momentum(a) + scene.world.linear_momentum(b);
    constexpr int kSteps = 60;
    scene.step(kSteps);
    const JointView view = scene.world.joint(joint);
    // Coordinates are in single precision: each substep rounds them once.
    constexpr double kRounded = kSteps * SmallSteps{}.substeps * 0x1p-24;
    EXPECT_LT(view.distance_error, 2e-3) << to_string(type);
    EXPECT_LT(view.angle_error, 2e-3) << to_string(type);
    EXPECT_LT((scene.world.linear_momentum(a) + scene.world.linear_momentum(b) - momentum).norm(),
              kRounded * momentum.norm())
        << to_string(type);
  }
}

TEST(GameConstraints, LimitsStopMotorsDriveAndFrictionHolds) {
  GroundedWorld scene(kGame);
  const auto model = sample_model({.modes = 0});
  const auto hinged = [&](double y, double low) {
    const BodyId link = scene.world.add_body(model, {.pose = {{}, {0.3, y, 3.0}}});
    JointSpec spec = Pendulum::hinge_about_y({0.0, y, 3.0});
    if (low < 0.0) spec.limits.rotation = {.low = low, .high = -low};
    return scene.world.add_joint(BodyId{}, link, spec);
  };
  const JointId limited = hinged(0.0, -0.5), driven = hinged(1.0, 0.0), motor = hinged(2.0, 0.0),
                rubs = hinged(3.0, 0.0);
  scene.world.set_joint_actuation(driven, 0, {.drive_target = -0.3, .drive_stiffness = 1e4, .drive_damping = 200.0});
  scene.world.set_joint_actuation(motor, 0, {.motor_velocity = -2.0, .motor_max_force = 1e3});
  scene.world.set_joint_actuation(rubs, 0, {.friction = 100.0});
  scene.step(120);
  EXPECT_NEAR(std::abs(scene.world.joint(limited).position[0]), 0.5, 0.02);
  EXPECT_NEAR(scene.world.joint(driven).position[0], -0.3, 0.01);
  EXPECT_NEAR(scene.world.joint(motor).position[0], -4.0, 0.02);
  EXPECT_NEAR(scene.world.joint(rubs).position[0], 0.0, 1e-3);
}

TEST(GameConstraints, AHandleTakesItsPointWhereItIsWanted) {
  for (const int modes : {0, 8}) {
    GroundedWorld scene(kGame);
    const auto model = sample_model({.modes = modes, .lowest_hz = 20.0, .decay = 10.0});
    const BodyId body = scene.world.add_body(model, {.pose = {{}, {0.0, 0.0, 2.0}}});
    const HandleId hand = scene.world.add_handle(body, kMarked);
    const Vec3 start = scene.world.position(body, kMarked);
    for (int i = 1; i <= 60; ++i) {
      scene.world.set_handle_target(hand, {.position = start + Vec3(0.01 * i, 0.0, 0.005 * i)});
      scene.step(1);
      EXPECT_LT(scene.world.handle(hand).error, 2e-3) << modes;
    }
  }
}

TEST(GameConstraints, ASoftHandleHoldsTheWeightByItsSpring) {
  GroundedWorld scene(kGame);
  const auto model = sample_model({.modes = 0});
  // The point straight above the mass centre.
  const Vec3 up = deformed_point(*model, kMarked, {}).normalized();
  const Quaternion q = quaternion_from_rotation_vector(std::acos(up.z()) * up.cross(Vec3::UnitZ()).normalized());
  const BodyId body = scene.world.add_body(model, {.pose = {q, {0.0, 0.0, 2.0}}});
  const double weight = model->data().mass * kGravity;
  const HandleId hand = scene.world.add_handle(body, kMarked, {.stiffness = 2000.0, .damping = 60.0});
  scene.step(600);
  EXPECT_NEAR(scene.world.handle(hand).force.z(), weight, 0.01 * weight);
  EXPECT_NEAR(scene.world.handle(hand).error, weight / 2000.0, 0.01 * weight / 2000.0);
}

TEST(GameConstraints, AHandleOfLimitedForceDragsABoxOverTheGround) {
  GroundedWorld scene(kGame);
  const auto model = sample_model({.modes = 6, .lowest_hz = 60.0, .decay = 12.0});
  const BodyId box = scene.world.add_body(model, {.pose = {{}, {0.0, 0.0, depth_below_origin(*model)}}});
  const double weight = model->data().mass * kGravity;
  const HandleId hand =
      scene.world.add_handle(box, kMarked, {.directions = {Vec3::UnitX()}, .max_force = 0.8 * weight});
  const Vec3 start = scene.world.position(box, kMarked);
  for (int i = 1; i <= 120; ++i) {
    scene.world.set_handle_target(hand, {.position = start + Vec3(0.01 * i, 0.0, 0.0)});
    scene.step(1);
    for (const ContactEvent& event : scene.world.contact_events())
      EXPECT_GE(event.impulse.dot(event.normal), 0.0) << "no contact pulls";
    EXPECT_LE(std::abs(scene.world.handle(hand).force.x()), 0.8 * weight * 1.0001);
  }
  EXPECT_NEAR(scene.world.position(box, kMarked).x() - start.x(), 1.2, 0.05);
}

/// A hand of limited force whirls a box about: all energy that the box has is the work that the hand tells.
TEST(GameConstraints, AHandTellsTheEnergyThatItGives) {
  GroundedWorld scene(kGame, {.gravity = Vec3::Zero()});
  const BodyId box = scene.world.add_body(sample_model({.modes = 6, .decay = 0.0}), {.pose = {{}, {0.0, 0.0, 3.0}}});
  const SurfacePoint corner{.triangle = 0, .weight = {1.0, 0.0, 0.0}};
  const HandleId hand = scene.world.add_handle(box, corner, {.max_force = 500.0});
  const Vec3 start = scene.world.position(box, corner);
  double most = 0.0;
  for (int i = 0; i < 60; ++i) {
    const double angle = 0.3 * i, before = scene.world.energy(box).total();
    scene.world.set_handle_target(hand, {.position = start + 0.2 * Vec3(std::cos(angle) - 1.0, std::sin(angle), 0.0)});
    scene.step(1);
    const double after = scene.world.energy(box).total();
    most = std::max(most, after);
    ASSERT_NEAR(after - before, scene.world.handle(hand).work, 1e-3 * most) << i;
  }
  EXPECT_GT(most, 1.0);
}

TEST(GameConstraints, ABodyRidesOnALedOne) {
  for (const FrameMotion motion : {FrameMotion::kKinematic}) {
    GroundedWorld scene(kGame);
    const auto table = sample_model({.motion = motion, .modes = 4, .lowest_hz = 30.0, .decay = 20.0});
    const BodyId led = scene.world.add_body(table, {.pose = {{}, {0.0, 0.0, 2.0}}});
    const auto model = sample_model({.modes = 0, .half_extent = {0.1, 0.1, 0.1}});
    const BodyId rider = scene.world.add_body(model, {.pose = {{}, {0.0, 0.0, 2.2}}});
    for (int i = 1; i <= 120; ++i) {
      const double t = i / 60.0;
      scene.world.set_kinematic_frame(led, {.pose = {{}, {0.5 * t, 0.0, 2.0 + 0.3 * t}}, .velocity = {0.5, 0.0, 0.3}});
      scene.step(1);
    }
    EXPECT_NEAR(scene.world.body(rider).velocity.x(), 0.5, 0.02);
    EXPECT_NEAR(scene.world.body(rider).velocity.z(), 0.3, 0.02);
    EXPECT_NEAR(scene.world.body(rider).pose.p.z() - scene.world.body(led).pose.p.z(), 0.2, 0.01);
  }
}

TEST(GameConstraints, ABodyThatHangsLeansOnTheGround) {
  for (const FrameMotion motion : {FrameMotion::kPoint, FrameMotion::kLine}) {
    GroundedWorld scene(kGame);
    const auto model = sample_model({.motion = motion, .modes = 4, .lowest_hz = 30.0, .decay = 20.0});
    // Its pivot is 0.5 m above it, nearer to the ground than that: it lies there, swung aside.
    const BodyId body =
        scene.world.add_body(model, {.pose = {quaternion_from_rotation_vector({1.2, 0.0, 0.0}), {0.0, 0.0, 0.45}}});
    scene.step(600);
    EXPECT_GT(lowest(scene.world, body), -0.01);
    EXPECT_LT(scene.world.body(body).angular_velocity.norm(), 0.05);
    EXPECT_FALSE(scene.world.contact_events().empty());
  }
}

// What the world keeps -----------------------------------------------------------------------------------------------

TEST(GameState, ARestoredWorldGoesOnToTheBitForAnyJobs) {
  Pile pile(18, 6, true, {.solver = ContactSolver::kGame, .rolling_friction = 0.1}),
      other(18, 6, true, {.solver = ContactSolver::kGame, .rolling_friction = 0.1});
  pile.step(60), other.step(60);
  EXPECT_EQ(pile.world.state_hash(), other.world.state_hash());
  std::vector<std::byte> state;
  pile.world.save_state(state);
  pile.step(30);
  const std::uint64_t hash = pile.world.state_hash();
  pile.world.restore_state(state);
  pile.step(30);
  EXPECT_EQ(pile.world.state_hash(), hash);
}

TEST(GameState, AWarmStepAllocatesNothing) {
  Pile pile(18, 6, false, kGame);
  const HandleId hand = pile.world.add_handle(pile.bodies[9], kMarked);
  pile.world.add_joint(pile.bodies[0], pile.bodies[1],
                       hinge_at(pile.world.body(pile.bodies[0]).pose.p, JointType::kBall));
  pile.world.set_handle_target(hand, {.position = {0.0, 0.0, 1.0}});
  pile.step(600);  // all that touch each other have met by then
  const long before = allocations();
  for (int i = 0; i < 60; ++i) pile.world.step();
  EXPECT_EQ(allocations() - before, 0);
}

TEST(GameState, WhatRestsFallsAsleepAndWakesWhenItIsHit) {
  GroundedWorld scene(kGame, {.sleep = {.enabled = true}});
  const auto model = damped_box(0, 60.0);
  std::vector<BodyId> boxes;
  for (int i = 0; i < 3; ++i)
    boxes.push_back(scene.world.add_body(model, {.pose = {{}, {0.02 * i, 0.0, depth_below_origin(*model) + 0.2 * i}}}));
  scene.step(240);
  for (const BodyId box : boxes) EXPECT_TRUE(scene.world.is_asleep(box));
  const RigidTransform place = scene.world.body(boxes[0]).pose;
  scene.step(60);
  EXPECT_EQ(scene.world.body(boxes[0]).pose.p, place.p);
  scene.world.add_body(model, {.pose = {{}, {0.1, 0.0, 1.0}}});
  scene.step(40);
  for (const BodyId box : boxes) EXPECT_FALSE(scene.world.is_asleep(box));
}

TEST(GameState, EventsTellTheWeightAndAVetoLetsThrough) {
  GroundedWorld scene(kGame);
  const auto model = sample_model({.modes = 0});
  const BodyId box = scene.world.add_body(model, {.pose = {{}, {0.0, 0.0, depth_below_origin(*model)}}});
  scene.step(60);
  Vec3 sum = Vec3::Zero();
  for (const ContactEvent& event : scene.world.contact_events()) {
    EXPECT_EQ(event.phase, ContactPhase::kLasting);
    sum += event.impulse;
  }
  EXPECT_NEAR(sum.norm(), model->data().mass * kGravity / 60.0, 1e-3 * model->data().mass * kGravity / 60.0);
  scene.world.set_contact_veto([](const ContactPoint&) { return false; });
  scene.step(30);
  EXPECT_LT(scene.world.body(box).pose.p.z(), -0.5);
  EXPECT_TRUE(scene.world.contact_events().empty());
}

}  // namespace
}  // namespace limber::testing
