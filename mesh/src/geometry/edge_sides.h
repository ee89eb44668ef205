// The edges of a surface with the triangles at each.
#pragma once

#include <algorithm>
#include <span>
#include <tuple>
#include <vector>

#include "limber/mesh/surface_mesh.h"

namespace limber::internal {

/// One triangle at one of its edges.
struct EdgeSide {
  Index low, high;  ///< the edge's vertices
  Index triangle;
  bool forward;  ///< whether the triangle runs from low to high
};

/// All of them, edge by edge, triangles in order.
inline std::vector<EdgeSide> edge_sides(const SurfaceMesh& surface) {
  std::vector<EdgeSide> sides;
  sides.reserve(3 * surface.triangles.size());
  for (std::size_t i = 0; i < surface.triangles.size(); ++i)
    for (int a = 0; a < 3; ++a) {
      const Index from = surface.triangles[i][a], to = surface.triangles[i][(a + 1) % 3];
      sides.push_back({std::min(from, to), std::max(from, to), static_cast<Index>(i), from < to});
    }
  std::sort(sides.begin(), sides.end(), [](const EdgeSide& a, const EdgeSide& b) {
    return std::tie(a.low, a.high, a.triangle) < std::tie(b.low, b.high, b.triangle);
  });
  return sides;
}

/// Calls visit(sides of the edge) for each edge.
template <class Visit>
void for_each_edge(std::span<const EdgeSide> sides, const Visit& visit) {
  for (std::size_t i = 0; i < sides.size();) {
    std::size_t j = i + 1;
    while (j < sides.size() && sides[j].low == sides[i].low && sides[j].high == sides[i].high) ++j;
    visit(sides.subspan(i, j - i));
    i = j;
  }
}

}  // namespace limber::internal
