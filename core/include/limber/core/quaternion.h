/// @file limber/core/quaternion.h
/// Unit quaternions as a plain struct of four doubles (Eigen's Quaterniond is over-aligned and may not cross a
/// boundary).
#pragma once

#include <cmath>

#include "limber/core/types.h"

namespace limber {

/// A rotation, w + x i + y j + z k, |q| = 1. Composition reads as for matrices: (a*b) rotates by b first.
struct Quaternion {
  double w = 1.0, x = 0.0, y = 0.0, z = 0.0;

  Vec3 vector() const { return {x, y, z}; }
  Quaternion conjugate() const { return {w, -x, -y, -z}; }
  double norm() const { return std::sqrt(w * w + x * x + y * y + z * z); }

  friend Quaternion operator*(const Quaternion& a, const Quaternion& b) {
    return {a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
            a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x, a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w};
  }

  /// Rotates a vector.
  friend Vec3 operator*(const Quaternion& q, const Vec3& v) {
    const Vec3 t = 2.0 * q.vector().cross(v);
    return v + q.w * t + q.vector().cross(t);
  }
};

/// q / |q|. @pre |q| > 0
inline Quaternion normalized(const Quaternion& q) {
  const double s = 1.0 / q.norm();
  return {s * q.w, s * q.x, s * q.y, s * q.z};
}

/// Rotation by |r| radians about r (right hand); exact to round-off for any |r|, identity at r = 0.
Quaternion quaternion_from_rotation_vector(const Vec3& r);

/// The inverse: the shortest turn that a unit quaternion makes, 0 ≤ |r| ≤ π; exact to round-off. q and −q give the
/// same.
Vec3 rotation_vector(const Quaternion& q);

/// The rotation matrix of a unit quaternion.
Mat3 to_matrix(const Quaternion& q);

/// The unit quaternion (w ≥ 0) of a rotation matrix. @pre R is orthonormal with det R = +1
Quaternion quaternion_from_matrix(const Mat3& R);

/// Shortest-arc spherical interpolation, s in [0, 1]: a at 0, b at 1.
Quaternion slerp(const Quaternion& a, const Quaternion& b, double s);

}  // namespace limber
