/// @file hertz.h
#pragma once

#include <cmath>
#include <numbers>

namespace limber::internal {

/// λ of an undamped frequency, rad²/s².
inline double eigenvalue_of_hz(double hz) { return 4.0 * std::numbers::pi * std::numbers::pi * hz * hz; }
/// And back.
inline double hz_of_eigenvalue(double lambda) { return std::sqrt(lambda) / (2.0 * std::numbers::pi); }

}  // namespace limber::internal
