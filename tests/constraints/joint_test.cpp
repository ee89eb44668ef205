#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "asked.h"
#include "constants.h"
#include "counted_new.h"
#include "islands.h"
#include "limber/core/error.h"

namespace limber {
namespace {

using testing::add_chain;
using testing::hinge_axes;
using testing::Island;
using testing::kFrame;
using testing::kGravity;
using testing::kLeftEnd;
using testing::kRightEnd;
using testing::SampleOptions;

// Steps of the runs that look for drift; the campaign takes 100,000.
const int kLongRun = testing::asked("LIMBER_STEPS", testing::all_or_tenth(4000));
constexpr int kEnergySteps = testing::all_or_tenth(1500);
// What joints may be off by: lengths of 0.6 m are met to this part.
constexpr double kDrift = 1e-6;
// Of the energy's scale: what an energy may rise by in a step through round-off.
constexpr double kRise = 1e-12;

JointSpec hinge() { return {.type = JointType::kRevolute, .frame = {.axes = hinge_axes()}}; }

constexpr JointType kTypes[] = {JointType::kBall,      JointType::kRevolute, JointType::kCylindrical,
                                JointType::kPrismatic, JointType::kPlanar,   JointType::kFixed};

TEST(Joint, EveryTypeLeavesItsFreedomsAndLocksTheOthers) {
  for (const JointType type : kTypes)
    for (const int modes : {0, 6}) {
      Island island({.modes = modes, .lowest_hz = 15.0, .decay = 1.0}, kFrame, Vec3::Zero());
      const JointSpec spec{.type = type};
      add_chain(island, 2, spec, false);
      island.group.apply_generalized_impulse(1, {0.3, -0.2, 0.4}, {0.05, 0.08, -0.06}, {});
      for (int step = 0; step < 60; ++step) EXPECT_EQ(island.step().status, IslandStatus::kSolved);
      EXPECT_LT(island.joint_error(), 1e-9) << to_string(type);
      for (int i = 0; i < freedoms(type).count(); ++i)
        EXPECT_GT(std::abs(island.joints[0]->coordinate(i, island.states())), 1e-3) << to_string(type) << ' ' << i;
    }
}

TEST(Joint, HangingChainDoesNotDrift) {
  Island island({.modes = 0}, kFrame);
  add_chain(island, 3, hinge());
  double worst = 0.0;
  for (int step = 0; step < kLongRun; ++step) {
    island.step();
    worst = std::max(worst, island.joint_error());
  }
  EXPECT_LT(worst, kDrift);
}

/// Three moving bars and the world: a loop, of which one hinge's rows out of plane are redundant.
TEST(Joint, FourBarLoopDoesNotDrift) {
  Island island({.modes = 0}, kFrame);
  // Crank 0.2, coupler 0.6, rocker 0.5, ground 0.55: the crank goes round (Grashof), and no two bars are ever in line
  // with the ground together.
  const double crank = 0.2, coupler = 0.6, rocker = 0.5, ground = 0.55;
  const Vec3 A(0.0, 0.0, crank);
  const double d = std::hypot(ground, crank), along = (coupler * coupler - rocker * rocker + d * d) / (2.0 * d);
  const Vec3 e = (Vec3(ground, 0.0, 0.0) - A) / d, up(-e.z(), 0.0, e.x());
  const Vec3 B = A + along * e + std::sqrt(coupler * coupler - along * along) * up;
  const auto bar = [&](const Vec3& from, const Vec3& to) {
    const Vec3 x = (to - from).normalized();
    const Quaternion q = quaternion_from_rotation_vector(std::atan2(-x.z(), x.x()) * Vec3::UnitY());
    return island.add_body({q, 0.5 * (from + to)});
  };
  const Index bars[] = {bar(Vec3::Zero(), A), bar(A, B), bar(Vec3(ground, 0.0, 0.0), B)};
  const auto at = [&](Index body, const Vec3& p_W) {
    const RigidTransform X_BW = island.group.frame(body).pose().inverse();
    return MaterialFrame(body, JointFrame{.origin = X_BW * p_W, .axes = to_matrix(X_BW.q) * hinge_axes()});
  };
  const auto world = [](const Vec3& p) { return MaterialFrame(JointFrame{.origin = p, .axes = hinge_axes()}); };
  const Vec3 O(ground, 0.0, 0.0);
  island.join(world(Vec3::Zero()), at(bars[0], Vec3::Zero()), hinge());
  island.join(at(bars[0], A), at(bars[1], A), hinge());
  island.join(at(bars[1], B), at(bars[2], B), hinge());
  island.join(world(O), at(bars[2], O), hinge());
  double worst = 0.0, rise = 0.0, before = island.energy();
  const double scale = island.energy_scale();
  for (int step = 0; step < kLongRun; ++step) {
    island.step();
    worst = std::max(worst, island.joint_error());
    const double energy = island.energy();
    rise = std::max(rise, (energy - before) / scale);
    before = energy;
  }
  EXPECT_LT(worst, kDrift);
  EXPECT_LT(rise, kRise);
}

TEST(Joint, EnergyNeverRisesForAnyStiffnessStepAndDamping) {
  for (const double step : {1e-4, 1e-3, kFrame, 0.1})
    for (const double hz : testing::all_or_first<double>({20.0, 0.3, 1e3, 1e6}))
      for (const double decay : {0.0, 3.0, 1e5}) {
        Island island({.modes = 8, .lowest_hz = hz, .decay = decay}, step);
        add_chain(island, 3, hinge());
        double before = island.energy(), rise = 0.0;
        const double scale = island.energy_scale();
        for (int i = 0; i < 150; ++i) {
          island.step();
          const double energy = island.energy();
          rise = std::max(rise, (energy - before) / scale);
          before = energy;
        }
        EXPECT_LT(rise, 1e-6) << step << " s, " << hz << " Hz, decay " << decay;
        EXPECT_TRUE(std::isfinite(before));
      }
}

/// The energy guard takes what is too much and gives back what is lost, so that nothing drifts.
TEST(Joint, ChainsEnergyStaysWhereItWas) {
  for (const double hz : {20.0, 1e4}) {
    Island island({.modes = hz < 100.0 ? 0 : 6, .lowest_hz = hz}, kFrame);
    add_chain(island, 5, {.type = JointType::kBall});
    const double first = island.energy();
    for (int step = 0; step < kEnergySteps; ++step) island.step();
    EXPECT_NEAR(island.energy() / island.energy_scale(), first / island.energy_scale(), 1e-6) << hz;
  }
}

/// What a chain's energy does in a second without the guard, by its scale.
struct Unguarded {
  double rise = 0.0, stray = 0.0, error = 0.0;
  int unsettled = 0;
};
Unguarded run_without_guard(const JointSpec& spec, const SampleOptions& sample, double step, double seconds) {
  Island island(sample, step);
  island.guard_energy = false;
  add_chain(island, 3, spec);
  Unguarded seen;
  const double first = island.energy();
  double before = first, scale = island.energy_scale();
  for (double time = 0.0; time < seconds; time += step) {
    if (island.step().status != IslandStatus::kSolved) ++seen.unsettled;
    scale = std::max(scale, island.energy_scale());  // what slides freely falls far
    const double now = island.energy();
    seen.rise = std::max(seen.rise, (now - before) / scale);
    seen.stray = std::max(seen.stray, std::abs(now - first) / scale);
    seen.error = std::max(seen.error, island.joint_error());
    before = now;
  }
  return seen;
}

/// Impulses in the middle of the step do no work where gaps do not change, however far bodies turn and bend in it.
TEST(Joint, WithoutTheGuardEnergyNeverRisesWhateverTheTypeStiffnessAndStep) {
  for (const JointType type : kTypes)
    for (const double step : {1e-3, kFrame, 0.1, 1.0})
      for (const double hz : testing::all_or_first<double>({3.0, 0.3, 20.0, 1e4})) {
        if (step * 0.3 > 0.1 && hz == 0.3) continue;  // a body that falls by many times its length while it bends once
        const double seconds = std::max(testing::kSanitized ? 0.05 : 0.5, 40.0 * step);
        const Unguarded seen = run_without_guard({.type = type, .frame = {.axes = hinge_axes()}},
                                                 {.modes = 6, .lowest_hz = hz}, step, seconds);
        EXPECT_LT(seen.rise, kRise) << to_string(type) << ' ' << step << " s, " << hz << " Hz";
        EXPECT_LT(seen.error, 1e-10) << to_string(type) << ' ' << step << " s, " << hz << " Hz";
        // Beams of three links that swing freely for several of their periods within a step do not always settle.
        if (type == JointType::kFixed && step >= 0.1) continue;
        EXPECT_EQ(seen.unsettled, 0) << to_string(type) << ' ' << step << " s, " << hz << " Hz";
      }
}

/// What velocities lose where they are brought in line with the joints at the end of each step.
TEST(Joint, WithoutTheGuardAChainsEnergyStraysToThirdOrderInTheStep) {
  const JointSpec ball{.type = JointType::kBall};
  const double coarse = run_without_guard(ball, {.modes = 0}, 1.0 / 240.0, 0.5).stray,
               fine = run_without_guard(ball, {.modes = 0}, 1.0 / 480.0, 0.5).stray;
  EXPECT_GT(fine, 1e-9) << "there is nothing to give back";
  EXPECT_NEAR(coarse / fine, 8.0, 1.0) << coarse << " and " << fine;
}

TEST(Joint, InternalImpulsesKeepMomentum) {
  for (const JointType type : kTypes) {
    Island island({.modes = 6, .lowest_hz = 15.0, .decay = 0.5}, kFrame, Vec3::Zero());
    add_chain(island, 4, {.type = type}, false);
    island.group.apply_generalized_impulse(0, {0.3, -0.2, 0.4}, {0.05, 0.08, -0.06}, {});
    island.group.apply_generalized_impulse(3, {-1.3, 2.2, 0.4}, {-0.5, 0.3, 0.2}, {});
    const Vec3 p = island.linear_momentum(), L = island.angular_momentum();
    for (int step = 0; step < 200; ++step) island.step();
    EXPECT_LT((island.linear_momentum() - p).norm(), 1e-10 * p.norm()) << to_string(type);
    EXPECT_LT((island.angular_momentum() - L).norm(), 1e-10 * L.norm()) << to_string(type);
  }
}

/// ω² = m g l/(I + m l²); the method is second order, and the swing not quite small.
TEST(Joint, PendulumHasItsPeriod) {
  const double step = 1e-3, angle = 0.01;
  Island island({.modes = 0}, step);
  const Quaternion q = quaternion_from_rotation_vector((0.5 * std::numbers::pi - angle) * Vec3::UnitY());
  island.add_body({q, q * Vec3(0.3, 0.0, 0.0)});
  const Mat3 axes_B = to_matrix(q).transpose() * hinge_axes();
  island.join(MaterialFrame(JointFrame{.axes = hinge_axes()}),
              MaterialFrame(0, JointFrame{.origin = kLeftEnd, .axes = axes_B}), hinge());
  const ModalModelData& body = island.model->data();
  const double inertia = body.inertia(1, 1) + body.mass * 0.09;
  const double period = 2.0 * std::numbers::pi * std::sqrt(inertia / (body.mass * kGravity * 0.3));
  double last = island.group.frame(0).pose().p.x(), crossings = 0.0, first_time = 0.0, time = 0.0;
  for (int i = 1; i < 12000; ++i) {
    island.step();
    const double x = island.group.frame(0).pose().p.x();
    if (last > 0.0 && x <= 0.0) {
      const double at = (i - 1 + last / (last - x)) * step;
      if (crossings == 0.0) first_time = at;
      time = at, crossings += 1.0;
    }
    last = x;
  }
  const double large_swing = 1.0 + angle * angle / 16.0;
  EXPECT_NEAR((time - first_time) / (crossings - 1.0), period * large_swing, 2e-5 * period);
}

/// Two free bodies on a slider with a spring: ω² = k (1/m + 1/m).
TEST(Joint, TwoBodiesOnASpringSwingAtTheirReducedMass) {
  const double step = 1e-4, k = 50.0;
  Island island({.modes = 0}, step, Vec3::Zero());
  const JointSpec slider{.type = JointType::kPrismatic};
  add_chain(island, 2, slider, false);
  island.joints[0]->set_actuation(0, {.drive_target = 0.01, .drive_stiffness = k});
  const double omega = std::sqrt(2.0 * k / island.model->data().mass);
  const double quarter = 0.5 * std::numbers::pi / omega;
  const int steps = static_cast<int>(quarter / step);
  for (int i = 0; i < steps; ++i) island.step();
  const double first_order = omega * step;  // the spring is implicit
  EXPECT_NEAR(island.joints[0]->coordinate(0, island.states()), 0.01 * (1.0 - std::cos(omega * steps * step)),
              0.01 * first_order);
}

TEST(Joint, LimitsHold) {
  for (const double step : {1e-3, kFrame}) {
    Island island({.modes = 0}, step);
    JointSpec spec = hinge();
    spec.limits.rotation = {-0.5, 0.3};
    add_chain(island, 2, spec);
    double lowest = 0.0, highest = 0.0, before = island.energy(), rise = 0.0;
    for (int i = 0; i < static_cast<int>(3.0 / step); ++i) {
      island.step();
      for (const JointConstraint* joint : island.joints) {
        lowest = std::min(lowest, joint->coordinate(0, island.states()));
        highest = std::max(highest, joint->coordinate(0, island.states()));
      }
      rise = std::max(rise, island.energy() - before);
      before = island.energy();
    }
    EXPECT_GT(lowest, -0.5 - 1e-6);
    EXPECT_LT(highest, 0.3 + 1e-6);
    EXPECT_GT(highest, 0.29) << "it falls to its stop";
    EXPECT_LT(rise, 1e-6 * island.energy_scale());
  }
}

TEST(Joint, BallStaysInItsCone) {
  Island island({.modes = 0}, kFrame);
  JointSpec spec{.type = JointType::kBall};
  spec.limits.cone = 0.4;
  add_chain(island, 3, spec);
  for (int i = 0; i < 200; ++i) {
    island.step();
    for (Index body = 0; body < 3; ++body) {
      const Vec3 x = island.group.frame(body).pose().q * Vec3::UnitX();
      const Vec3 last = body == 0 ? Vec3(Vec3::UnitX()) : Vec3(island.group.frame(body - 1).pose().q * Vec3::UnitX());
      ASSERT_LT(std::atan2(x.cross(last).norm(), x.dot(last)), 0.4 + 1e-6);
    }
  }
}

TEST(Joint, RestingOnALimitHasNoVelocity) {
  Island island({.modes = 0}, kFrame);
  JointSpec spec = hinge();
  spec.limits.rotation = {-0.2, 0.0};
  add_chain(island, 1, spec);  // lies on its stop from the start
  for (int i = 0; i < 100; ++i) island.step();
  EXPECT_LT(island.group.frame(0).velocity().norm(), 1e-12);
  EXPECT_NEAR(island.joints[0]->coordinate(0, island.states()), 0.0, 1e-12);
}

/// Of bodies that bend, on stops: the last step's forces are this step's.
TEST(Joint, WhatRestsTakesAnIterationAtMost) {
  Island island({.modes = 6, .lowest_hz = 40.0, .decay = 30.0}, kFrame);
  JointSpec spec = hinge();
  spec.limits.rotation = {-0.2, 0.0};
  add_chain(island, 2, spec);
  IslandReport last;
  for (int i = 0; i < 300; ++i) last = island.step();
  EXPECT_LE(last.iterations, 1);
  EXPECT_LT(island.joint_error(), 1e-12);
}

/// However little links bend in a step, rows of its middle keep their digits.
TEST(Joint, LinksThatBendEverMoreSlowlyTakeNoMoreIterations) {
  Island island({.modes = 12, .lowest_hz = 50.0, .decay = 100.0}, kFrame);
  add_chain(island, 3, {.type = JointType::kFixed});
  for (int step = 0; step < 200; ++step) {
    const IslandReport report = island.step();
    EXPECT_EQ(report.status, IslandStatus::kSolved);
    EXPECT_LE(report.iterations, 10) << "step " << step;
  }
}

TEST(Joint, AWarmStepAllocatesNothingAsStopsAreHitAndLeft) {
  Island island({.modes = 6, .lowest_hz = 20.0, .decay = 1.0}, kFrame);
  JointSpec spec = hinge();
  spec.limits.rotation = {-0.5, 0.3};
  add_chain(island, 3, spec);
  const auto swing = [&] {
    for (const Index body : island.members) island.group.apply_generalized_impulse(body, {}, {0.0, -30.0, 0.0}, {});
    for (int i = 0; i < 60; ++i) island.step();
  };
  for (int i = 0; i < 4; ++i) swing();
  const long before = testing::allocations();
  swing();
  EXPECT_EQ(testing::allocations() - before, 0);
}

TEST(Joint, MotorTurnsAtItsSpeedUpToItsTorque) {
  Island island({.modes = 0}, kFrame, Vec3::Zero());
  add_chain(island, 1, hinge());
  JointConstraint& joint = *island.joints[0];
  const ModalModelData& body = island.model->data();
  const double inertia = body.inertia(1, 1) + body.mass * 0.09;
  joint.set_actuation(0, {.motor_velocity = 2.0, .motor_max_force = 0.5});
  island.step();
  const auto speed = [&] { return island.group.frame(0).angular_velocity(island.group.frame_constants()).y(); };
  const double first = speed();
  island.step();
  EXPECT_NEAR(speed() - first, 0.5 * kFrame / inertia, 1e-9) << "one step of the largest torque";
  EXPECT_NEAR(joint.coordinate_force(0), 0.5, 1e-9);
  for (int i = 0; i < 300; ++i) island.step();
  EXPECT_NEAR(speed(), 2.0, 1e-6);
  const double q = joint.coordinate(0, island.states());
  EXPECT_GT(q, 2.0 * std::numbers::pi) << "angles count full turns";
}

TEST(Joint, FrictionHoldsWhatItCan) {
  for (const bool strong : {true, false}) {
    Island island({.modes = 0}, kFrame);
    add_chain(island, 1, hinge());
    const double weight = island.model->data().mass * kGravity * 0.3;
    island.joints[0]->set_actuation(0, {.friction = strong ? 1.01 * weight : 0.9 * weight});
    for (int i = 0; i < 60; ++i) island.step();
    const double q = island.joints[0]->coordinate(0, island.states());
    if (strong)
      EXPECT_LT(std::abs(q), 1e-9);
    else
      EXPECT_GT(std::abs(q), 0.1);
  }
}

TEST(Joint, DriveIsStableForEveryStiffnessAndRestsAtItsSag) {
  for (const double k : {1e1, 1e4, 1e9}) {
    Island island({.modes = 0}, kFrame);
    add_chain(island, 1, hinge());
    const double weight = island.model->data().mass * kGravity * 0.3;
    island.joints[0]->set_actuation(0, {.drive_stiffness = k, .drive_damping = 0.1 * k});
    for (int i = 0; i < 2000; ++i) island.step();
    const double q = island.joints[0]->coordinate(0, island.states());
    constexpr double kNewton = 1e-11;  // rad: what the solver leaves of a gap
    EXPECT_NEAR(k * q, weight * std::cos(q), 1e-6 * weight + 10.0 * kNewton * k) << k;
    EXPECT_LT(island.group.frame(0).velocity().norm(), 1e-6);
  }
}

TEST(Joint, ScrewTurnsAsItAdvances) {
  Island island({.modes = 0}, kFrame, Vec3::Zero());
  const JointSpec spec{.type = JointType::kCylindrical, .pitch = 0.01};
  add_chain(island, 1, spec);
  island.group.apply_generalized_impulse(0, Vec3::Zero(), {0.3, 0.0, 0.0}, {});
  for (int i = 0; i < 600; ++i) island.step();
  const double angle = island.joints[0]->coordinate(0, island.states());
  EXPECT_GT(std::abs(angle), 4.0 * std::numbers::pi);
  EXPECT_NEAR(island.joints[0]->coordinate(1, island.states()), 0.01 * angle, 1e-9);
}

TEST(Joint, PartsOutOfPlaceComeTogetherWithoutEnergy) {
  Island island({.modes = 0}, kFrame, Vec3::Zero());
  island.add_body({});
  island.add_body({quaternion_from_rotation_vector({0.2, -0.1, 0.3}), {0.7, 0.1, -0.1}});
  island.join(island.frame(0, {.origin = kRightEnd}), island.frame(1, {.origin = kLeftEnd}),
              {.type = JointType::kFixed});
  for (int i = 0; i < 120; ++i) island.step();
  EXPECT_LT(island.joint_error(), 1e-9);
  EXPECT_LT(island.energy(), 1e-12);
}

TEST(Joint, RefusesWhatIsNotThere) {
  JointConstraint joint(MaterialFrame(JointFrame{}), MaterialFrame(0, JointFrame{}), hinge());
  EXPECT_THROW(joint.set_actuation(1, {}), InvalidArgument);
  EXPECT_THROW(joint.set_actuation(0, {.friction = -1.0}), InvalidArgument);
  JointSpec wrong = hinge();
  wrong.limits.rotation = {1.0, 0.0};
  EXPECT_THROW(JointConstraint(MaterialFrame(JointFrame{}), MaterialFrame(0, JointFrame{}), wrong), InvalidArgument);
}

}  // namespace
}  // namespace limber
