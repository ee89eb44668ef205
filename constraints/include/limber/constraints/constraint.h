/// @file limber/constraints/constraint.h
/// What puts rows into an island: handles, joints, contacts, or your own.
#pragma once

#include <array>
#include <span>

#include "limber/constraints/constraint_rows.h"

namespace limber {

/// Read access to the bodies' places. Body −1 is the world: at the origin, without modes.
class BodyStates {
 public:
  explicit BodyStates(std::span<const ConstrainedBody> table) : table_(table) {}

  const RigidTransform& pose(Index body, StepTime when) const;
  std::span<const double> amplitudes(Index body, StepTime when) const;
  Vec3 velocity(Index body, StepTime when) const;          ///< of the body origin, world, m/s
  Vec3 angular_velocity(Index body, StepTime when) const;  ///< world, rad/s
  std::span<const double> rates(Index body, StepTime when) const;
  bool is_static(Index body) const { return body < 0 || this->body(body).group == nullptr; }
  const ConstrainedBody& body(Index body) const { return table_[static_cast<std::size_t>(body)]; }

 private:
  std::span<const ConstrainedBody> table_;
};

/// Rows with one owner, who knows their true gaps. In every step the solver calls add_rows() at its start, gaps() after
/// each prediction, add_rows() at its end for the rows' answer to gravity there, and accept() with what was found. None
/// of them may allocate once warm, or throw.
class Constraint {
 public:
  virtual ~Constraint() = default;

  /// The two bodies (−1: the world) that the rows touch: they end in one island.
  virtual std::array<Index, 2> bodies() const = 0;
  /// Appends the rows, linearised at the step's start or at its predicted end: as many, in the same order.
  virtual void add_rows(const BodyStates& states, StepTime when, double step, ConstraintRows& rows) = 0;
  /// The gaps of the rows in the order in which they were appended. At the step's start with what the rows' flexibility
  /// then gives, at its end without. @param gaps as many numbers
  virtual void gaps(const BodyStates& states, StepTime when, std::span<double> gaps) const = 0;
  /// @param impulses of the rows over the step that ends now, N·s, held part included
  virtual void accept(const BodyStates& states, std::span<const double> impulses) = 0;
};

}  // namespace limber
