// What Newton's method with one Jacobian is made faster and safer by, against answers in closed form.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

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

}  // namespace
}  // namespace limber::internal
