/// @file limber/constraints/constraint.h
/// What puts rows into an island: handles, joints, contacts, or your own.
#pragma once

#include <algorithm>
#include <array>
#include <span>

#include "limber/constraints/constraint_rows.h"
#include "limber/dynamics/exact_motion.h"

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

/// How the bodies of an island would go through the rest of a step: if nothing touched them, or as it is told.
struct FreeMotions {
  std::span<const Index> members;        ///< bodies, ascending
  std::span<const ExactMotion> motions;  ///< one for each
  /// Null: the body stands still.
  const ExactMotion* of(Index body) const;
};

/// Looks at a motion before it happens.
class MotionWatch {
 public:
  virtual ~MotionWatch() = default;
  /// @param motions of an island's members over the coming step, constraint forces and all
  /// @return how far they may go, s; their length or more: all the way
  virtual double clear_until(const FreeMotions& motions, double length) = 0;
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
  /// J̇v of the rows at the step's start, in their order: what the gaps' rates change by while the bodies keep their
  /// velocities. For [H03]'s acceleration program (contact_method.h), which sees contacts alone. @param bias as many
  /// numbers
  virtual void bias_accelerations(const BodyStates&, std::span<double> bias) const { std::ranges::fill(bias, 0.0); }
  /// Whether it is contact: an island of nothing else may have its step cut where bodies strike and let go. Each part
  /// is then a step for the functions here.
  virtual bool is_contact() const { return false; }
  /// Whether islands of nothing but such constraints may have a step that does not settle taken in shorter parts, each
  /// a step for the functions here.
  virtual bool may_be_divided() const { return false; }
  /// When within the rest of a step it wants that cut, s from now; `within` or later: not at all.
  virtual double next_cut(const BodyStates&, const FreeMotions&, double within) { return within; }
  /// Before accept(): how far contacts that press slid, m, in their normal rows; 0 where forces did not come at the
  /// step's start.
  virtual void slid(std::span<const double> /*slip*/) {}
  /// @param impulses of the rows over the step that ends now, N·s, held part included
  virtual void accept(const BodyStates& states, std::span<const double> impulses) = 0;
};

}  // namespace limber
