#include "limber/dynamics/motion_bounds.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace limber {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A mode's constants, as the bounds need them; 1/0 is infinity.
struct Constants {
  explicit Constants(const Mode& mode)
      : lambda(mode.lambda),
        xi(mode.decay),
        root(std::sqrt(lambda)),
        period(lambda > 0.0 ? 1.0 / root : kInfinity),
        glide(xi > 0.0 ? 0.5 / xi : kInfinity),
        creeps(xi > 0.0 && xi >= root) {}
  double lambda, xi;
  double root, period;  // √λ, 1/√λ
  double glide;         // 1/2ξ
  bool creeps;          // ξ² ≥ λ
};

/// F = √(λv² + pull²) ≥ λ|y| at all times of ÿ + 2ξẏ + λy = 0 from ẏ(0) = v, λ y(0) = pull on.
double elastic_bound(const Constants& c, double pull, double v) { return std::sqrt(c.lambda * v * v + pull * pull); }

/// sup |ẏ| of the same: by the energy, and because |ẏ| falls wherever 2ξ|ẏ| > λ|y|. With λ = 0 and pull ≠ 0 that of
/// ÿ + 2ξẏ = −pull, which has only the second.
double rate_bound(const Constants& c, double pull, double v, double elastic) {
  double bound = c.lambda > 0.0 ? elastic * c.period : pull == 0.0 ? std::abs(v) : kInfinity;
  if (c.xi > 0.0) {
    const double most = c.creeps ? std::min(elastic, std::abs(pull) + c.lambda * std::abs(v) * c.glide) : elastic;
    bound = std::min(bound, std::max(std::abs(v), most * c.glide));
  }
  return bound;
}

/// sup |y(t) − y(0)| up to t = s: |S v| + |H pull|, and by the energy.
double travel_bound(const Constants& c, double pull, double v, double elastic, double s) {
  const double most_S = std::min({s, c.glide, c.period});
  const double most_H = std::min({0.5 * s * s, s * c.glide, (c.creeps ? 1.0 : 2.0) * c.period * c.period});
  const double each = most_S * std::abs(v) + most_H * std::abs(pull);
  return c.lambda > 0.0 ? std::min(each, (std::abs(pull) + elastic) * c.period * c.period) : each;
}

/// sup |v t + ½ a t²| up to t = s: at the end, or where the parabola turns back.
double parabola_bound(double v, double a, double s) {
  const double end = std::abs(s * (v + 0.5 * a * s));
  return v * a < 0.0 && std::abs(v) < std::abs(a) * s ? std::max(end, std::abs(0.5 * v * v / a)) : end;
}

}  // namespace

double largest_change(const Mode& mode, const ModeState& start, double g, double duration) {
  const Constants c(mode);
  const auto [z, v] = start;
  const double s = duration;
  const double pull = c.lambda * z - g;  // λ times the distance from where the load would hold it
  // ż and z̈ obey the same equation, unloaded, from these initial values on.
  const double a = -pull - 2.0 * c.xi * v, jerk = -c.lambda * v - 2.0 * c.xi * a;
  const double elastic = elastic_bound(c, pull, v);
  const double most_jerk = rate_bound(c, c.lambda * a, jerk, elastic_bound(c, c.lambda * a, jerk));
  const double acceleration =
      std::min(rate_bound(c, c.lambda * v, a, elastic_bound(c, c.lambda * v, a)), std::abs(a) + s * most_jerk);
  const double rate = std::min({rate_bound(c, pull, v, elastic), std::abs(v) + s * acceleration,
                                std::max(std::abs(v), std::abs(v + s * a)) + 0.5 * s * s * most_jerk});
  return std::min({s * rate, s * (std::abs(v) + 0.5 * s * acceleration),
                   parabola_bound(v, a, s) + s * s * s / 6.0 * most_jerk, travel_bound(c, pull, v, elastic, s)});
}

}  // namespace limber
