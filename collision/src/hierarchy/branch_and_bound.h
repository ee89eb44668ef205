// The walk behind the searches for what is nearest.
#pragma once

#include <array>
#include <limits>
#include <utility>

#include "limber/collision/deformed_surface.h"

namespace limber::internal {

// Branch and bound, nearer child first: visits triangles while a node's lower bound is below what is known.
// @param lower_bound (const Aabb& box_B) → double: nothing in the box has less
// @param visit (Index triangle, double best) → double: the new best, ≤ best
// @param best known from the start; infinity if nothing is
// @return the least value
template <class LowerBound, class Visit>
double branch_and_bound(DeformedSurface& a, const LowerBound& lower_bound, const Visit& visit,
                        double best = std::numeric_limits<double>::infinity()) {
  std::array<std::pair<Index, double>, CollisionSurface::kMaxDepth + 2> stack;
  std::size_t size = 0;
  stack[size++] = {0, lower_bound(a.bounds(0))};
  while (size > 0) {
    const auto [n, bound] = stack[--size];
    if (!(bound < best)) continue;
    const TreeNode& node = a.surface().node(n);
    if (node.leaf()) {
      for (const Index t : a.surface().node_triangles(n)) best = visit(t, best);
      continue;
    }
    std::pair<Index, double> near{node.child, lower_bound(a.bounds(node.child))};
    std::pair<Index, double> far{node.child + 1, lower_bound(a.bounds(node.child + 1))};
    if (far.second < near.second) std::swap(near, far);
    stack[size++] = far;
    stack[size++] = near;
  }
  return best;
}

}  // namespace limber::internal
