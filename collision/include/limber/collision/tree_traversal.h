/// @file limber/collision/tree_traversal.h
/// Walks over the trees of deformed surfaces: which triangles can touch a region, another surface, or the surface
/// itself, and which is nearest. None misses a triangle; all but nearest_* may report some that turn out not to touch.
/// None recurses, none allocates but the growth of the caller's vectors. Same inputs, same order of results.
#pragma once

#include <array>
#include <limits>
#include <optional>
#include <vector>

#include "limber/collision/aabb.h"
#include "limber/collision/deformed_surface.h"
#include "limber/core/rigid_transform.h"
#include "limber/core/types.h"

namespace limber {

using TrianglePair = std::array<Index, 2>;

/// Triangles of a below and of b that may be within `margin` of each other; appended to `pairs`.
/// @param X_AB frame of b in the frame of a  @param margin m, ≥ 0
/// @param way_A of b, in the frame of a, straight on: within `margin` anywhere along it
void find_triangle_pairs(DeformedSurface& a, DeformedSurface& b, const RigidTransform& X_AB, double margin,
                         std::vector<TrianglePair>& pairs, const Vec3& way_A = Vec3::Zero());

/// Triangles of one surface, t < u without a common vertex, that may be within `margin` of each other; appended.
/// Parts of the body that the amplitudes cannot bring so near are left out without looking at their boxes: rest
/// distance − Σ_i |z_i| max |u_ai − u_bi| > margin.
void find_self_pairs(DeformedSurface& a, double margin, std::vector<TrianglePair>& pairs);

/// Triangles that may overlap a box of the body frame; appended.
void find_triangles_in_box(DeformedSurface& a, const Aabb& box_B, std::vector<Index>& triangles);
/// … that may reach into normal · x ≤ offset (unit normal); appended.
void find_triangles_in_half_space(DeformedSurface& a, const Vec3& normal_B, double offset,
                                  std::vector<Index>& triangles);

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
