/// @file hertz.h
#pragma once

#include <numbers>

namespace limber::internal {

/// λ of an undamped frequency, rad²/s².
inline double eigenvalue_of_hz(double hz) { return 4.0 * std::numbers::pi * std::numbers::pi * hz * hz; }

}  // namespace limber::internal
