/// @file limber/mesh/closest_point.h
/// The point of a segment or triangle nearest to a point, and the feature it lies on.
///
/// Pure geometry in double precision: no state, no allocation, no exception; all points in one frame, lengths in m. Any
/// finite input is answered: flat triangles and zero-length segments are what is left of them, a segment or a point.
/// Errors are a few ε of the largest coordinate, so put the origin near. Method: Ericson, *Real-Time Collision
/// Detection* (2005), chapter 5, with the foot on a triangle measured along its longest edge and across.
#pragma once

#include <array>
#include <cstdint>

#include "limber/core/types.h"

namespace limber {

using SegmentPoints = std::array<Vec3, 2>;
using TrianglePoints = std::array<Vec3, 3>;

/// A vertex, edge or face of a segment or triangle. Edge i of a triangle runs from vertex i to vertex (i + 1) mod 3; a
/// segment's own line is its edge 0.
struct Feature {
  enum class Kind : std::uint8_t { kVertex, kEdge, kFace } kind = Kind::kVertex;
  std::uint8_t index = 0;  ///< 0 for a face

  friend bool operator==(const Feature&, const Feature&) = default;
};

/// The point of a segment (two weights) or triangle (three) nearest to something: Σ weight·vertex.
struct SurfaceFoot {
  Vec3 point = Vec3::Zero();
  std::array<double, 3> weight{1.0, 0.0, 0.0};  ///< barycentric: ≥ 0, sum 1
  Feature feature{};
};

/// Unit normal of a triangle, counter-clockwise seen from its tip; zero where its height over the longest edge is less
/// than 1e-13 of that edge. Orthogonal to the longest edge to round-off, also for slivers.
Vec3 unit_normal(const TrianglePoints& t);

SurfaceFoot closest_on_segment(const Vec3& p, const SegmentPoints& s);
SurfaceFoot closest_on_triangle(const Vec3& p, const TrianglePoints& t);

/// s[0] + t (s[1] − s[0]), measured from the nearer end so that a point close to an end keeps its digits.
inline Vec3 between(const SegmentPoints& s, double t) {
  if (t <= 0.5) return s[0] + t * (s[1] - s[0]);
  return s[1] + (1.0 - t) * (s[0] - s[1]);
}

/// The foot at parameter t of a segment: an end for t ≤ 0 and t ≥ 1.
inline SurfaceFoot foot_at(const SegmentPoints& s, double t) {
  if (!(t > 0.0)) return {s[0], {1.0, 0.0, 0.0}, {Feature::Kind::kVertex, 0}};
  if (t >= 1.0) return {s[1], {0.0, 1.0, 0.0}, {Feature::Kind::kVertex, 1}};
  return {between(s, t), {1.0 - t, t, 0.0}, {Feature::Kind::kEdge, 0}};
}

inline SegmentPoints edge_of(const TrianglePoints& t, int edge) {
  return {t[static_cast<std::size_t>(edge)], t[static_cast<std::size_t>((edge + 1) % 3)]};
}

/// A foot on edge `edge` of a triangle, renamed from the segment's names to the triangle's.
SurfaceFoot on_edge(const SurfaceFoot& foot, int edge);

}  // namespace limber
