// Tells if a box along the axes and a triangle have a point in common.
#pragma once

#include <array>

#include "limber/core/types.h"

namespace limber::internal {

/// Separating axes: the box's three, the triangle's normal, and the nine products of edges (Akenine-Möller, "Fast 3D
/// triangle-box overlap testing", Journal of Graphics Tools 6(1), 2001). Touching counts.
inline bool box_meets_triangle(const Vec3& centre, const Vec3& half, const std::array<Vec3, 3>& corners) {
  const std::array<Vec3, 3> v{corners[0] - centre, corners[1] - centre, corners[2] - centre};
  const auto apart = [&](const Vec3& axis) {
    const double p0 = axis.dot(v[0]), p1 = axis.dot(v[1]), p2 = axis.dot(v[2]);
    const double reach = half.dot(axis.cwiseAbs());
    return std::min({p0, p1, p2}) > reach || std::max({p0, p1, p2}) < -reach;
  };
  const std::array<Vec3, 3> edge{v[1] - v[0], v[2] - v[1], v[0] - v[2]};
  for (int k = 0; k < 3; ++k) {
    if (apart(Vec3::Unit(k))) return false;
    for (const Vec3& e : edge)
      if (apart(Vec3::Unit(k).cross(e))) return false;
  }
  return !apart(edge[0].cross(edge[1]));
}

}  // namespace limber::internal
