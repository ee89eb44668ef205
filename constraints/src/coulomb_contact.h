// One contact with Coulomb friction: its cone, and its exact solution while all other forces are held. Vectors are
// (normal, tangent, tangent).
#pragma once

#include "limber/core/types.h"

namespace limber {

/// The vector that begins at x.
inline Vec3 triple(const double* x) { return {x[0], x[1], x[2]}; }

/// The point of {|x_t| ≤ μ x_n} nearest to x.
inline Vec3 project_on_cone(const Vec3& x, double mu) {
  const double s = x.tail<2>().norm();
  if (s <= mu * x[0]) return x;
  if (mu * s <= -x[0]) return Vec3::Zero();
  const double n = (x[0] + mu * s) / (1.0 + mu * mu);
  return {n, mu * n * x[1] / s, mu * n * x[2] / s};
}

/// û = u + μ|u_t| e_n
inline Vec3 corrected_velocity(const Vec3& u, double mu) { return {u[0] + mu * u.tail<2>().norm(), u[1], u[2]}; }

/// The force f with K_μ ∋ f ⊥ û ∈ K*_μ for u = A f + b, A symmetric positive definite: exactly one of parting, sticking
/// and sliding, the last by the root of one function of the sliding coefficient.
Vec3 solve_coulomb_contact(const Mat3& A, const Vec3& b, double mu);

/// The tangential force of least ½fᵀA f + bᵀf in the disc |f| ≤ radius; A symmetric positive definite.
Eigen::Vector2d solve_in_disc(const Eigen::Matrix2d& A, const Eigen::Vector2d& b, double radius);

}  // namespace limber
