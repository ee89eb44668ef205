#include "force_set.h"

#include <cmath>

namespace limber {
namespace {

ProjectionDerivative derivative_on_cone(const Vec3& x, double mu, std::size_t first) {
  ProjectionDerivative P{.first = first, .rows = 3};
  const double across = std::hypot(x[1], x[2]);
  if (mu * across <= -x[0]) return P;
  if (mu > 0.0 && across <= mu * x[0]) {  // sticks
    P.columns = 3;
    for (int c = 0; c < 3; ++c) P.s[c] = Vec3::Unit(c);
    return P;
  }
  P.columns = 1, P.s[0] = Vec3::UnitX();
  if (mu == 0.0) return P;
  const double t0 = x[1] / across, t1 = x[2] / across;
  const double pressed = (x[0] + mu * across) / (1.0 + mu * mu);
  P.columns = 2;
  P.s[0] = Vec3(1.0, mu * t0, mu * t1) / std::sqrt(1.0 + mu * mu);
  P.s[1] = Vec3(0.0, -t1, t0) * std::sqrt(mu * pressed / across);
  return P;
}

ProjectionDerivative derivative_on_ball(const Vec3& x, double radius, std::size_t first) {
  ProjectionDerivative P{.first = first, .rows = 3};
  const double size = x.norm();
  if (size <= radius) {
    P.columns = 3;
    for (int c = 0; c < 3; ++c) P.s[c] = Vec3::Unit(c);
    return P;
  }
  P.columns = 2;
  const double root = std::sqrt(radius / size);
  P.s[0] = root * x.unitOrthogonal();
  P.s[1] = x.cross(P.s[0]) / size;
  return P;
}

}  // namespace

Vec3 ForceSet::project(const Vec3& x) const {
  if (radius == 0.0) return project_on_cone(x, mu);
  const double size = x.norm();
  return size > radius ? Vec3(radius / size * x) : x;
}

ProjectionDerivative ForceSet::derivative(const Vec3& x, std::size_t first) const {
  return radius > 0.0 ? derivative_on_ball(x, radius, first) : derivative_on_cone(x, mu, first);
}

Vec3 ForceSet::improve(const Mat3& A, const Vec3& force, const Vec3& velocity) const {
  return radius > 0.0 ? project(force - velocity / A.trace()) : solve_coulomb_contact(A, velocity - A * force, mu);
}

}  // namespace limber
