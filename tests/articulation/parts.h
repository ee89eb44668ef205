// Parts that assemblies are made of, with known axes: cylinders, tubes, and how they are placed.
#pragma once

#include <cmath>
#include <numbers>

#include "limber/core/quaternion.h"
#include "limber/core/rigid_transform.h"
#include "shapes.h"

namespace limber::parts {

/// Two unit vectors across an axis.
inline std::pair<Vec3, Vec3> across(const Vec3& axis) {
  const Vec3 u = axis.unitOrthogonal();
  return {u, axis.cross(u)};
}

/// A closed surface of revolution about an axis: a ring of (radius, height) points, counter-clockwise seen with the
/// axis up and the radius to the right, joined end to start. Points of radius 0 become one vertex.
inline SurfaceMesh revolved(const Vec3& centre, const Vec3& axis, const std::vector<std::pair<double, double>>& profile,
                            int segments) {
  SurfaceMesh s;
  const auto [u, v] = across(axis);
  std::vector<Index> first;
  for (const auto& [radius, height] : profile) {
    first.push_back(static_cast<Index>(s.vertices.size()));
    for (int i = 0; i < (radius > 0.0 ? segments : 1); ++i) {
      const double angle = 2.0 * std::numbers::pi * i / segments;
      s.vertices.push_back(centre + height * axis + radius * (std::cos(angle) * u + std::sin(angle) * v));
    }
  }
  const auto vertex = [&](std::size_t ring, int i) {
    return profile[ring].first > 0.0 ? first[ring] + i % segments : first[ring];
  };
  for (std::size_t r = 0; r < profile.size(); ++r) {
    const std::size_t next = (r + 1) % profile.size();
    for (int i = 0; i < segments; ++i) {
      const Index a = vertex(r, i), b = vertex(r, i + 1), c = vertex(next, i + 1), d = vertex(next, i);
      if (a != b) s.triangles.push_back({a, b, c});
      if (c != d) s.triangles.push_back({a, c, d});
    }
  }
  return s;
}

/// A solid cylinder; vertices lie on the radius.
inline SurfaceMesh cylinder(const Vec3& centre, const Vec3& axis, double radius, double length, int segments) {
  const double h = length / 2.0;
  return revolved(centre, axis, {{0.0, -h}, {radius, -h}, {radius, h}, {0.0, h}}, segments);
}

/// A cylinder with a round hole along it.
inline SurfaceMesh tube(const Vec3& centre, const Vec3& axis, double inner, double outer, double length, int segments) {
  const double h = length / 2.0;
  return revolved(centre, axis, {{inner, -h}, {outer, -h}, {outer, h}, {inner, h}}, segments);
}

/// Scales, turns by a rotation vector, then moves.
struct Placement {
  RigidTransform X;
  double scale = 1.0;
  Vec3 operator()(const Vec3& p) const { return X * Vec3(scale * p); }
  Vec3 direction(const Vec3& d) const { return X.q * d; }
  SurfaceMesh operator()(SurfaceMesh s) const {
    for (Vec3& p : s.vertices) p = (*this)(p);
    return s;
  }
};
inline Placement placed(const Vec3& position, const Vec3& rotation, double scale) {
  return {{quaternion_from_rotation_vector(rotation), position}, scale};
}

}  // namespace limber::parts
