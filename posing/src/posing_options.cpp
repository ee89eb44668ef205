#include "limber/posing/posing_options.h"

#include <cmath>

#include "limber/core/error.h"

namespace limber {

void PosingOptions::validate() const {
  const auto positive = [](const char* field, double value) {
    if (!(value > 0.0) || !std::isfinite(value))
      throw InvalidArgument("PosingOptions." + std::string(field) + ": is " + std::to_string(value) +
                            ", expected a finite number > 0");
  };
  positive("handle_stiffness", handle_stiffness);
  positive("tolerance", tolerance);
  if (!(energy_tolerance >= 0.0) || !std::isfinite(energy_tolerance))
    throw InvalidArgument("PosingOptions.energy_tolerance: is " + std::to_string(energy_tolerance) +
                          ", expected a finite number >= 0");
  if (max_iterations < 1)
    throw InvalidArgument("PosingOptions.max_iterations: is " + std::to_string(max_iterations) + ", expected >= 1");
  if (starts < 0) throw InvalidArgument("PosingOptions.starts: is " + std::to_string(starts) + ", expected >= 0");
}

std::string_view to_string(PoseResult::Status status) {
  switch (status) {
    case PoseResult::Status::kConverged:
      return "converged";
    case PoseResult::Status::kLocalMinimum:
      return "local minimum";
    case PoseResult::Status::kIterationLimit:
      return "iteration limit";
    case PoseResult::Status::kStalled:
      return "stalled";
    case PoseResult::Status::kInfeasible:
      return "infeasible";
  }
  return "";
}

}  // namespace limber
