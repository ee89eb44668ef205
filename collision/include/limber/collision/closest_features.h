/// @file limber/collision/closest_features.h
/// Closest points of points, segments, triangles and convex solids, and the features they lie on.
///
/// Pure geometry in double precision: no state, no allocation, no exception; all points in one frame, lengths in m. Any
/// finite input is answered: flat triangles and zero-length segments are what is left of them, a segment or a point.
/// Errors are a few ε of the largest coordinate, so put the origin near. Methods: Ericson, *Real-Time Collision
/// Detection* (2005), chapter 5, with the lines' common perpendicular by cross products, which keeps its digits for
/// nearly parallel lines; Gilbert, Johnson, Keerthi (1988) for convex solids.
#pragma once

#include <array>
#include <limits>
#include <span>

#include "limber/core/types.h"
#include "limber/mesh/closest_point.h"
#include "limber/model/shape.h"

namespace limber {

/// The two nearest points of a pair, one on each.
struct ClosestPoints {
  SurfaceFoot a, b;
  double distance = 0.0;  ///< |a − b|, m
};

/// Where several pairs are equally near (parallel edges) it is one that has an end point in it.
ClosestPoints closest_points(const SegmentPoints& a, const SegmentPoints& b);

/// Nearest points of solids that may intersect.
struct ClosestOrCrossing : ClosestPoints {
  /// Then distance = 0 and a = b is a common point, to round-off. Slivers, whose plane is lost in round-off, may be
  /// told as apart by as little.
  bool intersecting = false;
  /// Where they intersect: what they have in common is this segment (its two ends are the same for a point; for
  /// triangles in one plane, which have an area in common, both are the common point a).
  SegmentPoints crossing{};
};

ClosestOrCrossing closest_points(const SegmentPoints& a, const TrianglePoints& b);
ClosestOrCrossing closest_points(const TrianglePoints& a, const TrianglePoints& b);

/// A convex solid: all points within `radius` of the convex hull of `points`. One point is a ball, two a capsule; with
/// radius 0 a triangle, a box or any polytope.
struct ConvexSolid {
  std::span<const Vec3> points;  ///< at least one
  double radius = 0.0;           ///< m, ≥ 0
};

/// Of two convex solids: nearest points and the distance, negative where they overlap by less than the sum of the
/// radii.
struct ConvexDistance {
  Vec3 a = Vec3::Zero(), b = Vec3::Zero();  ///< on the surface of each
  Vec3 normal = Vec3::Zero();               ///< unit, from b to a: distance = normal · (a − b)
  double distance = 0.0;                    ///< m
  /// The hulls of the points themselves intersect: normal is zero and distance minus the sum of the radii. Penetration
  /// of polytopes is the narrow phase's work.
  bool cores_intersect = false;
};

/// By GJK with exact solves over the simplices, ended by the closest points of the two features found. Gap within 1e-12
/// of size, normal within 1e-12·size/gap.
/// @param most of solids farther apart, any distance above it that a plane with this normal keeps them apart by may be
/// told; m, ≥ 0
ConvexDistance distance(const ConvexSolid& a, const ConvexSolid& b,
                        double most = std::numeric_limits<double>::infinity());

}  // namespace limber
