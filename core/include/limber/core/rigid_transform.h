/// @file limber/core/rigid_transform.h
/// Rigid transforms X_AB in the notation of docs/notation.md: the inner letters of a product meet.
#pragma once

#include "limber/core/quaternion.h"

namespace limber {

/// X_AB: pose of frame B in frame A; p_AP = X_AB * p_BP.
struct RigidTransform {
  Quaternion q{};         ///< R_AB
  Vec3 p = Vec3::Zero();  ///< p_AB, origin of B in A, m

  friend Vec3 operator*(const RigidTransform& X, const Vec3& p_BP) { return X.q * p_BP + X.p; }
  friend RigidTransform operator*(const RigidTransform& X_AB, const RigidTransform& X_BC) {
    return {X_AB.q * X_BC.q, X_AB.q * X_BC.p + X_AB.p};
  }
  RigidTransform inverse() const {
    const Quaternion c = q.conjugate();
    return {c, -(c * p)};
  }
};

}  // namespace limber
