#include "limber/dynamics/free_rotation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "asked.h"
#include "constants.h"
#include "limber/core/error.h"
#include "taylor_top.h"

namespace limber {
namespace {

using testing::angle_between;
using testing::kEpsilon;
using testing::TaylorTop;

struct Top {
  std::string name;
  Vec3 moments;   // ascending
  Vec3 momentum;  // principal axes
};

// Every regime: both orbits of the asymmetric top, the separatrix from either side, symmetric and spherical bodies,
// nearly symmetric ones, steady turns about each axis and their neighbours.
const std::vector<Top> kTops = {
    {"about largest", {1, 2, 3}, {0.3, 0.4, 2}},
    {"about smallest", {1, 2, 3}, {2, 0.4, 0.3}},
    {"all negative", {1, 2, 3}, {-0.5, -0.6, -1}},
    {"separatrix, outer", {1, 2, 3}, {0.1, 1, 0.2}},
    {"separatrix, inner", {1, 2, 3}, {0.1, 1, 0.05}},
    {"no part along smallest", {1, 2, 3}, {0, 1, 0.1}},
    {"no part along largest", {1, 2, 3}, {0.1, 1, 0}},
    {"oblate", {1, 1, 2}, {0.3, 0.5, 0.7}},
    {"prolate", {1, 2, 2}, {0.3, 0.5, 0.7}},
    {"spherical", {2, 2, 2}, {0.3, 0.5, 0.7}},
    {"nearly oblate", {1, 1 + 1e-12, 2}, {0.3, 0.5, 0.7}},
    {"nearly prolate", {1, 2, 2 + 1e-9}, {0.3, 0.5, 0.7}},
    {"nearly prolate, in the plane", {1, 2, 2 + 1e-9}, {1e-5, 0.5, 0.7}},
    {"nearly spherical", {1, 1 + 1e-15, 1 + 3e-15}, {0.3, 0.5, 0.7}},
    {"oblate, in the plane", {1, 1, 2}, {0.5, 0.7, 0}},
    {"prolate, in the plane", {1, 2, 2}, {0, 0.5, 0.7}},
    {"steady, smallest", {1, 2, 3}, {1, 0, 0}},
    {"steady, largest", {1, 2, 3}, {0, 0, -1}},
    {"nearly steady", {1, 2, 3}, {1e-9, 1e-12, -1}},
    {"lamina", {1, 2, 3}, {0.7, -0.2, 0.9}},
};

PrincipalInertia body_of(const Top& top) { return {top.moments, quaternion_from_rotation_vector({0.1, 0.5, -0.3})}; }
const Quaternion kStart = normalized({0.5, -0.2, 0.7, 0.1});

Vec3 world_momentum(const Top& top) { return kStart * (body_of(top).q_BP * top.momentum); }

TaylorTop reference_of(const Top& top) {
  const Quaternion q_WP = kStart * body_of(top).q_BP;
  const Vec3 l = q_WP.conjugate() * world_momentum(top);
  return {{top.moments[0], top.moments[1], top.moments[2]}, {q_WP.w, q_WP.x, q_WP.y, q_WP.z}, {l[0], l[1], l[2]}};
}

// Largest turning rate, by which round-off in the momentum grows.
double rate_of(const Top& top) { return top.momentum.norm() / top.moments[0]; }

TEST(FreeRotation, AttitudeIsThatOfTheTaylorSeriesInEveryRegime) {
  for (const Top& top : kTops) {
    const PrincipalInertia body = body_of(top);
    const FreeRotation rotation(body, kStart, world_momentum(top));
    TaylorTop reference = reference_of(top);
    double elapsed = 0.0;
    for (const double t : {0.0, 1e-9, 0.01, 0.1, 1.0, 3.0, 10.0, 100.0, 1000.0}) {
      reference.advance(static_cast<testing::Real>(t) - elapsed);
      elapsed = t;
      const Quaternion expected = reference.attitude() * body.q_BP.conjugate();
      // A few ε to start with, then ε |ω| t; near the separatrix the equations amplify it by 1/√(1 − m).
      const double growth = 1.0 / std::sqrt(std::max(1.0 - rotation.parameter(), 1e-3));
      const double bound = kEpsilon * (8.0 + 4.0 * growth * rate_of(top) * t);
      EXPECT_LT(angle_between(rotation.attitude(t), expected), bound) << top.name << ", t = " << t;
    }
  }
}

TEST(FreeRotation, ThePastIsAsExactAsTheFuture) {
  for (const Top& top : kTops) {
    const PrincipalInertia body = body_of(top);
    const FreeRotation rotation(body, kStart, world_momentum(top));
    TaylorTop reference = reference_of(top);
    reference.advance(-7.0L);
    EXPECT_LT(angle_between(rotation.attitude(-7.0), reference.attitude() * body.q_BP.conjugate()),
              kEpsilon * (8.0 + 400.0 * rate_of(top)))
        << top.name;
  }
}

// A body that starts a hair off the intermediate axis turns over again and again; each passage by the axis multiplies
// the round-off in the start by the passage's own growth, so the bound is the change of the true solution under a
// change of any part of the start by 16 ε (what three products of rotations lose), taken from the reference itself.
TEST(FreeRotation, TumblingNextToTheUnstableAxisFollowsTheTaylorSeries) {
  for (const double off : {1e-2, 1e-4, 1e-6, 1e-9}) {
    const Top top{"unstable", {1, 2, 3}, {off, 1, 0.5 * off}};
    const PrincipalInertia body = body_of(top);
    const FreeRotation rotation(body, kStart, world_momentum(top));
    TaylorTop reference = reference_of(top);
    std::array<TaylorTop, 3> neighbours{reference, reference, reference};
    for (std::size_t i = 0; i < 3; ++i) neighbours[i].l[i] += 16 * kEpsilon;
    double elapsed = 0.0;
    for (const double t : {1.0, 10.0, 30.0, 100.0, 300.0}) {
      reference.advance(static_cast<testing::Real>(t) - elapsed);
      double conditioning = 0.0;
      for (TaylorTop& neighbour : neighbours) {
        neighbour.advance(static_cast<testing::Real>(t) - elapsed);
        conditioning = std::max(conditioning, angle_between(reference.attitude(), neighbour.attitude()));
      }
      elapsed = t;
      EXPECT_LT(angle_between(rotation.attitude(t), reference.attitude() * body.q_BP.conjugate()),
                kEpsilon * (16.0 + 8.0 * t) + conditioning)
          << off << ", t = " << t;
    }
  }
}

TEST(FreeRotation, ExactlySteadyTurnAboutTheUnstableAxisStaysSteady) {
  const PrincipalInertia body{{1, 2, 3}, {}};
  const FreeRotation rotation(body, {}, {0, 1, 0});
  const Quaternion expected = quaternion_from_rotation_vector({0, 0.5 * 1000.0, 0});
  EXPECT_LT(angle_between(rotation.attitude(1000.0), expected), 2000 * kEpsilon);
}

TEST(FreeRotation, NoMomentumNoTurn) {
  const FreeRotation rotation({{1, 2, 3}, {}}, kStart, Vec3::Zero());
  EXPECT_LT(angle_between(rotation.attitude(1e6), kStart), kEpsilon);
}

TEST(FreeRotation, ScalesOfMomentumAndTimeDoNotMatter) {
  // |L| t is all that counts: 1e-150 and 1e150 give the attitudes of 1, up to the rounding of t.
  const Top top = kTops[2];
  const PrincipalInertia body = body_of(top);
  const Quaternion expected = FreeRotation(body, kStart, world_momentum(top)).attitude(3.0);
  for (const double scale : {1e-150, 1e-20, 1e20, 1e150})
    EXPECT_LT(angle_between(FreeRotation(body, kStart, scale * world_momentum(top)).attitude(3.0 / scale), expected),
              32 * kEpsilon)
        << scale;
}

TEST(FreeRotation, HugeTurnsPerStepStayUnitAndFinite) {
  for (const Top& top : kTops) {
    const FreeRotation rotation(body_of(top), kStart, world_momentum(top));
    EXPECT_NEAR(rotation.attitude(1e12).norm(), 1.0, 4 * kEpsilon) << top.name;
    EXPECT_NEAR(rotation.attitude(1e300).norm(), 1.0, 4 * kEpsilon) << top.name;
  }
}

TEST(FreeRotation, MomentumThatOverflowedReturnsInsteadOfHanging) {
  const double infinity = std::numeric_limits<double>::infinity();
  for (const Vec3& L : {Vec3(infinity, 0, 1), Vec3(std::nan(""), 1, 1), Vec3(1e308, 1e308, 1e308)}) {
    const Quaternion q = FreeRotation({{1, 2, 3}, {}}, {}, L).attitude(1.0);
    EXPECT_FALSE(q.norm() < 0.9);  // not a number, or a unit quaternion
  }
}

/// Angular velocity in body axes from five attitudes around t alone: 2 q̄ q̇, q̇ by the central difference of fourth
/// order. Its error: (δ|ω|)⁴|ω| times some tenths, and round-off ε/δ.
Vec3 turning_rate(const FreeRotation& rotation, double t, double delta) {
  const Quaternion q = rotation.attitude(t);
  const auto turned = [&](double dt) { return Vec3((q.conjugate() * rotation.attitude(t + dt)).vector()); };
  return 2.0 * (8.0 * (turned(delta) - turned(-delta)) - (turned(2.0 * delta) - turned(-2.0 * delta))) / (12.0 * delta);
}

// Momentum is R I ω with ω from how the attitude changes: constant only if the attitude obeys Euler's equations.
TEST(FreeRotation, WhatTurnsKeepsItsMomentumForAMillionSteps) {
  constexpr double kStep = 1.0 / 60.0;
  for (const Top& top : kTops) {
    const PrincipalInertia body = body_of(top);
    const Vec3 L = world_momentum(top);
    const FreeRotation rotation(body, kStart, L);
    const double delta = 1e-3 / rate_of(top);
    const double bound = 1e-12 + 8.0 * kEpsilon / (delta * rate_of(top));
    double error = 0.0;
    for (long n = 0; n <= 1000000; n += 9973) {
      const double t = static_cast<double>(n) * kStep;
      const Quaternion q_WP = rotation.attitude(t) * body.q_BP;
      const Vec3 omega = body.q_BP.conjugate() * turning_rate(rotation, t, delta);
      error = std::max(error, (q_WP * body.moments.cwiseProduct(omega) - L).norm() / L.norm());
    }
    // Times are rounded to ε t, and a rate is read off their differences.
    const double rounded_times = 4.0 * kEpsilon * 1e6 * kStep / delta;
    EXPECT_LT(error, body.moments[2] / body.moments[0] * (bound + rounded_times)) << top.name;
  }
}

// 10⁶ steps: the energy is that of the attitude, E = ½ lᵀI⁻¹l with l = Rᵀ L, and its norm that of a rotation.
TEST(FreeRotation, AMillionStepsKeepEnergyAndAttitude) {
  constexpr long kSteps = testing::all_or_tenth(1000000L);
  constexpr double kStep = 1.0 / 60.0;
  for (const Top& top : {Top{"about largest", {1, 2, 3}, {0.3, 0.4, 2}}, Top{"unstable", {1, 2, 3}, {1e-3, 1, 1e-3}}}) {
    const PrincipalInertia body = body_of(top);
    const Vec3 L = world_momentum(top);
    const FreeRotation rotation(body, kStart, L);
    const auto body_momentum = [&](double t) { return (rotation.attitude(t) * body.q_BP).conjugate() * L; };
    const auto energy = [&](const Vec3& l) { return 0.5 * l.dot(l.cwiseQuotient(body.moments)); };
    const double start_energy = energy(body_momentum(0.0));
    double energy_error = 0.0;
    for (long n = 1; n <= kSteps; ++n) {
      const Vec3 l = body_momentum(static_cast<double>(n) * kStep);
      energy_error = std::max(energy_error, std::abs(energy(l) / start_energy - 1.0));
    }
    EXPECT_LT(energy_error, 32 * kEpsilon) << top.name;

    TaylorTop reference = reference_of(top);
    const double end = static_cast<double>(kSteps) * kStep;
    reference.advance(end);
    const double error = angle_between(rotation.attitude(end), reference.attitude() * body.q_BP.conjugate());
    // ε |ω| t is 4e-12 here; near the unstable axis the same times 1/√(1 − m) ≈ 500.
    const double growth = 1.0 / std::sqrt(1.0 - rotation.parameter());
    EXPECT_LT(error, 4 * kEpsilon * growth * rate_of(top) * end) << top.name;
  }
}

TEST(PrincipalInertia, RebuildsTheTensor) {
  Mat3 inertia;
  inertia << 3.0, 0.2, -0.1, 0.2, 2.0, 0.3, -0.1, 0.3, 2.5;
  const PrincipalInertia principal = principal_inertia(inertia);
  const Mat3 axes = to_matrix(principal.q_BP);
  EXPECT_LT((axes * principal.moments.asDiagonal() * axes.transpose() - inertia).norm(),
            32 * kEpsilon * inertia.norm());
  EXPECT_LE(principal.moments[0], principal.moments[1]);
  EXPECT_LE(principal.moments[1], principal.moments[2]);
}

TEST(PrincipalInertia, RefusesWhatIsNoInertia) {
  EXPECT_THROW(principal_inertia(Vec3(1, -1, 2).asDiagonal()), InvalidArgument);
  EXPECT_THROW(principal_inertia(Mat3::Constant(std::nan(""))), InvalidArgument);
}

// Libraries that sum three numbers in pairs start where an address is a multiple of 16.
TEST(FreeRotation, DoesNotDependOnWhereTheMomentumLies) {
  struct {
    alignas(16) Vec3 even;
    Vec3 odd;
  } momentum{{0.3, 1.7, -0.9}, {0.3, 1.7, -0.9}};
  const PrincipalInertia body = principal_inertia(Vec3(0.3, 0.7, 0.9).asDiagonal());
  for (int i = 0; i < 100; ++i) {
    momentum.even *= 1.01 + 0.001 * i;
    momentum.odd = momentum.even;
    const Quaternion a = FreeRotation(body, {}, momentum.even).attitude(1.0);
    const Quaternion b = FreeRotation(body, {}, momentum.odd).attitude(1.0);
    EXPECT_EQ(a.w, b.w);
    EXPECT_EQ(a.vector(), b.vector());
  }
}

}  // namespace
}  // namespace limber
