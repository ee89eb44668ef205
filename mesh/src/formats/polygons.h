/// Polygons as files hold them, and their triangles.
#pragma once

#include <span>
#include <vector>

#include "limber/core/types.h"

namespace limber::internal {

/// Polygons over some vertices, one behind the other.
struct Polygons {
  std::vector<Index> corners;
  std::vector<std::size_t> ends;  ///< per polygon, one past its last corner in `corners`

  std::size_t size() const { return ends.size(); }
  std::span<const Index> operator[](std::size_t i) const {
    const std::size_t begin = i == 0 ? 0 : ends[i - 1];
    return std::span(corners).subspan(begin, ends[i] - begin);
  }
  void push(std::span<const Index> polygon) {
    corners.insert(corners.end(), polygon.begin(), polygon.end());
    close();
  }
  /// Ends the polygon whose corners have been pushed.
  void close() { ends.push_back(corners.size()); }
};

/// Polygons cut into triangles.
struct Triangulation {
  std::vector<Triangle> triangles;
  std::size_t crossing_polygons = 0;  ///< those that cross themselves, so that no cut of them is right
};

/// Triangles in the polygons' order, same sense of rotation; a polygon of n ≥ 3 corners gives n − 2, one of fewer none.
/// Convex polygons become fans. Others are cut ear by ear in the plane that fits them best, whatever their number of
/// corners; they may touch themselves, as a polygon with a hole does along the bridge from rim to hole. Takes a time
/// that is about linear in the corners. @pre all corners are in range
Triangulation triangulated(const Polygons& polygons, std::span<const Vec3> vertices);

}  // namespace limber::internal
