#include "limber/core/exact_math.h"

#include <gtest/gtest.h>

#include <boost/multiprecision/cpp_bin_float.hpp>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

namespace limber {
namespace {

// The textbook forms, in 100 digits: from 1e-15 on, what they cancel leaves fifty.
using Wide = boost::multiprecision::number<boost::multiprecision::cpp_bin_float<100>, boost::multiprecision::et_off>;

/// The accuracy that exact_math.h promises, relative.
constexpr double kFewUlps = 8.0 * std::numeric_limits<double>::epsilon();

void expect_equal(const std::function<double(double)>& function, const std::function<Wide(Wide)>& textbook,
                  const std::vector<double>& arguments) {
  for (const double x : arguments) {
    const Wide exact = textbook(Wide(x));
    EXPECT_LE(static_cast<double>(abs((function(x) - exact) / exact)), kFewUlps) << "at " << x;
  }
}

/// ±: from nearly 0 to 1 and just across, where the forms change.
const std::vector<double> kSmall{1e-15, 1e-8, 1e-4, 0.01, 0.3, 0.7, 0.999, 1.0};
const std::vector<double> kLarge{1.001, 1.5, 3.0, 9.0, 30.0, 100.0, 1e4, 1e12};

std::vector<double> arguments(bool negative) {
  std::vector<double> all = kSmall;
  all.insert(all.end(), kLarge.begin(), kLarge.end());
  if (negative)
    for (const double x : kSmall) all.push_back(-x);
  return all;
}

TEST(ExactMath, DecayFunctionsKeepAllDigits) {
  expect_equal(
      decay_mean, [](const Wide& x) -> Wide { return (1 - exp(-x)) / x; }, arguments(false));
  expect_equal(
      decay_second, [](const Wide& x) -> Wide { return (x - 1 + exp(-x)) / (x * x); }, arguments(true));
  expect_equal(
      decay_ramp, [](const Wide& x) -> Wide { return (1 - (1 + x) * exp(-x)) / (x * x); }, arguments(false));
  EXPECT_EQ(decay_mean(0.0), 1.0);
  EXPECT_EQ(decay_second(0.0), 0.5);
  EXPECT_EQ(decay_ramp(0.0), 0.5);
}

TEST(ExactMath, StumpffFunctionsKeepAllDigits) {
  expect_equal(
      stumpff_c2, [](const Wide& y) -> Wide { return y > 0 ? (1 - cos(sqrt(y))) / y : (1 - cosh(sqrt(-y))) / y; },
      arguments(true));
  expect_equal(
      stumpff_c3,
      [](const Wide& y) -> Wide {
        const Wide r = sqrt(abs(y));
        return y > 0 ? (r - sin(r)) / (r * y) : (r - sinh(r)) / (r * y);
      },
      arguments(true));
  EXPECT_EQ(stumpff_c2(0.0), 0.5);
  EXPECT_EQ(stumpff_c3(0.0), 1.0 / 6.0);
}

TEST(ExactMath, SincIsOneAtZeroAndKeepsAllDigits) {
  expect_equal(
      sinc, [](const Wide& x) -> Wide { return sin(x) / x; }, arguments(true));
  EXPECT_EQ(sinc(0.0), 1.0);
}

}  // namespace
}  // namespace limber
