/// @file limber/core/cross_matrix.h
/// Cross products as a matrix and by component.
#pragma once

#include "limber/core/types.h"

namespace limber {

/// [v]×, the matrix with [v]× x = v × x for every x: antisymmetric.
inline Mat3 cross_matrix(const Vec3& v) {
  Mat3 m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

/// One component of u × v. Of a Vec3 that has just been written number by number a read of two numbers waits for both
/// to reach memory: where that counts, loops go over components.
inline double cross_component(const Vec3& u, const Vec3& v, Eigen::Index k) {
  const Eigen::Index i = (k + 1) % 3, j = (k + 2) % 3;
  return u[i] * v[j] - u[j] * v[i];
}

}  // namespace limber
