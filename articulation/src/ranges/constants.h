/// @file constants.h
/// Private to the articulation module.
#pragma once

#include <limits>
#include <numbers>

namespace limber::internal {

inline constexpr double kPi = std::numbers::pi;
inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace limber::internal
