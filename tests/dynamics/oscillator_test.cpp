#include "limber/dynamics/oscillator.h"

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <algorithm>
#include <array>
#include <boost/multiprecision/cpp_bin_float.hpp>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>

#include "limber/core/error.h"

namespace limber {
namespace {

// The reference: z̈ + 2ξż + λz = g as ẏ = A y for y = (√λ z, ż, g), by the exponential of A h in 50 digits: Taylor's
// series of A h/2ˢ, squared s times. It knows nothing of roots or regimes. Squaring loses at most 2ˢ ≤ 1e13 of 1e-50.
using Wide = boost::multiprecision::number<boost::multiprecision::cpp_bin_float<50>, boost::multiprecision::et_off>;
using Matrix = std::array<std::array<Wide, 3>, 3>;

Matrix product(const Matrix& a, const Matrix& b) {
  Matrix c{};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) c[i][j] = a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j];
  return c;
}

Matrix exponential(Matrix a) {
  Wide size = 0;
  for (const auto& row : a)
    for (const Wide& x : row) size = std::max(size, Wide(abs(x)));
  int squarings = 0;
  for (; size > Wide(0.01); size /= 2) ++squarings;
  Matrix term{}, sum{};
  for (int i = 0; i < 3; ++i) term[i][i] = sum[i][i] = 1;
  for (auto& row : a)
    for (Wide& x : row) x = ldexp(x, -squarings);
  for (int n = 1; n <= 24; ++n) {  // (3·0.01)²⁵/25! < 1e-60
    term = product(term, a);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) sum[i][j] += (term[i][j] /= n);
  }
  for (; squarings > 0; --squarings) sum = product(sum, sum);
  return sum;
}

/// The flow of (√λ z, ż) under a held force: columns z₀ = 1/√λ, ż₀ = 1, g = 1. With λ = 0 the first row and column are
/// z's.
Matrix reference_flow(const Mode& mode, double h) {
  const Wide lambda = mode.lambda, omega = sqrt(lambda), step = h;
  Matrix a{};
  a[0][1] = (mode.lambda > 0.0 ? omega : Wide(1)) * step;
  a[1][0] = -omega * step, a[1][1] = -2 * Wide(mode.decay) * step, a[1][2] = step;
  return exponential(a);
}

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

/// The claim of oscillator.h.
double accuracy(const Mode& mode, double h) { return 1e-12 + 4.0 * kEpsilon * std::sqrt(mode.lambda) * h; }

TEST(Oscillator, EqualsTheMatrixExponential) {
  const Mode mode{.lambda = 1e4, .decay = 50.0};
  const Matrix flow = reference_flow(mode, 0.01);
  const ModePropagator p = propagator(mode, 0.01);
  EXPECT_NEAR(p.z_z, double(flow[0][0]), accuracy(mode, 0.01));
  EXPECT_NEAR(p.zdot_zdot, double(flow[1][1]), accuracy(mode, 0.01));
  EXPECT_NEAR(100.0 * p.z_zdot, double(flow[0][1]), accuracy(mode, 0.01));
  EXPECT_NEAR(1e4 * p.z_g, double(100 * flow[0][2]), accuracy(mode, 0.01));
}

}  // namespace
}  // namespace limber
