/// @file step_times.h
/// Times of a scene as steps. Times told in decimals are often a whole number of steps but for round-off; such a time
/// is taken as that number.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace limber::internal {

constexpr double kStepRoundOff = 1e-9;

/// The first step whose start is not before a time, which may be infinite.
inline std::int64_t step_at_or_after(double time, double step) {
  constexpr double kNever = 1e15;  // steps; a load without an end
  return static_cast<std::int64_t>(std::min(std::ceil(time / step - kStepRoundOff), kNever));
}

/// The step in which a time lies, and how long after its start.
struct TimeInSteps {
  std::int64_t step = 0;
  double delay = 0.0;
};

inline TimeInSteps time_in_steps(double time, double step) {
  const auto whole = static_cast<std::int64_t>(std::floor(time / step + kStepRoundOff));
  const double delay = time - static_cast<double>(whole) * step;
  if (delay <= kStepRoundOff * step) return {whole, 0.0};
  return {whole, std::min(delay, std::nextafter(step, 0.0))};
}

}  // namespace limber::internal
