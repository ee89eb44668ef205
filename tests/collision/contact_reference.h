// Distances and insides told the long way, to compare the narrow phase with.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>
#include <vector>

#include "limber/core/types.h"

namespace limber::testing {

/// The nearest points of two hulls.
struct HullDistance {
  Vec3 a = Vec3::Zero(), b = Vec3::Zero();
  double distance = std::numeric_limits<double>::infinity();
};

namespace detail {

using Real = long double;
using RealVec3 = Eigen::Matrix<Real, 3, 1>;

// All ways to choose one to three of `count` points.
inline std::vector<std::vector<std::size_t>> choices(std::size_t count) {
  std::vector<std::vector<std::size_t>> all;
  for (std::size_t i = 0; i < count; ++i) {
    all.push_back({i});
    for (std::size_t j = i + 1; j < count; ++j) {
      all.push_back({i, j});
      for (std::size_t k = j + 1; k < count; ++k) all.push_back({i, j, k});
    }
  }
  return all;
}

// Least |Σ α_i a_i − Σ β_j b_j| over weights of sum 1, in long double; only where all weights are positive.
inline void try_active_set(std::span<const Vec3> a, const std::vector<std::size_t>& of_a, std::span<const Vec3> b,
                           const std::vector<std::size_t>& of_b, HullDistance& best) {
  const RealVec3 a0 = a[of_a[0]].cast<Real>(), b0 = b[of_b[0]].cast<Real>();
  const Eigen::Index na = static_cast<Eigen::Index>(of_a.size()) - 1, nb = static_cast<Eigen::Index>(of_b.size()) - 1;
  Eigen::Matrix<Real, 3, Eigen::Dynamic, 0, 3, 4> D(3, na + nb);
  for (Eigen::Index i = 0; i < na; ++i) D.col(i) = a[of_a[static_cast<std::size_t>(i + 1)]].cast<Real>() - a0;
  for (Eigen::Index j = 0; j < nb; ++j) D.col(na + j) = b0 - b[of_b[static_cast<std::size_t>(j + 1)]].cast<Real>();
  RealVec3 p = a0, q = b0;
  if (na + nb > 0) {
    Eigen::Matrix<Real, Eigen::Dynamic, 1, 0, 4, 1> x = D.completeOrthogonalDecomposition().solve(b0 - a0);
    Real sum_a = 0, sum_b = 0;
    for (Eigen::Index i = 0; i < na; ++i) sum_a += x[i];
    for (Eigen::Index j = 0; j < nb; ++j) sum_b += x[na + j];
    if (x.minCoeff() < 0 || sum_a > 1 || sum_b > 1) return;
    for (Eigen::Index i = 0; i < na; ++i) p += x[i] * D.col(i);
    for (Eigen::Index j = 0; j < nb; ++j) q -= x[na + j] * D.col(na + j);
  }
  const auto d = static_cast<double>((p - q).norm());
  if (d < best.distance) best = {p.cast<double>(), q.cast<double>(), d};
}

}  // namespace detail

/// Least |Σ α_i a_i − Σ β_j b_j| over barycentric weights, by trying every active set of up to three points of each.
inline HullDistance hull_distance(std::span<const Vec3> a, std::span<const Vec3> b) {
  HullDistance best;
  for (const auto& of_a : detail::choices(a.size()))
    for (const auto& of_b : detail::choices(b.size())) detail::try_active_set(a, of_a, b, of_b, best);
  return best;
}

/// A surface as plain arrays, in the world.
struct PlainSurface {
  std::vector<Vec3> vertices;
  std::vector<Triangle> triangles;

  std::array<Vec3, 3> corners(std::size_t t) const {
    const Triangle& v = triangles[t];
    return {vertices[static_cast<std::size_t>(v[0])], vertices[static_cast<std::size_t>(v[1])],
            vertices[static_cast<std::size_t>(v[2])]};
  }
};

/// How often the surface goes around a point: 1 inside a closed one, 0 outside (the triangles' solid angles; van
/// Oosterom and Strackee 1983).
inline double winding_number(const PlainSurface& s, const Vec3& p) {
  double angle = 0.0;
  for (std::size_t t = 0; t < s.triangles.size(); ++t) {
    const auto x = s.corners(t);
    const Vec3 a = x[0] - p, b = x[1] - p, c = x[2] - p;
    const double na = a.norm(), nb = b.norm(), nc = c.norm();
    angle += 2.0 * std::atan2(a.dot(b.cross(c)), na * nb * nc + a.dot(b) * nc + b.dot(c) * na + c.dot(a) * nb);
  }
  return angle / (4.0 * std::numbers::pi);
}

}  // namespace limber::testing
