#include "limber/dynamics/motion_bounds.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace limber {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

double root_of_squares(double a, double b) { return std::sqrt(a * a + b * b); }

/// sup |ẏ| of ÿ + 2ξẏ + λy = 0 from ẏ(0) = v on, pull = λ y(0): by the energy, and because |ẏ| falls wherever
/// 2ξ|ẏ| > λ|y|. With λ = 0 and pull ≠ 0 that of ÿ + 2ξẏ = −pull, which has only the second.
double rate_bound(const Mode& mode, double pull, double v) {
  const auto [lambda, xi] = mode;
  const double force = root_of_squares(std::sqrt(lambda) * v, pull);  // ≥ λ|y| at all times
  double bound = lambda > 0.0 ? force / std::sqrt(lambda) : pull == 0.0 ? std::abs(v) : kInfinity;
  if (xi > 0.0) {
    const double most = xi * xi >= lambda ? std::min(force, std::abs(pull) + lambda * std::abs(v) / (2.0 * xi)) : force;
    bound = std::min(bound, std::max(std::abs(v), most / (2.0 * xi)));
  }
  return bound;
}

/// sup |y(t) − y(0)| up to t = s: |S v| + |H pull|, and by the energy.
double travel_bound(const Mode& mode, double pull, double v, double s) {
  const auto [lambda, xi] = mode;
  const double root = std::sqrt(lambda), glide = xi > 0.0 ? 0.5 / xi : kInfinity;
  const double most_S = std::min({s, glide, lambda > 0.0 ? 1.0 / root : kInfinity});
  const double most_H =
      std::min({0.5 * s * s, s * glide, lambda > 0.0 ? (xi >= root ? 1.0 : 2.0) / lambda : kInfinity});
  const double each = most_S * std::abs(v) + most_H * std::abs(pull);
  return lambda > 0.0 ? std::min(each, std::abs(pull) / lambda + root_of_squares(pull / lambda, v / root)) : each;
}

/// sup |v t + ½ a t²| up to t = s: at the end, or where the parabola turns back.
double parabola_bound(double v, double a, double s) {
  const double end = std::abs(s * (v + 0.5 * a * s));
  return v * a < 0.0 && std::abs(v) < std::abs(a) * s ? std::max(end, std::abs(0.5 * v * v / a)) : end;
}

}  // namespace

ModeBound bound_motion(const Mode& mode, const ModeState& start, double g, double duration) {
  const auto [lambda, xi] = mode;
  const auto [z, v] = start;
  const double s = duration;
  const double pull = lambda * z - g;  // λ times the distance from where the load would hold it
  // ż and z̈ obey the same equation, unloaded, from these initial values on.
  const double a = -pull - 2.0 * xi * v, jerk = -lambda * v - 2.0 * xi * a;
  const double most_jerk = rate_bound(mode, lambda * a, jerk);
  ModeBound b;
  b.acceleration = std::min(rate_bound(mode, lambda * v, a), std::abs(a) + s * most_jerk);
  b.rate = std::min({rate_bound(mode, pull, v), std::abs(v) + s * b.acceleration,
                     std::max(std::abs(v), std::abs(v + s * a)) + 0.5 * s * s * most_jerk});
  b.change = std::min({s * b.rate, s * (std::abs(v) + 0.5 * s * b.acceleration),
                       parabola_bound(v, a, s) + s * s * s / 6.0 * most_jerk, travel_bound(mode, pull, v, s)});
  b.size = std::abs(z) + b.change;
  if (lambda > 0.0)
    b.size = std::min(b.size, std::abs(g) / lambda + root_of_squares(pull / lambda, v / std::sqrt(lambda)));
  return b;
}

double point_speed(const MotionBounds& bounds, double distance, std::span<const double> shape) {
  double arm = distance, flexing = 0.0;
  for (std::size_t i = 0; i < bounds.modes.size(); ++i) {
    arm += shape[i] * bounds.modes[i].size;
    flexing += shape[i] * bounds.modes[i].rate;
  }
  return bounds.frame.speed + bounds.frame.angular_speed * arm + flexing;
}

double point_travel(const MotionBounds& bounds, double distance, std::span<const double> shape) {
  double arm = distance, flexing = 0.0;
  for (std::size_t i = 0; i < bounds.modes.size(); ++i) {
    arm += shape[i] * bounds.modes[i].size;
    flexing += shape[i] * bounds.modes[i].change;
  }
  return bounds.frame.travel + 2.0 * std::sin(0.5 * bounds.frame.turn) * arm + flexing;
}

}  // namespace limber
