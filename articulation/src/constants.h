/// @file constants.h
/// Private to the articulation module.
#pragma once

#include <limits>
#include <numbers>

namespace limber::internal {

/// The first two powers of 1/ρ, ρ the plastic number (ρ³ = ρ + 1): of the R2 sequence, whose points i·(first, second)
/// modulo 1 fill the unit square evenly (M. Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018).
inline constexpr double kEvenFirst = 0.7548776662466927, kEvenSecond = 0.5698402909980532;

inline constexpr double kPi = std::numbers::pi;
inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace limber::internal
