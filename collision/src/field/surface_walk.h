// Points on a deformed surface that are found by walking over it from a triangle near them, in single precision and the
// body frame.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <span>

#include "field/pointshell.h"
#include "narrow/pair_surface.h"

namespace limber::internal {

inline constexpr unsigned kFootOnFace = 7u;  ///< SurfaceFoothold::corners

/// The point of a surface that is nearest to another one, among those around it.
struct SurfaceFoothold {
  Index triangle = -1;
  Vec3f point = Vec3f::Zero();
  std::array<float, 3> weight{};
  float squared_distance = 0.0f;
  /// Corners of the triangle that the foot is a mean of, a bit each: one of a vertex, two of an edge, three of a face.
  unsigned corners = 0;
};

using TrianglePointsf = std::array<Vec3f, 3>;

inline TrianglePointsf corners_of(const DeformedPointshell& body, Index t) { return body.corners(t); }

/// Unit; zero of a triangle without area.
Vec3f face_normal(const DeformedPointshell& body, Index t);

/// Nearest point of one triangle. Method: Ericson, *Real-Time Collision Detection* (2005), 5.1.5.
SurfaceFoothold foot_on(const DeformedPointshell& body, Index t, const Vec3f& p);

/// A local minimum of the distance from p over the surface: from triangle to triangle as long as one is nearer.
/// @param seen triangles that are no nearer than the start
SurfaceFoothold walk_to_foot(const DeformedPointshell& body, const SurfaceFoothold& start, const Vec3f& p,
                             std::span<const Index> seen = {});
inline SurfaceFoothold walk_to_foot(const DeformedPointshell& body, Index start, const Vec3f& p) {
  return walk_to_foot(body, foot_on(body, start, p), p);
}

/// The angle-weighted pseudonormal at a foot: whatever it is the nearest point of lies outside where along it. Not
/// unit.
Vec3f normal_at(const DeformedPointshell& body, const SurfaceFoothold& foot);

/// Where a line goes through a face.
struct Pierced {
  Index triangle = -1;  ///< −1: no face around does
  float along = 0.0f;   ///< the point is from + along (to − from)
};
/// The face that the line through two points goes through, near a triangle.
Pierced walk_to_face(const DeformedPointshell& body, Index start, const Vec3f& from, const Vec3f& to);

/// Whether the surface about a vertex lies in front of it along a unit direction, leaning back by no more than a sine.
bool lies_in_front(const DeformedPointshell& body, Index v, const Vec3f& n, float leaning);

/// Visits the edge that a foot lies on, or those of the vertex that it is; none of a face.
template <class Visit>
void for_edges_at(const CollisionSurface& surface, const SurfaceFoothold& foot, const Visit& visit) {
  if (foot.corners == kFootOnFace) return;
  if (!std::has_single_bit(foot.corners)) {
    visit(surface.edge_of(foot.triangle, foot.corners == 3u ? 0 : foot.corners == 6u ? 1 : 2));
    return;
  }
  const Index v = surface.triangle(foot.triangle)[static_cast<std::size_t>(std::countr_zero(foot.corners))];
  for (const Index t : surface.vertex_triangles(v))
    visit(
        surface.edge_of(t, static_cast<int>(std::ranges::find(surface.triangle(t), v) - surface.triangle(t).begin())));
}

/// What a foot lies on, as NarrowPhase calls it.
FeatureKey key_of(const CollisionSurface& surface, const SurfaceFoothold& foot);

}  // namespace limber::internal
