#include "limber/dynamics/exact_motion.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "asked.h"
#include "constants.h"
#include "counted_new.h"
#include "limber/core/error.h"
#include "limber/dynamics/body_group.h"
#include "sample_models.h"

namespace limber {
namespace {

using testing::kAllMotions;
using testing::kDown;
using testing::kEpsilon;
using testing::kMarked;
using testing::sample_model;
using testing::SampleOptions;

/// Two orders of evaluation of the same closed forms.
constexpr double kRoundOff = 1e-13;
/// What a bound may fall short of a sample by: the samples' own round-off.
constexpr double kSampleError = 1e-12;
const RigidTransform kPlace{quaternion_from_rotation_vector({0.7, -0.4, 1.1}), {1.0, -2.0, 3.0}};

/// A body that turns, flies, flexes and carries loads.
struct Loaded {
  Loaded(FrameMotion motion, double step, double lowest_hz = 3.0)
      : group(sample_model({.motion = motion, .modes = 6, .lowest_hz = lowest_hz, .decay = 0.4}), step) {
    slot = group.add(kPlace, {0.3, 2.0, -1.0}, {3.0, -5.0, 2.0});
    const std::vector<double> z{0.02, -0.01, 0.005, 0.0, 0.003, 0.0}, rates{0.1, 0.3, -0.2, 0.5, 0.0, 0.0};
    group.set_amplitudes(slot, z, rates);
  }
  void load() {
    group.apply_force(slot, kMarked, {2.0, -1.0, 3.0});
    group.apply_impulse(slot, kMarked, {0.05, 0.02, -0.03}, 0.4 * group.step_length());
    group.apply_impulse(slot, kMarked, {-0.02, 0.02, 0.01}, 0.7 * group.step_length());
  }
  ExactMotion predict() const {
    ExactMotion motion;
    group.predict_motion(slot, kDown, motion);
    return motion;
  }
  BodyGroup group;
  Index slot = 0;
};

KinematicFrame moved_parent(double h) {
  return {.pose = {quaternion_from_rotation_vector({0.1, 0.3, -0.2}) * kPlace.q, kPlace.p + Vec3(0.02, 0.01, 0.05)},
          .velocity = Vec3(0.03, 0.0, 0.1) / h,
          .acceleration = {1.0, -3.0, 2.0},
          .angular_velocity = Vec3(0.1, 0.3, -0.2) / h,
          .angular_acceleration = {0.5, 2.0, -1.0}};
}

void expect_committed(const Loaded& body, const MotionState& end) {
  const RigidFrame& frame = body.group.frame(body.slot);
  EXPECT_EQ(end.pose.p, frame.pose().p);
  EXPECT_EQ(end.pose.q.w, frame.pose().q.w);
  EXPECT_EQ(end.pose.q.vector(), frame.pose().q.vector());
  EXPECT_EQ(end.velocity, frame.velocity());
  EXPECT_LT((end.angular_velocity - frame.angular_velocity(body.group.frame_constants())).norm(), 10.0 * kRoundOff);
  for (std::size_t i = 0; i < end.amplitudes.size(); ++i) {
    EXPECT_NEAR(end.amplitudes[i], body.group.amplitudes(body.slot)[i], kRoundOff);
    EXPECT_NEAR(end.rates[i], body.group.rates(body.slot)[i], 10.0 * kRoundOff);
  }
}

TEST(ExactMotion, AtTheStepsEndItIsWhatAdvanceCommits) {
  for (const FrameMotion kind : kAllMotions)
    for (const double h : {1.0 / 240.0, 1.0 / 60.0, 0.5}) {
      Loaded body(kind, h);
      for (int step = 0; step < 6; ++step) {
        if (step % 2 == 1) body.load();
        if (step >= 4) body.group.set_parent(body.slot, moved_parent(h));
        const ExactMotion motion = body.predict();
        MotionState end;
        motion.evaluate(h, end);
        body.group.advance(0, 1, kDown);
        expect_committed(body, end);
      }
    }
}

// Modes above the Nyquist rate answer a constraint statically for one step.
TEST(ExactMotion, WhatAnsweredConstraintsStaticallyLetsGoAndCountsInTheReach) {
  const double h = 1.0 / 60.0;
  Loaded body(FrameMotion::kPoint, h, 40.0);
  const std::vector<double> modal{1.0, -2.0, 3.0, 1.0, -1.0, 2.0};
  body.group.predict(body.slot, kDown, {.modal = modal});
  body.group.commit(body.slot);
  ASSERT_NE(body.group.static_amplitudes(body.slot)[2], 0.0);
  const std::vector<double> before(body.group.amplitudes(body.slot).begin(), body.group.amplitudes(body.slot).end());
  const ExactMotion motion = body.predict();
  MotionState start, end;
  motion.evaluate(0.0, start);
  motion.evaluate(h, end);
  double released = 0.0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    EXPECT_DOUBLE_EQ(start.amplitudes[i], before[i] - body.group.static_amplitudes(body.slot)[i]);
    released += std::abs(before[i] - start.amplitudes[i]);
  }
  const std::vector<double> ones(6, 1.0);
  EXPECT_GE(motion.reach(0.0, ones), released);
  body.group.advance(0, 1, kDown);
  expect_committed(body, end);
}

TEST(ExactMotion, AtTheStartItIsTheBodyAsItStands) {
  for (const FrameMotion kind : kAllMotions) {
    Loaded body(kind, 0.02);
    MotionState start;
    body.predict().evaluate(0.0, start);
    EXPECT_EQ(start.pose.p, kPlace.p);
    EXPECT_LT((start.pose.q * Vec3(1.0, 2.0, 3.0) - kPlace.q * Vec3(1.0, 2.0, 3.0)).norm(), 64.0 * kEpsilon);
    EXPECT_TRUE(std::ranges::equal(start.amplitudes, body.group.amplitudes(body.slot)));
    EXPECT_TRUE(std::ranges::equal(start.rates, body.group.rates(body.slot)));
  }
}

// A free body's flow does not know how long the step is, so a shorter step is a second route to any time within.
TEST(ExactMotion, WithinTheStepAFreeBodyIsWhereAShorterStepTakesIt) {
  const double h = 0.1;
  Loaded body(FrameMotion::kFree, h);
  const SurfacePoint struck = kMarked;
  body.group.apply_impulse(body.slot, struck, {0.05, 0.02, -0.03}, 0.3 * h);
  const ExactMotion motion = body.predict();
  for (const double part : {0.1, 0.29, 0.31, 0.77}) {
    Loaded shorter(FrameMotion::kFree, part * h);
    if (part > 0.3) {
      shorter.group.apply_impulse(shorter.slot, struck, {0.05, 0.02, -0.03}, 0.3 * h);
    } else {  // its frame feels the impulse at once, its modes not yet
      const Vec3 at = shorter.group.position(shorter.slot, struck) - kPlace.p, j(0.05, 0.02, -0.03);
      RigidFrame frame = shorter.group.frame(shorter.slot);
      frame.apply_impulse(shorter.group.frame_constants(), j, at.cross(j));
      shorter.group.set_velocity(shorter.slot, frame.velocity(),
                                 frame.angular_velocity(shorter.group.frame_constants()));
    }
    shorter.group.advance(0, 1, kDown);
    MotionState state;
    motion.evaluate(part * h, state);
    const RigidFrame& frame = shorter.group.frame(shorter.slot);
    EXPECT_LT((state.pose.p - frame.pose().p).norm(), kRoundOff);
    EXPECT_LT((state.pose.q * Vec3::Ones() - frame.pose().q * Vec3::Ones()).norm(), 10.0 * kRoundOff);
    EXPECT_LT((state.angular_velocity - frame.angular_velocity(shorter.group.frame_constants())).norm(), 1e-12);
    for (std::size_t i = 0; i < state.amplitudes.size(); ++i) {
      EXPECT_NEAR(state.amplitudes[i], shorter.group.amplitudes(shorter.slot)[i], kRoundOff);
      EXPECT_NEAR(state.rates[i], shorter.group.rates(shorter.slot)[i], 10.0 * kRoundOff);
    }
  }
}

TEST(ExactMotion, RatesAreTheDerivativesOfThePositions) {
  const double dt = 1e-6;
  for (const FrameMotion kind : kAllMotions) {
    Loaded body(kind, 0.05);
    body.load();
    const ExactMotion motion = body.predict();
    for (const double t : {0.003, 0.017, 0.0301, 0.048}) {
      MotionState before, after, now;
      motion.evaluate(t - dt, before);
      motion.evaluate(t + dt, after);
      motion.evaluate(t, now);
      // Central differences: dt² times third derivatives, and round-off over dt.
      EXPECT_LT(((after.pose.p - before.pose.p) / (2.0 * dt) - now.velocity).norm(), 1e-8);
      EXPECT_LT((rotation_vector(after.pose.q * before.pose.q.conjugate()) / (2.0 * dt) - now.angular_velocity).norm(),
                1e-8);
      for (std::size_t i = 0; i < now.rates.size(); ++i)
        EXPECT_NEAR((after.amplitudes[i] - before.amplitudes[i]) / (2.0 * dt), now.rates[i], 1e-7);
    }
  }
}

TEST(ExactMotion, AParentThatAcceleratesSteadilyIsFollowedExactly) {
  const double h = 0.1;
  const Vec3 v(1.0, 2.0, 0.5), a(3.0, -4.0, 1.0), turn(0.0, 0.0, 0.6);
  BodyGroup group(sample_model({.motion = FrameMotion::kKinematic, .modes = 2}), h);
  const Index slot = group.add(kPlace, v, Vec3::Zero());
  group.set_parent(slot,
                   {.pose = {quaternion_from_rotation_vector(turn) * kPlace.q, kPlace.p + h * v + 0.5 * h * h * a},
                    .velocity = v + h * a,
                    .acceleration = a,
                    .angular_velocity = turn / h});
  ExactMotion motion;
  group.predict_motion(slot, kDown, motion);
  MotionState s;
  motion.evaluate(0.03, s);
  EXPECT_LT((s.pose.p - (kPlace.p + 0.03 * v + 0.5 * 0.03 * 0.03 * a)).norm(), 64.0 * kEpsilon);
  EXPECT_LT(
      (s.pose.q * Vec3::UnitX() - quaternion_from_rotation_vector(0.3 * turn) * (kPlace.q * Vec3::UnitX())).norm(),
      64.0 * kEpsilon);
  EXPECT_LT((s.velocity - (v + 0.03 * a)).norm(), 64.0 * kEpsilon);
  EXPECT_LT((s.angular_velocity - turn / h).norm(), 64.0 * kEpsilon);
}

TEST(ExactMotion, AMoverFollowsItsParabolaAndTurnsSteadily) {
  ExactMotion motion;
  const RigidMotion mover{kPlace, {1.0, 2.0, 3.0}, {0.0, -5.0, 1.0}, {0.0, 40.0, 0.0}};
  motion.set_frame(mover, 0.2);
  RigidTransform pose;
  for (const double t : {0.0, 0.07, 0.2}) {
    motion.at(t, pose, {});
    EXPECT_LT((pose.p - (kPlace.p + t * mover.velocity + 0.5 * t * t * mover.acceleration)).norm(), 64.0 * kEpsilon);
    const Vec3 x = quaternion_from_rotation_vector(t * mover.angular_velocity) * (kPlace.q * Vec3::UnitX());
    EXPECT_LT((pose.q * Vec3::UnitX() - x).norm(), 64.0 * kEpsilon);
  }
  EXPECT_EQ(motion.modes(), 0);
  EXPECT_THROW(motion.set_frame({.velocity = {NAN, 0.0, 0.0}}, 0.1), InvalidArgument);
  EXPECT_THROW(motion.set_frame({}, -0.1), InvalidArgument);
  EXPECT_THROW(motion.set_frame({}, INFINITY), InvalidArgument);
}

/// The larger of 1 and how many times a bound exceeds what was attained.
double looseness(double bound, double attained) { return attained > 0.0 ? bound / attained : 1.0; }

TEST(MotionBounds, OfAModesChangeHoldInEveryRegimeAndAreNeverVacuous) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  double worst = 0.0;
  for (int n = 0; n < testing::all_or_tenth(4000); ++n) {
    const double h = 0.1, omega = std::pow(10.0, 2.0 * unit(random)) / h;
    const double zeta = n % 3 == 0 ? 0.0 : std::pow(10.0, 3.0 * unit(random));
    const Mode mode{.lambda = n % 7 == 0 ? 0.0 : omega * omega, .decay = n % 7 == 0 ? zeta / h : zeta * omega};
    const double scale = std::pow(omega, n % 5 - 2);
    const ModeState start{unit(random), n % 2 == 0 ? unit(random) * omega : 0.0};
    const double g = n % 4 == 0 ? unit(random) * omega * omega * scale : 0.0;
    const double bound = largest_change(mode, start, g, h);
    double change = 0.0;
    constexpr int kSamples = 2000;
    for (int i = 0; i <= kSamples; ++i) {
      const double t = h * i / kSamples;
      const ModeState s = i == 0 ? start : advance(propagator(mode, t), start, g);
      change = std::max(change, std::abs(s.z - start.z));
    }
    const double natural = std::abs(start.z) + std::abs(start.zdot) / omega + std::abs(g) * h * h;
    ASSERT_GE(bound, change - kSampleError * natural) << n;
    worst = std::max(worst, looseness(bound, change));
  }
  // Loosest where a swing of about one radian turns back: the terms that cancel there are bounded one by one.
  EXPECT_LT(worst, 8.0);
}

