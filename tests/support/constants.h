// Numbers that tests of several modules use by name.
#pragma once

#include <limber/core/types.h>
#include <limits>
#include <numbers>

namespace limber::testing {

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();
inline constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
inline constexpr double kFewRoundings = 64 * kEpsilon;  ///< relative error of some tens of operations
inline constexpr double kPi = std::numbers::pi;
inline constexpr double kDegree = kPi / 180.0;  ///< rad
inline constexpr double kGravity = 9.80665;     ///< m/s², standard
inline const Vec3 kDown{0.0, 0.0, -kGravity};   ///< m/s²
inline constexpr double kFrame = 1.0 / 60.0;    ///< s, one frame of a display

}  // namespace limber::testing
