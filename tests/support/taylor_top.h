// Reference for free and driven rotation: Taylor series of the equations of motion in long double, order 26.
#pragma once

#include <array>
#include <cmath>

#include "limber/core/quaternion.h"

namespace limber::testing {

using Real = long double;

/// A torque-free top in principal axes: attitude quaternion (w, x, y, z) and body angular momentum.
struct TaylorTop {
  std::array<Real, 3> moments;
  std::array<Real, 4> q;
  std::array<Real, 3> l;

  /// l' = l × I⁻¹l, q' = ½ q (0, I⁻¹l): both are bilinear, so their Taylor coefficients follow by Cauchy products.
  void step(Real h) {
    constexpr int kOrder = 26;
    std::array<std::array<Real, kOrder + 1>, 3> L{}, w{};
    std::array<std::array<Real, kOrder + 1>, 4> Q{};
    for (std::size_t i = 0; i < 3; ++i) L[i][0] = l[i];
    for (std::size_t i = 0; i < 4; ++i) Q[i][0] = q[i];
    for (std::size_t n = 0; n <= kOrder; ++n) {
      for (std::size_t i = 0; i < 3; ++i) w[i][n] = L[i][n] / moments[i];
      if (n == kOrder) break;
      const auto product = [n](const auto& a, const auto& b) {
        Real sum = 0;
        for (std::size_t j = 0; j <= n; ++j) sum += a[j] * b[n - j];
        return sum;
      };
      const Real k = static_cast<Real>(n + 1);
      L[0][n + 1] = (product(L[1], w[2]) - product(L[2], w[1])) / k;
      L[1][n + 1] = (product(L[2], w[0]) - product(L[0], w[2])) / k;
      L[2][n + 1] = (product(L[0], w[1]) - product(L[1], w[0])) / k;
      Q[0][n + 1] = (-product(Q[1], w[0]) - product(Q[2], w[1]) - product(Q[3], w[2])) / (2 * k);
      Q[1][n + 1] = (product(Q[0], w[0]) + product(Q[2], w[2]) - product(Q[3], w[1])) / (2 * k);
      Q[2][n + 1] = (product(Q[0], w[1]) + product(Q[3], w[0]) - product(Q[1], w[2])) / (2 * k);
      Q[3][n + 1] = (product(Q[0], w[2]) + product(Q[1], w[1]) - product(Q[2], w[0])) / (2 * k);
    }
    const auto sum = [h](const auto& a) {
      Real s = 0;
      for (std::size_t j = kOrder + 1; j-- > 0;) s = s * h + a[j];
      return s;
    };
    for (std::size_t i = 0; i < 3; ++i) l[i] = sum(L[i]);
    for (std::size_t i = 0; i < 4; ++i) q[i] = sum(Q[i]);
  }

  /// Steps of at most a radian: an eighth of the series' radius of convergence, so order 26 leaves round-off only.
  void advance(Real time) {
    Real rate = 0;
    for (std::size_t i = 0; i < 3; ++i) rate += std::abs(l[i]) / moments[0];
    const auto steps = static_cast<long>(std::ceil(std::abs(time) * rate)) + 1;
    for (long i = 0; i < steps; ++i) step(time / static_cast<Real>(steps));
  }

  Quaternion attitude() const {
    return {static_cast<double>(q[0]), static_cast<double>(q[1]), static_cast<double>(q[2]), static_cast<double>(q[3])};
  }
};

/// Angle between two attitudes, rad.
inline double angle_between(const Quaternion& a, const Quaternion& b) {
  const Quaternion d = a.conjugate() * b;
  return 2.0 * std::atan2(d.vector().norm(), std::abs(d.w));
}

}  // namespace limber::testing
