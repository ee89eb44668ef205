// What Newton's method with one Jacobian is made faster and safer by, and the form that finds its Jacobians by
// differences, against answers in closed form.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "limber/solvers/difference_newton.h"
#include "limber/solvers/secant_iteration.h"

namespace limber::internal {
namespace {

constexpr double kTolerance = 1e-10;

/// x_i + a sin(x_i + x_next) = i, by steps that take the Jacobian to be 1. @return iterations until 1e-10
int iterations(double a, bool with_secants) {
  std::vector<double> x(6, 0.0), step(6), residual(6);
  SecantIteration secants;
  secants.begin(x.size());
  for (int i = 1; i <= 200; ++i) {
    for (std::size_t k = 0; k < x.size(); ++k) {
      step[k] = static_cast<double>(k) - x[k] - a * std::sin(x[k] + x[(k + 1) % x.size()]);
      residual[k] = step[k] / kTolerance;
    }
    const bool done = std::ranges::all_of(residual, [](double r) { return std::abs(r) <= 1.0; });
    if (done) return i;
    if (with_secants)
      secants.advance(x, step, residual);
    else
      for (std::size_t k = 0; k < x.size(); ++k) x[k] += step[k];
  }
  return 201;
}

TEST(SecantIteration, StandsInForWhatTheJacobianMisses) {
  EXPECT_LE(3 * iterations(0.3, true), 2 * iterations(0.3, false));
  EXPECT_EQ(iterations(2.0, false), 201);  // the plain steps never settle
  EXPECT_LE(iterations(2.0, true), 100);
}

TEST(SecantIteration, KeepsTheBestOfWhatItHasSeen) {
  SecantIteration secants;
  secants.begin(1);
  std::vector<double> x{3.0};
  for (const double residual : {5.0, 0.5, 50.0}) {
    const double at = x[0];
    secants.advance(x, std::vector{1.0}, std::vector{residual});
    if (residual == 0.5) {
      EXPECT_EQ(secants.best_iterate()[0], at);
    }
  }
  EXPECT_EQ(secants.best(), 0.5);
}

/// w_i(f) = c_i (f_i³ + f_i) − b_i: at its bound or where w is zero.
TEST(DifferenceNewton, MeetsEachRowsInterval) {
  constexpr std::size_t n = 4;
  const std::vector<double> b{10.0, -10.0, 0.3, 1e3}, lower{-1e9, 0.0, 0.0, -1e9}, upper{1e9, 1e9, 1e9, 5.0};
  const std::vector<double> slope(n, 4.0), tolerance(n, 1e-10);
  std::vector<double> f(n, 0.0);
  DifferenceNewton newton;
  const double left = newton.solve(
      {.slope = slope, .tolerance = tolerance, .lower = lower, .upper = upper},
      [&](std::span<const double> at, std::span<double> w) {
        for (std::size_t i = 0; i < n; ++i) w[i] = at[i] * at[i] * at[i] + at[i] - b[i];
      },
      f);
  EXPECT_LE(left, 1.0);
  EXPECT_NEAR(f[0], 2.0, 1e-9);                       // 8 + 2 = 10
  EXPECT_EQ(f[1], 0.0);                               // w = 10 there
  EXPECT_NEAR(f[2] * f[2] * f[2] + f[2], 0.3, 1e-9);  // within its bounds
  EXPECT_EQ(f[3], 5.0);                               // w = 130 − 1000 there
}

}  // namespace
}  // namespace limber::internal
