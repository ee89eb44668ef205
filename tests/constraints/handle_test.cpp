#include "limber/constraints/handle.h"
#include "asked.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "constants.h"
#include "islands.h"
#include "limber/core/error.h"

namespace limber {
namespace {

using testing::Island;
using testing::kFrame;
using testing::kGravity;
using testing::kMarked;
using testing::kSampleSize;
using testing::kSecond;

constexpr double kExact = 1e-9;  // of the size: what a held point may be off by

TEST(Handle, HeldPointIsAtItsTargetAtAnyStiffnessOnATurningBody) {
  for (const double hz : {0.5, 5.0, 29.0, 100.0, 1e5})
    for (const double step : {1e-3, kFrame}) {
      Island island({.modes = 12, .lowest_hz = hz, .decay = 0.2}, step);
      island.add_body({}, {0.2, 0.1, 0.0}, {3.0, -2.0, 4.0});
      Handle& handle = island.hold(0, kMarked);
      Vec3 target = handle.target().position;
      for (int i = 0; i < 100; ++i) {
        target += step * Vec3(0.3 * std::cos(i * step), 0.2, -0.1);
        handle.set_target({.position = target});
        const IslandReport report = island.step();
        ASSERT_EQ(report.status, IslandStatus::kSolved) << hz << ' ' << step;
        ASSERT_LT((island.group.position(0, kMarked) - target).norm(), kExact * kSampleSize);
        ASSERT_LT(handle.error(island.states()), kExact * kSampleSize);
      }
    }
}

/// Two handles on a body with enough modes are two feasible ones; four points of it, twice, are redundant.
TEST(Handle, SeveralAndRedundantOnesAreMetTogether) {
  Island island({.modes = 12, .lowest_hz = 10.0, .decay = 0.5}, kFrame);
  island.add_body({});
  std::vector<Handle*> handles = {&island.hold(0, kMarked), &island.hold(0, kSecond), &island.hold(0, kMarked)};
  for (int i = 0; i < 60; ++i) {
    for (Handle* handle : handles)
      handle->set_target({.position = handle->target().position + Vec3(0.0, 0.002, 0.001)});
    EXPECT_EQ(island.step().status, IslandStatus::kSolved);
    for (const Handle* handle : handles) EXPECT_LT(handle->error(island.states()), kExact * kSampleSize);
  }
}

/// Two hands that want one point at different places share it: least squares.
TEST(Handle, ConflictingOnesMeetInTheMiddle) {
  Island island({.modes = 6, .lowest_hz = 10.0, .decay = 0.5}, kFrame);
  island.add_body({});
  Handle &one = island.hold(0, kMarked), &other = island.hold(0, kMarked);
  const Vec3 at = one.target().position;
  one.set_target({.position = at + Vec3(0.0, 0.0, 0.02)});
  other.set_target({.position = at - Vec3(0.0, 0.0, 0.01)});
  for (int i = 0; i < 60; ++i) island.step();
  EXPECT_LT((island.group.position(0, kMarked) - at - Vec3(0.0, 0.0, 0.005)).norm(), 1e-6 * kSampleSize);
}

TEST(Handle, HoldsInItsDirectionsAlone) {
  Island island({.modes = 0}, kFrame, Vec3::Zero());
  island.add_body({}, {0.3, 0.0, 0.2});
  const Vec3 before = island.group.position(0, kMarked);
  island.hold(0, kMarked, {.directions = {Vec3::UnitZ()}});
  for (int i = 0; i < 30; ++i) island.step();
  const Vec3 moved = island.group.position(0, kMarked) - before;
  EXPECT_LT(std::abs(moved.z()), kExact * kSampleSize);
  EXPECT_GT(moved.x(), 0.1);
}

TEST(Handle, FixedHandsGiveNoEnergy) {
  for (const double hz : {1.0, 20.0, 1e4})
    for (const double step : {1e-3, kFrame, 0.05}) {
      Island island({.modes = 10, .lowest_hz = hz}, step);
      island.add_body({}, Vec3::Zero(), {1.0, 2.0, -1.0});
      island.hold(0, kMarked);
      double before = island.energy(), rise = 0.0;
      for (int i = 0; i < 300; ++i) {
        island.step();
        rise = std::max(rise, island.energy() - before);
        before = island.energy();
      }
      EXPECT_LT(rise, 1e-6 * island.energy_scale()) << hz << ' ' << step;
    }
}

/// The force is the spring's and the damper's at the step's end, F = −k e − c (e − e₀)/h. Spring and weight are all
/// that acts but what a spring that is stiff over the step takes of the velocity at its end, which is no part of that
/// force: so the spring's impulse is the momentum to what these are (3.6e-4 of the weight's; a regression guard).
TEST(Handle, MouseSpringIsStableForEveryStiffnessAndCarriesTheWeight) {
  for (const double k : testing::all_or_first<double>({1e6, 10.0, 1e3, 1e12})) {
    const double c = 0.05 * k;
    Island island({.modes = 8, .lowest_hz = 8.0, .decay = 2.0}, kFrame);
    island.add_body({});
    Handle& spring = island.hold(0, kMarked, {.stiffness = k, .damping = c});
    const double weight = island.model->data().mass * kGravity;
    constexpr int kSteps = 6000;
    constexpr double kEndImpulses = 5e-4;
    Vec3 impulse = Vec3::Zero(), error = Vec3::Zero();
    double worst = 0.0;
    for (int i = 0; i < kSteps; ++i) {
      const Vec3 before = error;
      island.step();
      impulse += kFrame * spring.force();
      error = island.group.position(0, kMarked) - spring.target_now();
      worst = std::max(worst, (spring.force() + k * error + c / kFrame * (error - before)).norm());
      ASSERT_LT(island.group.frame(0).velocity().norm(), 10.0) << k;
    }
    const Vec3 expected = island.linear_momentum() + Vec3(0.0, 0.0, kSteps * kFrame * weight);
    EXPECT_LT((impulse - expected).norm(), kEndImpulses * expected.norm()) << k;
    // What the solver leaves of a gap counts by the stiffness it meets.
    EXPECT_LT(worst, 1e-6 * weight + (k + c / kFrame) * 1e-10 * kSampleSize) << k;
  }
}

/// No motion meets both: the point ends half way, each is off by half of what is between them, and no status says
/// solved.
TEST(Handle, TwoThatContradictEachOtherEndAtALimitWithTheirDistanceAsResidual) {
  constexpr double kApart = 0.01;
  Island island({.modes = 4, .lowest_hz = 20.0}, kFrame, Vec3::Zero());
  island.add_body({});
  Handle &a = island.hold(0, kMarked), &b = island.hold(0, kMarked);
  b.set_target({.position = b.target().position + Vec3(kApart, 0.0, 0.0)});
  for (int i = 0; i < 3; ++i) {
    const IslandReport report = island.step();
    EXPECT_EQ(report.status, IslandStatus::kLimit) << i;
    EXPECT_EQ(report.statuses[IslandStatus::kLimit], 1) << i;
    EXPECT_NEAR(a.error(island.states()), 0.5 * kApart, 1e-6 * kApart) << i;
    EXPECT_NEAR(b.error(island.states()), 0.5 * kApart, 1e-6 * kApart) << i;
    EXPECT_GT(report.change, 1e6) << i;  // 5 mm in units of about 1e-11 of the body's length
  }
}

TEST(Handle, PullsNoHarderThanItsForce) {
  Island island({.modes = 4, .lowest_hz = 20.0}, kFrame, Vec3::Zero());
  island.add_body({});
  Handle& hand = island.hold(0, kMarked, {.max_force = 2.0});
  hand.set_target({.position = hand.target().position + Vec3(10.0, 0.0, 0.0)});
  for (int i = 0; i < 60; ++i) {
    island.step();
    EXPECT_LE(hand.force().cwiseAbs().maxCoeff(), 2.0 * (1.0 + 1e-12));
  }
  EXPECT_GT(hand.force().x(), 1.9);
  // 2 N for a second: it pulls with all of them from the first step to the last.
  EXPECT_NEAR(island.linear_momentum().x(), 2.0, 1e-9);
}

/// Bodies of any stiffness, most with modes above the Nyquist rate, dragged by hands that pull them along together and
/// apart by a little: a body has no more energy than the hands' work, which is their force along their way.
TEST(Handle, InFiveHundredRandomRunsABodyGetsNoMoreThanTheHandsWork) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  const auto vector = [&] { return Vec3(unit(random) - 0.5, unit(random) - 0.5, unit(random) - 0.5); };
  constexpr double kSpeed = 0.2;  // m/s, of the hands
  for (int run = 0; run < testing::all_or_tenth(500); ++run) {
    const double hz = std::pow(10.0, -0.5 + 5.0 * unit(random));
    Island island({.modes = 10, .lowest_hz = hz, .decay = run % 3 == 0 ? 0.0 : 0.02 * hz}, kFrame, Vec3::Zero());
    island.add_body({});
    const Vec3 together = kSpeed * vector();
    std::vector<Handle*> hands;
    for (int i = 0; i < 1 + run % 3; ++i) {
      hands.push_back(&island.hold(
          0, {.triangle = static_cast<Index>(12.0 * unit(random)), .weight = {0.2 + 0.1 * i, 0.5, 0.3 - 0.1 * i}}));
      hands.back()->set_target(
          {.position = hands.back()->target().position, .velocity = together + 1e-3 * kSpeed * vector()});
    }
    double before = island.energy(), worst = 0.0, scale = 0.5 * island.model->data().mass * kSpeed * kSpeed;
    for (int i = 0; i < 100; ++i) {
      std::vector<Vec3> from;
      for (const Handle* hand : hands) from.push_back(hand->target_now());
      island.step();
      double work = 0.0;
      for (std::size_t h = 0; h < hands.size(); ++h) work += hands[h]->force().dot(hands[h]->target_now() - from[h]);
      const double now = island.energy();
      scale = std::max(scale, now);
      worst = std::max(worst, (now - before - work) / scale);
      before = now;
    }
    ASSERT_LT(worst, 1e-6) << run << ' ' << hz << ' ' << hands.size();
  }
}

TEST(Handle, RefusesOptionsWithoutSense) {
  const auto refused = [](const HandleOptions& options) { EXPECT_THROW(options.validate(), InvalidArgument); };
  refused({.directions = {Vec3::UnitX(), Vec3::UnitX()}});
  refused({.directions = {2.0 * Vec3::UnitX()}});
  refused({.max_force = 0.0});
  refused({.stiffness = -1.0});
  refused({.damping = 1.0});
  refused({.stiffness = std::nan("")});
}

}  // namespace
}  // namespace limber
