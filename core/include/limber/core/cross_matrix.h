/// @file limber/core/cross_matrix.h
/// The matrix of a cross product.
#pragma once

#include "limber/core/types.h"

namespace limber {

/// [v]×, the matrix with [v]× x = v × x for every x: antisymmetric.
inline Mat3 cross_matrix(const Vec3& v) {
  Mat3 m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

}  // namespace limber
