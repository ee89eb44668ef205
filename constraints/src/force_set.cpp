#include "force_set.h"

#include <cmath>

namespace limber {
namespace {

ProjectionDerivative derivative_inside(std::size_t first) {
  return {.first = first, .rows = 3, .columns = 3, .s = {Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ()}};
}

ProjectionDerivative derivative_on_cone(const Vec3& x, double mu, std::size_t first) {
  ProjectionDerivative P{.first = first, .rows = 3};
  const double across = std::hypot(x[1], x[2]);
  if (mu * across <= -x[0]) return P;
  if (mu > 0.0 && across <= mu * x[0]) return derivative_inside(first);  // sticks
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
  const double size = x.norm();
  if (size <= radius) return derivative_inside(first);
  ProjectionDerivative P{.first = first, .rows = 3, .columns = 2};
  P.s[0] = std::sqrt(radius / size) * x.unitOrthogonal();
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

void make_force_sets(std::span<const double> friction, std::span<const double> radius, std::span<const double> scale,
                     std::vector<ForceSet>& sets) {
  sets.clear();
  for (std::size_t i = 0; i < friction.size(); ++i)
    sets.push_back({.mu = friction[i], .radius = radius.empty() ? 0.0 : radius[i] * scale[3 * i]});
}

}  // namespace limber
