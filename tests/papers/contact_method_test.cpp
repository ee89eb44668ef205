#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "constants.h"
#include "contact_scene.h"
#include "limber/hauser/hauser_method.h"

namespace limber::testing {
namespace {

GroundedIsland dropped_box(const ContactRule& rule, int modes) {
  const double hz = 30.0;
  const HauserMethod method(rule);
  GroundedIsland scene({.modes = modes, .lowest_hz = hz, .decay = 0.03 * 2.0 * std::numbers::pi * hz}, kFrame,
                       method.contacts());
  scene.solver = method.islands()();
  scene.add_body({quaternion_from_rotation_vector({0.3, 0.2, 0.1}), {0.0, 0.0, 0.5}});
  return scene;
}

/// The contact impulses of a second, after five seconds, by the weight of a second; and the speed that is left.
struct Carried {
  double weights = 0.0, speed = 0.0;
};
Carried carried(ContactMethod method) {
  GroundedIsland scene = dropped_box({.method = method}, 0);
  for (int i = 0; i < 300; ++i) scene.step();
  Vec3 impulse = Vec3::Zero();
  for (int i = 0; i < 60; ++i) scene.step(), impulse += scene.contact_impulse();
  return {impulse.z() / (scene.model->data().mass * kGravity * 60.0 * kFrame), scene.group.frame(0).velocity().norm()};
}

/// At rest the impulses are the weight. Those of the gap program are 3 % more, which the guard takes back after the
/// step: a regression guard.
TEST(ContactMethod, TheWeightIsCarriedInTheEndByTheGapProgramWithAFewPercentToSpare) {
  constexpr double kRest = 1e-6, kGapProgramGuard = 0.04, kGapProgramSpeed = 1e-3;
  for (const ContactMethod method :
       {ContactMethod::kPenalty, ContactMethod::kVelocityProgram, ContactMethod::kComplementary}) {
    const Carried end = carried(method);
    EXPECT_NEAR(end.weights, 1.0, kRest) << static_cast<int>(method);
    EXPECT_LT(end.speed, kRest) << static_cast<int>(method);
  }
  const Carried end = carried(ContactMethod::kGapProgram);
  EXPECT_NEAR(end.weights, 1.0, kGapProgramGuard);
  EXPECT_LT(end.speed, kGapProgramSpeed);
}

TEST(ContactMethod, PenaltySpringsSinkInByWhatTheWeightIs) {
  GroundedIsland scene = dropped_box({.method = ContactMethod::kPenalty, .penalty_frequency = 10.0}, 0);
  for (int i = 0; i < 400; ++i) scene.step();
  double depth = 0.0;
  for (Index v = 0; v < 8; ++v) depth += std::max(0.0, -scene.group.position(0, corner_point(*scene.model, v)).z());
  const double omega = 2.0 * std::numbers::pi * 10.0;
  EXPECT_NEAR(depth, kGravity / (omega * omega), 1e-6);  // Σ k d = m g, k = m ω²
}

/// By the lowest gap over four seconds.
double deepest(ContactMethod method) {
  GroundedIsland scene = dropped_box({.method = method}, 12);
  double lowest = 0.0;
  for (int i = 0; i < 240; ++i) {
    scene.step();
    lowest = std::min(lowest, scene.lowest_gap());
  }
  return -lowest;
}

TEST(ContactMethod, TheComplementaryOneDoesNotSinkInTheGapProgramDoesALittle) {
  EXPECT_LT(deepest(ContactMethod::kComplementary), 1e-3 * kSampleSize);
  EXPECT_LT(deepest(ContactMethod::kGapProgram), 2e-2 * kSampleSize);
}

/// Energy of tumbling boxes, by the largest rise in a step.
double largest_rise(const HauserMethod& method) {
  double worst = 0.0;
  for (const int modes : {0, 12})
    for (const double spin : {-3.0, 2.0, 5.0}) {
      GroundedIsland scene({.modes = modes, .lowest_hz = 30.0}, kFrame, method.contacts({.recovery_speed = 0.0}));
      scene.solver = method.islands()();
      scene.add_body({quaternion_from_rotation_vector({0.4, 0.5, 0.0}), {0.0, 0.0, 0.45}}, {1.0, 0.0, -2.0},
                     {1.0, spin, -1.0});
      const double scale = scene.energy_scale();
      double before = scene.energy();
      for (int i = 0; i < 60; ++i) {
        scene.step();
        worst = std::max(worst, (scene.energy() - before) / scale);
        before = scene.energy();
      }
    }
  return worst;
}

TEST(ContactMethod, GuardedProgramsAddNoEnergy) {
  for (const ContactMethod method : {ContactMethod::kVelocityProgram, ContactMethod::kGapProgram})
    for (const ProgramGuard guard : {ProgramGuard::kClamp, ProgramGuard::kComplementary}) {
      const HauserMethod programs({.method = method, .guard = guard});
      EXPECT_LT(largest_rise(programs), 1e-6) << static_cast<int>(method);
      EXPECT_GT(programs.programs().guard.solves, 50);
    }
}

constexpr double kFriction = 0.5;

/// A block laid upon a slope, after a second.
struct Slide {
  Vec3 way, velocity;
};
Slide slide(const FrictionModel model, double angle) {
  const Vec3 normal(-std::sin(angle), 0.0, std::cos(angle));
  const HauserMethod method({.friction = model});
  GroundedIsland scene({.modes = 0}, kFrame, method.contacts({.friction = kFriction}), normal);
  scene.solver = method.islands()();
  const Quaternion turn = quaternion_from_rotation_vector({0.0, -angle, 0.0});
  double below = 0.0;
  for (Index v = 0; v < 8; ++v)
    below = std::max(below, -scene.model->collision().rest[static_cast<std::size_t>(v)].cast<double>().z());
  scene.add_body({turn, below * normal});
  for (int i = 0; i < 60; ++i) scene.step();
  const Vec3 before = scene.group.frame(0).pose().p;
  for (int i = 0; i < 60; ++i) scene.step();
  return {scene.group.frame(0).pose().p - before, scene.group.frame(0).velocity()};
}

/// Under the heuristic what should stick creeps, by less than a twentieth of its size a second, and what slides brakes
/// too little. How much is no theory's, so the bounds are regression guards above what is measured (2.3 cm a second,
/// and 11 % of the speed); the cone is there for more.
TEST(ContactMethod, UnderHeuristicFrictionCreepAndTooLittleBrakingStayWithinGuards) {
  constexpr double kCreepGuard = 0.05 * kSampleSize, kSpeedGuard = 1.0 / 7.0;
  const double angle = 1.4 * std::atan(kFriction);
  const double expected = 2.0 * kGravity * (std::sin(angle) - kFriction * std::cos(angle));  // after two seconds
  for (const FrictionModel model : {FrictionModel::kHeuristic, FrictionModel::kHeuristicNoSlip}) {
    EXPECT_LT(slide(model, 0.9 * std::atan(kFriction)).way.norm(), kCreepGuard);
    EXPECT_NEAR(slide(model, angle).velocity.norm(), expected, kSpeedGuard * expected);
  }
}

/// Under the cone it is Coulomb's law: at rest below the angle; beyond it its acceleration.
TEST(ContactMethod, UnderTheConeABlockSticksAndSlidesByCoulombsLaw) {
  const double angle = 1.4 * std::atan(kFriction);
  const double acceleration = kGravity * (std::sin(angle) - kFriction * std::cos(angle));
  EXPECT_LT(slide(FrictionModel::kCone, 0.9 * std::atan(kFriction)).way.norm(), 1e-6 * kSampleSize);
  const Slide slid = slide(FrictionModel::kCone, angle);
  // Friction begins with the second step (docs/contact.md): a step's worth of it is missing.
  EXPECT_NEAR(slid.velocity.norm(), 2.0 * acceleration, kFriction * kGravity * kFrame);
}

}  // namespace
}  // namespace limber::testing
