/// @file limber/collision/aabb.h
/// Axis-aligned boxes in double precision.
#pragma once

#include <limits>

#include "limber/core/types.h"

namespace limber {

/// All points with low ≤ x ≤ high; as made, holds none.
struct Aabb {
  Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity());
  Vec3 high = Vec3::Constant(-std::numeric_limits<double>::infinity());

  bool empty() const { return (low.array() > high.array()).any(); }
  Vec3 center() const { return 0.5 * (low + high); }
  Vec3 half_extents() const { return 0.5 * (high - low); }
  void include(const Vec3& p) { low = low.cwiseMin(p), high = high.cwiseMax(p); }
  void include(const Aabb& other) { low = low.cwiseMin(other.low), high = high.cwiseMax(other.high); }
  Aabb grown(double by) const { return {low - Vec3::Constant(by), high + Vec3::Constant(by)}; }
  bool overlaps(const Aabb& other) const {
    return (low.array() <= other.high.array()).all() && (other.low.array() <= high.array()).all();
  }
  bool contains(const Vec3& p) const { return (low.array() <= p.array()).all() && (p.array() <= high.array()).all(); }
};

}  // namespace limber
