// Moved frames: velocities are the derivatives of poses, and every key is reached at rest.
#include "running/frame_movement.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace limber {
namespace {

using internal::frame_at;
using internal::frame_over_step;
using internal::FrameState;

const RigidTransform kStart{normalized(Quaternion{1.0, 0.2, -0.1, 0.4}), {1.0, 2.0, 3.0}};
const RigidTransform kMiddle{normalized(Quaternion{-0.3, 1.0, 0.5, 0.0}), {0.0, 0.0, 1.0}};
const RigidTransform kEnd{normalized(Quaternion{0.1, 0.0, 1.0, -0.7}), {-2.0, 1.0, 0.0}};

FrameMovement keys() { return std::vector<PoseKey>{{.time = 0.5, .pose = kMiddle}, {.time = 2.0, .pose = kEnd}}; }
FrameMovement shake() {
  return Shake{.axis = Vec3(0.6, 0.0, 0.8), .amplitude = 0.1, .frequency = 3.0, .start = 0.25, .duration = 1.5};
}

double turn_between(const Quaternion& a, const Quaternion& b) {
  const Quaternion d = b * a.conjugate();
  return 2.0 * std::atan2(d.vector().norm(), std::abs(d.w));
}

/// Central differences at a distance where truncation (third derivatives of order 10³ s⁻³) and round-off balance.
constexpr double kApart = 1e-5, kDifferenceError = 1e-6;

void expect_velocity_is_the_derivative(const FrameMovement& movement, double t) {
  const FrameState before = frame_at(movement, kStart, t - kApart), after = frame_at(movement, kStart, t + kApart);
  const FrameState now = frame_at(movement, kStart, t);
  EXPECT_NEAR(((after.pose.p - before.pose.p) / (2 * kApart) - now.velocity).norm(), 0.0, kDifferenceError) << t;
  const Quaternion turn = after.pose.q * before.pose.q.conjugate();
  const Vec3 omega = turn.vector() * (std::copysign(2.0, turn.w) / (2 * kApart));  // sin(x/2) = x/2 at this size
  EXPECT_NEAR((omega - now.angular_velocity).norm(), 0.0, kDifferenceError) << t;
}

TEST(FrameMovement, VelocityIsTheDerivativeOfThePose) {
  for (const double t : {0.1, 0.4, 0.7, 1.3, 1.9, 2.5}) expect_velocity_is_the_derivative(keys(), t);
  for (const double t : {0.1, 0.3, 0.8, 1.7, 2.0}) expect_velocity_is_the_derivative(shake(), t);
}

TEST(FrameMovement, KeysAreReachedAtRest) {
  const auto at = [](double t) { return frame_at(keys(), kStart, t); };
  EXPECT_EQ(at(0.0).pose.p, kStart.p);
  EXPECT_NEAR((at(0.5).pose.p - kMiddle.p).norm(), 0.0, 1e-15);
  EXPECT_NEAR(turn_between(at(0.5).pose.q, kMiddle.q), 0.0, 1e-15);
  EXPECT_NEAR((at(9.0).pose.p - kEnd.p).norm(), 0.0, 1e-15);
  EXPECT_NEAR(turn_between(at(9.0).pose.q, kEnd.q), 0.0, 1e-15);
  for (const double t : {0.0, 0.5, 2.0, 9.0}) {
    EXPECT_NEAR(at(t).velocity.norm(), 0.0, 1e-15) << t;
    EXPECT_NEAR(at(t).angular_velocity.norm(), 0.0, 1e-15) << t;
  }
}

TEST(FrameMovement, AShakeIsASineWithinItsTimeAndNothingOutside) {
  for (const double t : {0.0, 0.25, 1.75, 3.0}) {
    EXPECT_EQ(frame_at(shake(), kStart, t).pose.p, kStart.p) << t;
    EXPECT_EQ(frame_at(shake(), kStart, t).velocity.norm(), 0.0) << t;
  }
  const Vec3 quarter = frame_at(shake(), kStart, 0.25 + 1.0 / 12.0).pose.p - kStart.p;
  EXPECT_NEAR((quarter - 0.1 * Vec3(0.6, 0.0, 0.8)).norm(), 0.0, 1e-15);
}

TEST(FrameMovement, AccelerationsCarryTheWholeChangeOfVelocityAlsoWhereItJumps) {
  const double h = 0.01;
  Vec3 velocity = Vec3::Zero();
  for (int n = 0; n < 100; ++n) {
    const KinematicFrame frame = frame_over_step(shake(), kStart, n * h, h);
    velocity += h * frame.acceleration;
    EXPECT_NEAR((velocity - frame.velocity).norm(), 0.0, 1e-12) << n;
  }
}

}  // namespace
}  // namespace limber
