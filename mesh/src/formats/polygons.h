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

/// Triangles in the polygons' order, same sense of rotation. Convex polygons become fans, concave ones are cut ear by
/// ear in the plane that fits them best. Polygons of fewer than three corners give none. @pre all corners are in range
std::vector<Triangle> triangulated(const Polygons& polygons, std::span<const Vec3> vertices);

}  // namespace limber::internal
