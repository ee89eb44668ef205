#include <gtest/gtest.h>

#include <cmath>

#include "bar_model.h"
#include "contact_scene.h"

namespace limber::testing {
namespace {

/// What a bar does that comes at a wall at unit speed.
struct Rebound {
  double speed = 0.0;           // of the mass centre afterwards, away from the wall
  double contact_time = 0.0;    // from the touch to the end of the last step with a force
  double highest_energy = 0.0;  // at the end of any step, by that at first; dents included
};

/// @param phase of the touch within a step: 0 at its start
Rebound strike(int modes, double step, const ContactOptions& options, double phase, bool residual = true) {
  GroundedIsland wall(bar_model(modes, residual), step, options, Vec3::UnitX(), Vec3::Zero());
  wall.add_body({{}, {0.5 * kBarLength + phase * step, 0.0, 0.0}}, {-1.0, 0.0, 0.0});
  Rebound seen;
  const double scale = wall.energy();
  int last = -1;
  for (int i = 0; i * step < 1.5 * kBarContactTime + phase * step; ++i) {
    wall.step();
    bool pressed = false;
    for (const ContactEvent& e : wall.contacts.events()) pressed = pressed || e.phase != ContactPhase::kEnded;
    if (pressed) last = i;
    seen.highest_energy = std::max(seen.highest_energy, wall.energy() / scale);
  }
  seen.contact_time = (last + 1 - phase) * step;
  seen.speed = wall.group.frame(0).velocity().x();
  return seen;
}

/// The worst over touches anywhere within a step.
Rebound strike_at_any_phase(int modes, double step, const ContactOptions& options) {
  Rebound worst{.speed = 2.0};
  for (const double phase : {0.05, 0.3, 0.5, 0.7, 0.95}) {
    const Rebound r = strike(modes, step, options, phase);
    if (r.speed < worst.speed) worst = r;
  }
  return worst;
}

// Theory's rebound is 1 as steps and dropped modes go to nothing; how much is left of it at the steps and modes at hand
// is no theory's. So these are regression guards, a little below what is measured (0.987 and 0.895).
constexpr double kReboundGuard = 0.98, kReboundGuardAtAnyPhase = 0.88;

constexpr ContactOptions kHeld{.friction = 0.0, .residual_compliance = true, .impact = ImpactModel::kHeld};
#if defined(__SANITIZE_ADDRESS__)
constexpr double kStepsPerContact[] = {100.0, 10.0};  // the sanitizers take twenty times as long
constexpr double kAnySteps[] = {20.5, 10.25, 10.0};
#else
constexpr double kStepsPerContact[] = {1000.0, 100.0, 20.0, 10.0};
constexpr double kAnySteps[] = {100.5, 100.0, 37.5, 20.5, 20.0, 13.3, 10.75, 10.5, 10.25, 10.1, 10.0};
#endif

TEST(Impact, ABarReboundsAsItCameIfStepsStartAtTheTouch) {
  for (const int modes : {20, 40})
    for (const double steps : kStepsPerContact) {
      const double h = kBarContactTime / steps;
      const Rebound r = strike(modes, h, kHeld, 0.0);
      EXPECT_GE(r.speed, kReboundGuard) << modes << " modes, T/" << steps;
      EXPECT_LE(r.speed, 1.0 + 1e-12) << modes << " modes, T/" << steps;
      EXPECT_NEAR(r.contact_time, kBarContactTime, 0.02 * kBarContactTime + h) << modes << " modes, T/" << steps;
      EXPECT_LE(r.highest_energy, 1.0 + 1e-12) << modes << " modes, T/" << steps;
    }
}

TEST(Impact, ABarReboundsWithMostOfItsSpeedWhereverTheTouchFallsWithinAStep) {
  for (const int modes : {20, 40})
    for (const double steps : {100.0, 20.0, 10.0}) {
      const double h = kBarContactTime / steps;
      const Rebound r = strike_at_any_phase(modes, h, kHeld);
      EXPECT_GE(r.speed, kReboundGuardAtAnyPhase) << modes << " modes, T/" << steps;
      EXPECT_NEAR(r.contact_time, kBarContactTime, 0.02 * kBarContactTime + h) << modes << " modes, T/" << steps;
      EXPECT_LE(r.highest_energy, 1.0 + 1e-12) << modes << " modes, T/" << steps;
    }
}

constexpr ContactOptions kCut{.friction = 0.0, .residual_compliance = true, .impact = ImpactModel::kHeldFromTouch};

/// Steps that do not divide the contact time either, in which the bar lets go somewhere in between.
TEST(Impact, ABarReboundsAsItCameWhateverTheStepIfThatIsCutWhereItTouchesAndLetsGo) {
  for (const int modes : {20, 40})
    for (const double steps : kAnySteps)
      for (const double phase : {0.0, 0.05, 0.3, 0.5, 0.7, 0.95}) {
        const double h = kBarContactTime / steps;
        const Rebound r = strike(modes, h, kCut, phase);
        const auto where = ::testing::Message() << modes << " modes, T/" << steps << " phase " << phase;
        EXPECT_GE(r.speed, kReboundGuard) << where;
        EXPECT_GE(r.speed, strike(modes, h, kHeld, phase).speed - 1e-3) << where;
        EXPECT_LE(r.speed, 1.0 + 1e-12) << where;
        EXPECT_NEAR(r.contact_time, kBarContactTime, 0.02 * kBarContactTime + h) << where;
        EXPECT_LE(r.highest_energy, 1.0 + 1e-12) << where;
      }
}

TEST(Impact, ABarReboundsAsItCameInStepsThatAreShorterThanItsModes) {
  const Rebound r = strike(20, kBarContactTime / kStepsPerContact[0], kCut, 0.5);
  EXPECT_GE(r.speed, kReboundGuard);
  EXPECT_LE(r.highest_energy, 1.0 + 1e-12);
}

/// The touch, the time in which the far end's way would take it through the wall, and the release in one step.
TEST(Impact, ABarReboundsAsItCameInStepsThatAreLongerThanTheImpact) {
  for (const double steps : {3.0, 2.0, 1.2, 0.9, 0.5, 0.1})
    for (const double phase : {0.0, 0.05, 0.3, 0.5, 0.7, 0.95}) {
      const Rebound r = strike(20, kBarContactTime / steps, kCut, phase);
      EXPECT_GE(r.speed, kReboundGuard) << "T/" << steps << " phase " << phase;
      EXPECT_LE(r.highest_energy, 1.0 + 1e-12) << "T/" << steps << " phase " << phase;
    }
}

/// Held forces go on after the cut, and drawing starts where the step did.
TEST(Impact, AlongTheGroundACutStepIsAsAWholeOne) {
  constexpr double kStep = 0.05;
  const SampleOptions sample{.modes = 6, .lowest_hz = 3.0};
  for (const bool struck : {false, true}) {
    GroundedIsland scene(sample, kStep, {.friction = 0.0, .impact = ImpactModel::kHeldFromTouch});
    scene.add_body({quaternion_from_rotation_vector({0.1, 0.2, 0.3}), {0.0, 0.0, struck ? 0.3 : 50.0}},
                   {0.3, 0.0, -4.0}, {0.5, 0.2, 0.1});
    scene.group.apply_force(0, corner_point(*scene.model, 3), {2.0, 1.0, 0.5});
    ExactMotion free;
    scene.group.predict_motion(0, {0.0, 0.0, -kGravity}, free);
    const IslandReport report = scene.step();
    EXPECT_EQ(report.attempts.cuts() > 0, struck);
    MotionState end;
    free.evaluate(kStep, end);
    // What touches gets held forces at its part's start, and so their way of half a part too much.
    const double pull = 2.0 / scene.model->data().mass;
    EXPECT_NEAR(scene.group.frame(0).pose().p.x(), end.pose.p.x(), struck ? 0.5 * pull * kStep * kStep : 1e-12);
    EXPECT_NEAR(scene.group.frame(0).velocity().x(), end.velocity.x(), 1e-9);
    EXPECT_EQ(scene.group.previous_pose(0).p.z(), struck ? 0.3 : 50.0);
  }
}

/// With θ = 1 each step takes ½ f A_r f from the frame: N equal impulses 2mv/N take 4/N of its energy.
TEST(Impact, ImpulsesAtTheStepsStartLoseFourNthsOfTheEnergy) {
  for (const double steps : {10.0, 20.0, 50.0}) {
    const Rebound r = strike(40, kBarContactTime / steps, {.friction = 0.0}, 0.0);
    EXPECT_NEAR(r.speed, std::sqrt(1.0 - 4.0 / steps), 0.03) << "T/" << steps;
  }
}

TEST(Impact, WhatHasNothingElasticDoesNotRebound) {
  const Rebound r = strike(0, 0.1, {.friction = 0.0, .impact = ImpactModel::kHeld}, 0.3, false);
  EXPECT_NEAR(r.speed, 0.0, 1e-9);
}

TEST(Impact, WhatComesSlowlyIsNoImpact) {
  ContactOptions slow = kHeld;
  slow.impact_speed = 1.1;
  ContactOptions absorbed = kHeld;
  absorbed.impact = ImpactModel::kAbsorbed;
  EXPECT_EQ(strike(20, 0.1, slow, 0.3).speed, strike(20, 0.1, absorbed, 0.3).speed);
}

/// Two equal bars end on: the first stops and the second goes on.
void expect_exchanged_speeds(double step, const ContactOptions& options) {
  constexpr double kFarFromTheWall = 10.0;
  GroundedIsland bars(bar_model(40, true), step, options, Vec3::UnitX(), Vec3::Zero());
  bars.add_body({{}, {kFarFromTheWall, 0.0, 0.0}}, {1.0, 0.0, 0.0});
  bars.add_body({{}, {kFarFromTheWall + kBarLength + 1e-3, 0.0, 0.0}});
  for (int i = 0; i * step < 2.0 * kBarContactTime; ++i) {
    bars.others.clear();
    for (const Index corner : {0, 2, 4, 6}) {  // the left end of the right bar on the right end of the left one
      const SurfacePoint left = corner_point(*bars.model, corner), right = corner_point(*bars.model, corner + 1);
      bars.others.push_back({.a = contact_side(bars, 0, right),
                             .b = contact_side(bars, 1, left),
                             .normal = -Vec3::UnitX(),
                             .position = bars.group.position(0, right),
                             .gap = bars.group.position(1, left).x() - bars.group.position(0, right).x(),
                             .id = static_cast<std::uint64_t>(100 + corner)});
    }
    bars.step();
  }
  EXPECT_NEAR(bars.group.frame(0).velocity().x(), 0.0, 0.02) << step;
  EXPECT_NEAR(bars.group.frame(1).velocity().x(), 1.0, 0.02) << step;
  EXPECT_NEAR(bars.linear_momentum().x(), kBarMass, 1e-10) << step;
}

TEST(Impact, EqualBarsExchangeTheirSpeeds) {
  expect_exchanged_speeds(0.02, kHeld);
  for (const double steps : {100.0, 20.5, 10.5, 10.25}) expect_exchanged_speeds(kBarContactTime / steps, kCut);
}

}  // namespace
}  // namespace limber::testing
