/// @file limber/core/types.h
/// The few words every module shares: small vectors, the index type, and the rule on what may cross a boundary.
///
/// Only types whose layout does not depend on compiler flags cross limber's compiled boundaries: Vec3, Mat3, spans and
/// plain structs. Owning or vectorisable Eigen types (MatrixXd, Vector4d, Quaterniond) change their alignment with
/// -mavx and would make a library and an application built with different flags crash each other.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

namespace limber {

using Vec3 = Eigen::Vector3d;   ///< 24 bytes, never over-aligned
using Vec3f = Eigen::Vector3f;  ///< 12 bytes, never over-aligned
using Mat3 = Eigen::Matrix3d;   ///< 72 bytes, column-major, never over-aligned

/// Index of a node, element, vertex or mode. 32 bits: meshes of up to 2³¹ − 1 items.
using Index = std::int32_t;

using Triangle = std::array<Index, 3>;  ///< counter-clockwise seen from outside
using Tet = std::array<Index, 4>;       ///< positive: (x1−x0)×(x2−x0)·(x3−x0) > 0

inline constexpr double kUnbounded = std::numeric_limits<double>::infinity();  ///< a bound that is none

/// Remarks on input that was accepted after repair or with doubt; each is one full sentence naming the place.
using Warnings = std::vector<std::string>;

}  // namespace limber
