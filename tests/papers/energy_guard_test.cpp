// The guard on the linear program's energy against worked examples and a scan of the blend.
#include "limber/hauser/energy_guard.h"

#include <gmock/gmock.h>

#include <array>
#include <cmath>
#include <limits>
#include <random>

#include "constants.h"
#include "limber/core/error.h"

namespace limber {
namespace {

using testing::kFewRoundings;

TEST(EnergyGuard, TwoUnequalContactsAreBroughtToZeroWork) {
  // Pushing at the light contact is cheap for the program, f = (0, 1/9), and adds 50/81 J; f = (1, 0) loses ½ J.
  const std::array<double, 4> A = {1, 9, 9, 100};
  const std::array<double, 2> b = {-1, 0}, program = {0, 1.0 / 9.0}, complementary = {1, 0};
  std::array<double, 2> f{};
  const auto result = guard_energy(ImpulseWork{.A = A, .b = b}, program, complementary, f);
  EXPECT_NEAR(result.energy_program, 50.0 / 81.0, kFewRoundings);
  EXPECT_NEAR(result.energy_complementary, -0.5, kFewRoundings);
  // Along f₀ + s d d = (−1, 1/9): φ₁ = d·(b + A f₀) = 1, φ₂ = ½ dᵀA d = ½(1 − 2 +
  // 100/81)
  const double phi2 = 0.5 * (100.0 / 81.0 - 1.0);
  EXPECT_NEAR(result.blend, (std::sqrt(1.0 + 2.0 * phi2) - 1.0) / (2.0 * phi2), kFewRoundings);
  EXPECT_NEAR(result.energy, 0.0, kFewRoundings);
  EXPECT_NEAR(f[0], 1.0 - result.blend, kFewRoundings);
  EXPECT_NEAR(f[1], result.blend / 9.0, kFewRoundings);
}

TEST(EnergyGuard, BlendIsTheLargestSafeOneOfAScan) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> number(-1.0, 1.0);
  constexpr int kSteps = 20'000;
  for (int n = 0; n < 300; ++n) {
    const double phi0 = -std::abs(number(random)), phi1 = 3.0 * number(random), phi2 = 3.0 * number(random);
    double largest = 0.0;
    for (int i = 0; i <= kSteps; ++i) {
      const double s = static_cast<double>(i) / kSteps;
      if (phi0 + s * (phi1 + s * phi2) <= 0.0) largest = s;
    }
    EXPECT_NEAR(largest_safe_blend(phi0, phi1, phi2), largest, 1.01 / kSteps) << phi0 << " " << phi1 << " " << phi2;
  }
}

TEST(EnergyGuard, WhereNoBlendIsSafeTheLeastWorkIsTaken) {
  EXPECT_DOUBLE_EQ(largest_safe_blend(1.0, -1.0, 1.0), 0.5);
  EXPECT_DOUBLE_EQ(largest_safe_blend(1.0, 1.0, 1.0), 0.0);
  EXPECT_DOUBLE_EQ(largest_safe_blend(1.0, -0.5, -0.1), 1.0);
}

TEST(EnergyGuard, GapLevelCountsTheWorkOverTheStep) {
  // A mass of 2 kg falls at 3 m/s with its gap 0.01 m open at the start, Δt = 0.01 s, and a force is held over
  // the step: A = ½Δt/m, b = g₀ − 3Δt. The energy of the free mass is known: ½ m ((v + f/m)² − v²).
  const double m = 2.0, v = -3.0, h = 0.01, g0 = 0.01;
  const std::array<double, 1> A = {0.5 * h / m}, b = {g0 + v * h}, gap = {g0};
  const std::array<double, 1> program = {13.0}, complementary = {-b[0] / A[0]};
  std::array<double, 1> f{};
  const auto result =
      guard_energy(ImpulseWork{.A = A, .b = b, .gap_before = gap, .step = h}, program, complementary, f);
  const auto gained = [&](double impulse) { return 0.5 * m * (std::pow(v + impulse / m, 2) - v * v); };
  EXPECT_NEAR(result.energy_program, gained(program[0]), kFewRoundings * 13.0 * 13.0);
  EXPECT_NEAR(result.energy_complementary, gained(complementary[0]), kFewRoundings * 13.0 * 13.0);
  EXPECT_NEAR(gained(f[0]), 0.0, kFewRoundings * 13.0 * 13.0);
}

TEST(EnergyGuard, ReportCountsWhatWasClamped) {
  EnergyGuardReport report;
  report.add({.blend = 1.0, .energy_program = -1.0, .energy_complementary = -2.0, .energy = -1.0});
  report.add({.blend = 0.25, .energy_program = 3.0, .energy_complementary = -2.0, .energy = 0.0});
  EXPECT_EQ(report.solves, 2);
  EXPECT_EQ(report.clamped, 1);
  EXPECT_EQ(report.complementary, 0);
  EXPECT_DOUBLE_EQ(report.blend_sum, 1.25);
  EXPECT_DOUBLE_EQ(report.energy_refused, 3.0);
}

TEST(EnergyGuard, LengthsThatDoNotFitAreRefused) {
  const std::array<double, 3> A{};
  const std::array<double, 2> b{}, f0{}, f1{};
  std::array<double, 2> f{};
  EXPECT_THROW(guard_energy(ImpulseWork{.A = A, .b = b}, f0, f1, f), InvalidArgument);
}

}  // namespace
}  // namespace limber