TEST(MotionBounds, OfAFramesTurnHoldAndAreNeverVacuous) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const auto vector = [&] { return Vec3(unit(random), unit(random), unit(random)); };
  double worst = 0.0;
  for (int n = 0; n < 300; ++n) {
    const FrameMotion kind = kAllMotions[n % 4];
    const Vec3 half(0.3, 0.3 * std::pow(10.0, -unit(random) * unit(random)), n % 3 == 0 ? 0.3 : 0.05);
    const double h = std::pow(10.0, -1.0 - unit(random));
    BodyGroup group(sample_model({.motion = kind, .modes = 2, .half_extent = half}), h);
    const Index slot = group.add(kPlace, 5.0 * vector(), 20.0 * vector());
    if (n % 8 >= 4) group.apply_force(slot, kMarked, 30.0 * vector());
    ExactMotion motion;
    group.predict_motion(slot, kDown, motion);
    MotionState start, s;
    motion.evaluate(0.0, start);
    double turn = 0.0;
    constexpr int kSamples = 400;
    for (int i = 0; i <= kSamples; ++i) {
      motion.evaluate(h * i / kSamples, s);
      turn = std::max(turn, rotation_vector(s.pose.q * start.pose.q.conjugate()).norm());
    }
    ASSERT_GE(motion.path().turn(), turn - kSampleError);
    worst = std::max(worst, looseness(motion.path().turn(), turn));
  }
  EXPECT_LT(worst, 2.0);  // a wobbling axis: the path of a rotation is longer than its chord
}

