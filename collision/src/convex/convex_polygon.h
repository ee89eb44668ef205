// Convex polygons in a plane: hulls, areas, and the largest polygon on few corners of a hull.
#pragma once

#include <vector>

#include "limber/core/types.h"

namespace limber::internal {

struct PlanePoint {
  double x = 0.0, y = 0.0;
  Index item = -1;  ///< what stands there
};

/// Twice the signed area of triangle abc, positive counter-clockwise.
inline double doubled_area(const PlanePoint& a, const PlanePoint& b, const PlanePoint& c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

/// Corners of the convex hull, counter-clockwise from the lowest x; points on its sides are none. Equal points give the
/// one of the lowest item. Reorders `points`.
void convex_hull(std::vector<PlanePoint>& points, std::vector<PlanePoint>& hull);

/// Of a convex polygon, counter-clockwise.
double area(const std::vector<PlanePoint>& polygon);
/// The largest distance of two corners.
double diameter(const std::vector<PlanePoint>& polygon);

/// The corners that span the largest area with at most `count`, in the hull's order. Exact for count ≤ 4 and up to
/// kMostCorners corners; beyond, corners are first thinned to those farthest in kMostCorners directions, and a fifth
/// and further ones are added one by one. O(corners²). @param hull is thinned
void largest_polygon(std::vector<PlanePoint>& hull, int count, std::vector<PlanePoint>& polygon);
inline constexpr std::size_t kMostCorners = 64;

}  // namespace limber::internal
