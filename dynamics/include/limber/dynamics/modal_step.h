/// @file limber/dynamics/modal_step.h
/// How the modes of one model go through a step of one length, freely and under constraints: once per model and length,
/// shared by all instances.
///
/// A constraint's force is held over the step. A mode up to a limiting frequency answers it as the oscillator it is, by
/// H/Δt per unit of impulse at the step's end (oscillator.h); one above it by 1/(λΔt), its static displacement, which
/// lasts for that step alone (body_group.h).
#pragma once

#include <limits>
#include <span>
#include <vector>

#include "limber/dynamics/oscillator.h"

namespace limber {

class ModalStep {
 public:
  static constexpr double kNone = std::numeric_limits<double>::infinity();

  ModalStep() = default;
  /// Allocates nothing once it has been set for as many modes.
  /// @param lambda, decay as in Mode, one per mode. @param length s, > 0
  /// @param static_above √(λ − ξ²) above which a mode answers statically, rad/s; kNone: no mode does
  /// @throws InvalidArgument as PropagatorTable::set()
  void set(std::span<const double> lambda, std::span<const double> decay, double length, double static_above);

  double length() const { return table_.step(); }
  const PropagatorTable& table() const { return table_; }
  /// End-of-step displacement per unit of ConstraintLoad::modal, s. > 0 where static, ≥ 0 elsewhere.
  std::span<const double> position_response() const { return position_response_; }
  /// Velocity per unit impulse: 1, or 0 for modes that answer statically.
  std::span<const double> velocity_response() const { return velocity_response_; }

 private:
  PropagatorTable table_;
  std::vector<double> position_response_, velocity_response_;  // per mode
};

}  // namespace limber
