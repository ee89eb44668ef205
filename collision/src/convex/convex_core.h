// Rigid convex shapes: hull of some points, and a radius around it.
#pragma once

#include <algorithm>
#include <limits>
#include <span>
#include <vector>

#include "limber/core/types.h"
#include "limber/model/shape.h"

namespace limber::internal {

struct ConvexFace {
  Vec3 normal;  // unit, outward
  double offset;
  Index first, count;  // of its corners in ConvexCore::loops, counter-clockwise
};

// A ball has one point, a capsule two; a polytope also faces. Flat neighbours among a hull's triangles are one face.
struct ConvexCore {
  std::vector<Vec3> points;
  double radius = 0.0;
  std::vector<ConvexFace> faces{};
  std::vector<Index> loops{};
  std::vector<Index> loop_edges{};      // of each corner of a loop: the edge on to the next, each edge once
  std::vector<Vec3> edge_directions{};  // unit, each once, whichever way round
  Vec3 half_extents = Vec3::Zero();     // of a box: its points are at ± these; zero for the rest
  double extent = 0.0;                  // largest distance of a point of a polytope from the origin

  std::span<const Index> loop(const ConvexFace& f) const {
    return std::span(loops).subspan(static_cast<std::size_t>(f.first), static_cast<std::size_t>(f.count));
  }
  // How far it extends along a unit direction, from the origin.
  double reach(const Vec3& along) const {
    if (half_extents[0] > 0.0) return along.cwiseAbs().dot(half_extents) + radius;
    double highest = -std::numeric_limits<double>::infinity();
    for (const Vec3& p : points) highest = std::max(highest, along.dot(p));
    return highest + radius;
  }
  // The mean of its points.
  Vec3 middle() const {
    Vec3 sum = Vec3::Zero();
    for (const Vec3& p : points) sum += p;
    return sum / static_cast<double>(points.size());
  }
};

ConvexCore convex_core(const Sphere& shape);
ConvexCore convex_core(const Capsule& shape);
ConvexCore convex_core(const Box& shape);
// @throws InvalidArgument if the points have no volume
ConvexCore convex_core(const ConvexHull& shape);

// The faces as triangles over the same points. @pre has faces
TriangleMesh triangulated(const ConvexCore& core);

}  // namespace limber::internal
