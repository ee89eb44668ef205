/// @file limber/collision/tree_traversal.h
/// Walks over the trees of deformed surfaces: which triangles can touch a region, another surface, or the surface
/// itself, and which is nearest. None misses a triangle; all but nearest_* may report some that turn out not to touch.
/// None recurses, none allocates but the growth of the caller's vectors. Same inputs, same order of results.
#pragma once

#include <array>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "limber/collision/aabb.h"
#include "limber/collision/deformed_surface.h"
#include "limber/core/rigid_transform.h"
#include "limber/core/types.h"

namespace limber {

using TrianglePair = std::array<Index, 2>;

/// What else is known of two nodes of two trees.
class NodePairTest {
 public:
  virtual ~NodePairTest() = default;
  /// Whether no triangle below one is wanted with any below the other.
  virtual bool leaves_out(Index node_a, Index node_b) = 0;
};

/// Triangles of a below and of b that may be within `margin` of each other; appended to `pairs`.
/// @param X_AB frame of b in the frame of a  @param margin m, ≥ 0
/// @param way_A of b, in the frame of a, straight on: within `margin` anywhere along it
/// @param test of nodes; null: none
void find_triangle_pairs(DeformedSurface& a, DeformedSurface& b, const RigidTransform& X_AB, double margin,
                         std::vector<TrianglePair>& pairs, const Vec3& way_A = Vec3::Zero(),
                         NodePairTest* test = nullptr);

/// Triangles of one surface, t < u without a common vertex, that may be within `margin` of each other; appended.
/// Parts of the body that the amplitudes cannot bring so near are left out without looking at their boxes: rest
/// distance − Σ_i |z_i| max |u_ai − u_bi| > margin.
void find_self_pairs(DeformedSurface& a, double margin, std::vector<TrianglePair>& pairs);

/// Triangles that may overlap a box of the body frame; appended.
void find_triangles_in_box(DeformedSurface& a, const Aabb& box_B, std::vector<Index>& triangles);
/// … that may reach into normal · x ≤ offset (unit normal); appended.
void find_triangles_in_half_space(DeformedSurface& a, const Vec3& normal_B, double offset,
                                  std::vector<Index>& triangles);

/// Depth first, first child first: visits each triangle whose nodes' boxes all pass.
/// @param enter (const Aabb& box_B) → bool: whether anything in the box can matter
/// @param visit (Index triangle)
template <class Enter, class Visit>
void for_each_triangle(DeformedSurface& a, const Enter& enter, const Visit& visit) {
  std::array<Index, CollisionSurface::kMaxDepth + 2> stack;
  std::size_t size = 0;
  stack[size++] = 0;
  while (size > 0) {
    const Index n = stack[--size];
    if (!enter(a.bounds(n))) continue;
    const TreeNode& node = a.surface().node(n);
    if (node.leaf()) {
      for (const Index t : a.surface().node_triangles(n)) visit(t);
    } else {
      stack[size++] = node.child + 1;
      stack[size++] = node.child;
    }
  }
}

/// Branch and bound, nearer child first: visits triangles while a node's lower bound is below what is known.
/// @param lower_bound (const Aabb& box_B) → double: nothing in the box has less
/// @param visit (Index triangle, double best) → double: the new best, ≤ best
/// @param best known from the start; infinity if nothing is
/// @return the least value
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

/// Distance of a point from a box, m; 0 inside.
double distance_to_box(const Vec3& p, const Aabb& box);

/// The point of a surface nearest to a given one.
struct SurfaceProximity {
  Index triangle = -1;
  std::array<double, 3> weight{};  ///< barycentric
  Vec3 point_B = Vec3::Zero();     ///< m
  double distance = 0.0;           ///< m, ≥ 0: on which side is not told
};
/// @param max_distance m; none where the surface is not nearer than that. Of equally near ones the first visited.
std::optional<SurfaceProximity> nearest_point(DeformedSurface& a, const Vec3& p_B,
                                              double max_distance = std::numeric_limits<double>::infinity());

}  // namespace limber
