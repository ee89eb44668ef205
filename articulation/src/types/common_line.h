/// @file common_line.h
/// The line about which surfaces of two parts turn into themselves: the axis of a bearing, drawn or not. Private to the
/// articulation module.
#pragma once

#include <optional>
#include <vector>

#include "limber/mesh/surface_mesh.h"

namespace limber::internal {

/// Where a surface bends a little, as facets of a round one do, and which way it looks there. Of a surface that turns
/// into itself about a line all these normals meet that line: the mean of two alike facets does so exactly.
struct Bend {
  Vec3 point, normal;
  double weight = 0.0;  ///< the angle times the area of the two triangles
};

/// @param crease_angle rad; sharper edges are no bends
std::vector<Bend> bends_of(const SurfaceMesh& surface, double crease_angle);

/// A point of the line along `direction` about which the largest area of both parts turns into itself, the smaller of
/// the two counting; none if that is too little of a turn to tell the line. What lies within `radius` of `middle`
/// counts.
std::optional<Vec3> common_line(const std::vector<Bend>& a, const std::vector<Bend>& b, const Vec3& direction,
                                const Vec3& middle, double radius);

}  // namespace limber::internal
