// Boxes of bodies in the world.
#pragma once

#include <cmath>
#include <limits>
#include <variant>

#include "limber/collision/aabb.h"
#include "limber/collision/narrow_phase.h"
#include "limber/core/quaternion.h"
#include "limber/core/rigid_transform.h"

namespace limber::internal {

/// Encloses what lies within half_W of a point, with room for rounding.
inline Aabb box_about(const Vec3& center_W, const Vec3& half_W) {
  constexpr double kRounding = 8.0 * std::numeric_limits<double>::epsilon();
  const Vec3 half = half_W + kRounding * (center_W.cwiseAbs() + half_W);
  return {center_W - half, center_W + half};
}

/// Encloses a box of the body frame.
inline Aabb world_box(const Aabb& box_B, const RigidTransform& X_WB) {
  return box_about(X_WB * box_B.center(), to_matrix(X_WB.q).cwiseAbs() * box_B.half_extents());
}

/// Largest distance of a point of a box from the origin.
inline double farthest_of(const Aabb& box) { return box.low.cwiseAbs().cwiseMax(box.high.cwiseAbs()).norm(); }

/// With all that lies below it.
inline Aabb with_all_below(Aabb box, const Vec3& up) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    if (up[axis] > 0.0) box.low[axis] = -kInfinity;
    if (up[axis] < 0.0) box.high[axis] = kInfinity;
  }
  return box;
}

/// Of any rigid shape but a half-space, which has none. With what is solid below it.
inline Aabb world_box(const RigidGeometry& geometry, const RigidTransform& X_WB) {
  if (const auto* ball = std::get_if<Sphere>(&geometry.shape())) return box_about(X_WB.p, Vec3::Constant(ball->radius));
  if (const auto* capsule = std::get_if<Capsule>(&geometry.shape())) {
    const Vec3 end = X_WB.q * Vec3(0.0, 0.0, capsule->half_length);
    return box_about(X_WB.p, end.cwiseAbs() + Vec3::Constant(capsule->radius));
  }
  const Aabb box = world_box(geometry.bounds(), X_WB);
  return with_all_below(box, X_WB.q * geometry.up());
}

/// In world coordinates.
inline HalfSpace world_half_space(const HalfSpace& h, const RigidTransform& X_WB) {
  const Vec3 normal = X_WB.q * h.normal;
  return {normal, h.offset + normal.dot(X_WB.p)};
}

}  // namespace limber::internal
