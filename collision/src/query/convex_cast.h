// Where a ray or a convex solid that moves straight on first touches.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "limber/collision/aabb.h"
#include "limber/collision/closest_features.h"

namespace limber::internal {

/// The fraction at which from + f way enters a box, at most `limit`; infinity: it does not.
double enters_box(const Vec3& from, const Vec3& way, double limit, const Aabb& box);

/// A ray on a triangle, from either side, at its fraction.
struct TriangleHit {
  double fraction;
  std::array<double, 3> weight;
};
std::optional<TriangleHit> meet(const Vec3& from, const Vec3& way, const TrianglePoints& triangle);

/// The least f in [0, limit] at which from + f way is on the surface of points within `radius` of a segment.
std::optional<double> meet_capsule(const Vec3& from, const Vec3& way, const SegmentPoints& core, double radius);

struct Touch {
  double fraction = 0.0;
  Vec3 point = Vec3::Zero();   // on what stands
  Vec3 normal = Vec3::Zero();  // out of it; zero where the two overlap at the start
};

/// A convex solid on its way. Newton's steps to the first root of the distance, which is convex along the way: they
/// never go past it.
class ConvexCast {
 public:
  /// @param tolerance a gap that counts as touching, m
  void start(const ConvexSolid& moving, const Vec3& way, double tolerance);
  std::optional<Touch> touch(const ConvexSolid& standing, double limit);

 private:
  ConvexSolid moving_{};
  Vec3 way_ = Vec3::Zero();
  double tolerance_ = 0.0;
  std::vector<Vec3> shifted_;  // what stands, seen from what moves
};

}  // namespace limber::internal