TEST(MotionBounds, NoPointOfTheSurfaceLeavesItsReach) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const auto vector = [&] { return Vec3(unit(random), unit(random), unit(random)); };
  double worst = 0.0;
  for (int n = 0; n < 120; ++n) {
    const FrameMotion kind = kAllMotions[n % 4];
    const double h = std::pow(10.0, -1.5 - 0.5 * unit(random)), flexing = std::pow(10.0, unit(random) - 2.0);
    const auto model = sample_model({.motion = kind, .modes = 5, .lowest_hz = 4.0, .decay = 2.0});
    BodyGroup group(model, h);
    const Index slot = group.add(kPlace, 3.0 * vector(), 8.0 * vector());
    std::vector<double> z(5), rates(5);
    for (std::size_t i = 0; i < 5; ++i) z[i] = flexing * unit(random), rates[i] = 30.0 * flexing * unit(random);
    group.set_amplitudes(slot, z, rates);
    if (n % 3 == 0) group.apply_impulse(slot, kMarked, vector(), 0.5 * h);
    if (n % 5 == 0) group.apply_force(slot, kMarked, 10.0 * vector());
    ExactMotion motion;
    group.predict_motion(slot, kDown, motion);
    const SurfaceExtent& extent = model->collision_extent();
    const double reach = motion.reach(extent.radius, extent.shape);
    MotionState start, s;
    motion.evaluate(0.0, start);
    double moved = 0.0;
    for (int i = 0; i <= 200; ++i) {
      motion.evaluate(h * i / 200, s);
      for (Index triangle = 0; triangle < 12; ++triangle) {
        const SurfacePoint at{.triangle = triangle};
        const Vec3 p_BP = deformed_point(*model, at, s.amplitudes);
        const Vec3 before = start.pose * deformed_point(*model, at, start.amplitudes);
        moved = std::max(moved, (s.pose * p_BP - before).norm());
      }
    }
    ASSERT_LE(moved, reach * (1.0 + kSampleError));
    worst = std::max(worst, reach / moved);
  }
  EXPECT_LT(worst, 5.0);  // sums of what no one point has at once: the largest arm, the largest shape of every mode
}

TEST(ExactMotion, WarmItAllocatesNothing) {
  Loaded body(FrameMotion::kPoint, 0.5);
  body.load();
  ExactMotion motion = body.predict();
  MotionState state;
  motion.evaluate(0.1, state);
  const long before = testing::allocations();
  body.group.predict_motion(body.slot, kDown, motion);
  motion.evaluate(0.3, state);
  motion.reach(1.0, body.group.model().collision_extent().shape);
  EXPECT_EQ(testing::allocations(), before);
}

}  // namespace
}  // namespace limber
