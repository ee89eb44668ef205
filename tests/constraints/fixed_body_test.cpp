// Joints and handles of bodies with fixed nodes, whose parents stand or move.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "islands.h"

namespace limber {
namespace {

using testing::Island;
using testing::kMarked;
using testing::kSecond;

/// A turntable that swings from side to side: origin, turn and their derivatives at a time.
KinematicFrame turntable(double t, double held_at) {
  constexpr double kTurn = 2.0, kSway = 5.0, kWide = 0.1;  // rad/s, rad/s, m
  const auto vector = [](double x) { return Vec3(x, 0.5 * x, -0.3 * x); };
  return {.pose = {quaternion_from_rotation_vector({0.0, 0.0, kTurn * t}), vector(kWide * std::sin(kSway * t))},
          .velocity = vector(kWide * kSway * std::cos(kSway * t)),
          .acceleration = vector(-kWide * kSway * kSway * std::sin(kSway * held_at)),
          .angular_velocity = {0.0, 0.0, kTurn}};
}

/// Where a point of a body on the turntable is after 0.4 s.
/// @param in_an_island by the solver of islands, under a handle too weak to be felt
Vec3 carried_point(FrameMotion motion, int steps, bool in_an_island) {
  constexpr double kTime = 0.4;
  const double h = kTime / steps;
  Island island({.motion = motion, .modes = 4, .lowest_hz = 2.0}, h);
  const KinematicFrame start = turntable(0.0, 0.0);
  const bool turns = motion == FrameMotion::kPoint || motion == FrameMotion::kLine;
  const Vec3 own = motion == FrameMotion::kPoint ? Vec3(1.0, 2.0, 0.5) : Vec3(1.5, 0.0, 0.0);
  const Index body =
      island.add_body(start.pose, start.velocity, turns ? Vec3(start.angular_velocity + own) : start.angular_velocity);
  // A new body on a line does not know how its parent turns: it is told in a step of no length.
  island.group.set_step_length(1e-9);
  island.group.set_parent(body, start);
  island.group.advance(0, 1, Vec3::Zero());
  island.group.set_step_length(h);
  island.hold(body, kMarked, {.stiffness = 1e-13});
  for (int i = 0; i < steps; ++i) {
    island.group.set_parent(body, turntable((i + 1) * h, (i + 0.5) * h));
    if (in_an_island)
      EXPECT_EQ(island.step().status, IslandStatus::kSolved);
    else
      island.group.advance(0, 1, {0.0, 0.0, -testing::kGravity});
  }
  return island.group.position(body, kSecond);
}

// Two routes that share the model alone: kicks and closed rotations in short steps, and impulses in the middle of
// steps.
TEST(FixedBodies, FollowTheirParentsToSecondOrder) {
  for (const FrameMotion motion : {FrameMotion::kPoint, FrameMotion::kLine, FrameMotion::kKinematic}) {
    SCOPED_TRACE(to_string(motion));
    const Vec3 exact = carried_point(motion, 1 << 14, false);
    const double coarse = (carried_point(motion, 40, true) - exact).norm(),
                 fine = (carried_point(motion, 80, true) - exact).norm();
    EXPECT_LT(coarse, 2e-3);
    EXPECT_GT(coarse, 3.0 * fine);
  }
}

/// The largest rise of the energy in a step, over its scale. @param hz of the lowest of four modes, up to 3.1 times it
double largest_rise(FrameMotion motion, double hz, double step, bool guard) {
  Island island({.motion = motion, .modes = 4, .lowest_hz = hz}, step);
  island.guard_energy = guard;
  const Index body =
      island.add_body({}, Vec3::Zero(), motion == FrameMotion::kKinematic ? Vec3(0.0, 0.0, 0.0) : Vec3(2.0, 1.0, 0.5));
  Handle& held = island.hold(body, kMarked, {.directions = {Vec3::UnitY()}});
  island.group.apply_impulse(body, kSecond, {0.2, 0.1, 0.5}, 0.0);
  const double scale = island.energy_scale();
  double before = kUnbounded, rise = -kUnbounded;  // the first step brings the blow to rest at the held point
  for (int i = 0; i < 60; ++i) {
    EXPECT_EQ(island.step().status, IslandStatus::kSolved);
    EXPECT_LT(held.error(island.states()), 1e-10);
    rise = std::max(rise, (island.energy() - before) / scale);
    before = island.energy();
  }
  return rise;
}

TEST(FixedBodies, HoldTheirTargetsAndNeverGainEnergy) {
  for (const FrameMotion motion : {FrameMotion::kPoint, FrameMotion::kLine, FrameMotion::kKinematic})
    for (const double step : {1e-3, 1.0 / 60.0, 0.1}) {
      SCOPED_TRACE(std::string(to_string(motion)) + ", " + std::to_string(step));
      for (const double part : {0.05, 0.3}) EXPECT_LT(largest_rise(motion, 0.5 * part / step, step, false), 1e-10);
      // Modes above the step's Nyquist rate ring on under what holds them, and the rows do work on that: the guard's.
      EXPECT_LT(largest_rise(motion, 5.0 / step, step, true), 1e-10);
    }
}

// A door whose handle is pulled against its hinge: the hand does the work, and the frame takes the rest.
TEST(FixedBodies, SwingAboutTheirLinesAlone) {
  Island island({.motion = FrameMotion::kLine, .modes = 2, .lowest_hz = 5.0}, 1.0 / 60.0, Vec3::Zero());
  const Index body = island.add_body({});
  Handle& hand = island.hold(body, kMarked, {.stiffness = 50.0});
  hand.set_target({.position = island.group.position(body, kMarked) + Vec3(0.4, 0.2, 0.3)});
  double turned = 0.0;
  for (int i = 0; i < 60; ++i) {
    EXPECT_EQ(island.step().status, IslandStatus::kSolved);
    const RigidTransform& pose = island.group.frame(body).pose();
    EXPECT_EQ(pose.p, Vec3::Zero());
    EXPECT_LT(pose.q.vector().tail<2>().norm(), 1e-15);
    turned = std::max(turned, std::abs(pose.q.x));
  }
  EXPECT_GT(turned, 0.05);
}

}  // namespace
}  // namespace limber
