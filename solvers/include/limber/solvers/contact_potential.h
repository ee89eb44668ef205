// What one contact adds to the convex problem of an island (convex_contact_solver.h): a spring of compliance c whose
// impulse stays in a set K.
//
//   l(u) = max over F ∈ K of  −u·F − ½ c |F|²,      F = P_K(−u/c) = −∇l,      ∂F/∂u = −P_K'/c = −∇²l
//
// K is Coulomb's cone |F_t| ≤ μ F_n (rows: normal, two tangents), a ball |F| ≤ r, or an interval. The projection onto
// the cone is that of SAP (Castro, Permenter and Han, IEEE T-RO 39 (2023) 1301) with one compliance for all axes.
#pragma once

#include <algorithm>
#include <cmath>

#include "limber/core/types.h"

namespace limber::internal {

struct ContactPotential {
  enum class Set { kCone, kBall, kInterval };
  Set set = Set::kCone;
  double compliance = 0.0;          ///< c, gap per impulse, > 0
  double bound = 0.0;               ///< μ of the cone, r of the ball, N·s
  double lower = 0.0, upper = 0.0;  ///< of the interval

  struct Value {
    double potential = 0.0;
    Vec3 impulse = Vec3::Zero();    ///< F
    Mat3 stiffness = Mat3::Zero();  ///< ∇²l, positive semidefinite
    bool acts = false;              ///< whether F or ∇²l is not zero
  };
  /// An interval reads and writes the first number alone.
  Value at(const Vec3& u) const {
    switch (set) {
      case Set::kCone:
        return cone(-u / compliance);
      case Set::kBall:
        return ball(-u / compliance);
      case Set::kInterval:
        break;
    }
    return interval(-u[0] / compliance);
  }

  /// The impulse of the set that is nearest.
  Vec3 nearest(const Vec3& impulse) const { return at(-compliance * impulse).impulse; }
  /// P_K(F − u/c), the natural map: F itself where it is what the set exerts at the gap u.
  Vec3 natural(const Vec3& u, const Vec3& impulse) const { return at(u - compliance * impulse).impulse; }
  /// Of l(u + t d) at t = 0: its first and second derivatives.
  struct Slope {
    double first = 0.0, second = 0.0;
  };
  Slope along(const Vec3& u, const Vec3& d) const {
    if (set != Set::kCone) {
      const Value v = at(u);
      return {-v.impulse.dot(d), d.dot(v.stiffness * d)};
    }
    const double c = 1.0 / compliance, mu = bound, x = -c * u[0], y = -c * u[1], z = -c * u[2];
    const double across = std::sqrt(y * y + z * z);
    if (across <= mu * x) return {-(x * d[0] + y * d[1] + z * d[2]), c * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2])};
    if (mu * across <= -x) return {};
    const double scale = 1.0 / (1.0 + mu * mu), pressed = scale * (x + mu * across);
    const double out = (y * d[1] + z * d[2]) / across, round = (y * d[2] - z * d[1]) / across, edge = d[0] + mu * out;
    return {-pressed * edge, c * (scale * edge * edge + mu * pressed / across * round * round)};
  }

 private:
  Value cone(const Vec3& x) const {
    const double mu = bound, along = x[0], across = std::sqrt(x[1] * x[1] + x[2] * x[2]);
    if (across <= mu * along) return inside(x, 3);
    if (mu * across <= -along) return {};
    const double scale = 1.0 / (1.0 + mu * mu), pressed = scale * (along + mu * across);
    const Vec3 tangent = Vec3(0.0, x[1], x[2]) / across, edge = Vec3::UnitX() + mu * tangent;
    Value v{.potential = 0.5 * compliance * pressed * pressed / scale, .impulse = pressed * edge, .acts = true};
    // Along the edge of the cone the spring yields; round it the impulse turns with the slip.
    Mat3 turning = Mat3::Identity() - tangent * tangent.transpose();
    turning(0, 0) = 0.0;
    v.stiffness = (scale * edge * edge.transpose() + mu * pressed / across * turning) / compliance;
    return v;
  }
  Value ball(const Vec3& x) const {
    const double size = x.norm();
    if (size <= bound) return inside(x, 3);
    const Vec3 direction = x / size;
    return {.potential = compliance * bound * (size - 0.5 * bound),
            .impulse = bound * direction,
            .stiffness = bound / size / compliance * (Mat3::Identity() - direction * direction.transpose()),
            .acts = bound > 0.0};
  }
  Value interval(double x) const {
    const double F = std::clamp(x, lower, upper);
    Value v{.potential = compliance * (x * F - 0.5 * F * F), .impulse = {F, 0.0, 0.0}, .acts = F != 0.0 || F == x};
    if (F == x) v.stiffness(0, 0) = 1.0 / compliance;
    return v;
  }
  Value inside(const Vec3& x, int rows) const {
    Value v{.potential = 0.5 * compliance * x.squaredNorm(), .impulse = x, .acts = true};
    v.stiffness.diagonal().head(rows).setConstant(1.0 / compliance);
    return v;
  }
};

}  // namespace limber::internal
