/// @file limber/core/exact_math.h
/// Functions whose textbook form loses digits by cancellation, in a form that keeps them.
///
/// Relative error of each: a few ε (ε = 2⁻⁵²), apart from the neighbourhood of the zeros of sin, where it is the
/// rounding of the argument that shows (stumpff_c2 and sinc at large arguments). Below 1 a power series is used, cut
/// where the next term is under ε/4 of the sum; above, the closed form, which by then cancels three bits at most.
#pragma once

#include <cmath>

namespace limber {
namespace detail {

/// 1/First! + y/(First + Stride)! + y²/(First + 2 Stride)! + …, `Terms` terms by Horner's rule: the series of exp, cos
/// and sin without their first terms.
template <int First, int Stride, int Terms>
constexpr double factorial_series(double y) {
  double sum = 1.0;
  for (int n = Terms - 1; n > 0; --n) {
    double divisor = 1.0;
    for (int i = First + Stride * (n - 1) + 1; i <= First + Stride * n; ++i) divisor *= i;
    sum = 1.0 + sum * (y / divisor);
  }
  for (int i = 2; i <= First; ++i) sum /= i;
  return sum;
}

}  // namespace detail

/// sin(x)/x, any x; 1 at 0.
inline double sinc(double x) { return x == 0.0 ? 1.0 : std::sin(x) / x; }

/// (1 − e^{−x})/x, x ≥ 0; 1 at 0. The mean of e^{−s} for s in [0, x]: positive, falling.
inline double decay_mean(double x) { return x == 0.0 ? 1.0 : -std::expm1(-x) / x; }

/// (x − 1 + e^{−x})/x², x ≥ −1; ½ at 0. Positive, falling.
inline double decay_second(double x) {
  return x < 1.0 ? detail::factorial_series<2, 1, 17>(-x) : (1.0 - decay_mean(x)) / x;
}

/// (1 − (1 + x)e^{−x})/x², x ≥ 0; ½ at 0. Positive, falling.
inline double decay_ramp(double x) {
  return x < 1.0 ? std::exp(-x) * decay_second(-x) : (1.0 - (1.0 + x) * std::exp(-x)) / x / x;
}

/// Stumpff's c₂(y) = (1 − cos √y)/y, y ≥ −1; ½ at 0; (cosh √−y − 1)/−y below. Never negative.
inline double stumpff_c2(double y) {
  if (y < 1.0) return detail::factorial_series<2, 2, 9>(-y);
  const double s = std::sin(0.5 * std::sqrt(y));
  return 2.0 * s * s / y;  // 1 − cos would lose its digits near every multiple of 2π
}

/// Stumpff's c₃(y) = (√y − sin √y)/√y³, y ≥ −1; 1/6 at 0; (sinh √−y − √−y)/√−y³ below. Positive.
inline double stumpff_c3(double y) {
  return y < 1.0 ? detail::factorial_series<3, 2, 9>(-y) : (1.0 - sinc(std::sqrt(y))) / y;
}

}  // namespace limber
