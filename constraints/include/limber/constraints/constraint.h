/// @file limber/constraints/constraint.h
/// What puts rows into an island: handles, joints, contacts, or your own.
#pragma once

#include <array>
#include <span>

#include "limber/constraints/constraint_rows.h"

namespace limber {

/// Read access to the bodies' places. Body −1 is the world: at the origin, without modes.
///
/// The middle of a step is the mean of its two ends, for points and directions in the world. With R₁ = cay(τ) R₀ a
/// point at s in the body, s₀ and s₁ at the two ends, goes by exactly
///   Δ(p + R s) = Δp + τ × ½(R₀s₀ + R₁s₁) + R' Δs,      R' = (1 + ½[τ]) R₀      (docs/derivations/constraints.md)
/// so that rotation() is R' there.
class BodyStates {
 public:
  explicit BodyStates(std::span<const ConstrainedBody> table) : table_(table) {}

  /// At one of the step's ends.
  const RigidTransform& pose(Index body, StepTime when) const {
    if (body < 0) return kWorld;
    const ConstrainedBody& b = this->body(body);
    if (b.group == nullptr) return b.pose;
    return when == StepTime::kStart ? b.group->frame(b.slot).pose() : b.group->predicted_frame(b.slot).pose();
  }
  Vec3 origin(Index body, StepTime when) const;    ///< world, m
  Mat3 rotation(Index body, StepTime when) const;  ///< R_WB, or R' in the middle
  /// The Cayley vector τ of the body's turn over the step, rad where it is small: R₁ = cay(τ) R₀, |τ| = 2 tan(angle/2).
  Vec3 turn(Index body) const;
  std::span<const double> amplitudes(Index body, StepTime when) const;  ///< at one of the step's ends
  Vec3 velocity(Index body, StepTime when) const;                       ///< of the body origin, world, m/s
  Vec3 angular_velocity(Index body, StepTime when) const;               ///< world, rad/s
  std::span<const double> rates(Index body, StepTime when) const;
  /// Where the body's points are, at one of the step's ends. @pre not static, here and in the next two
  BodyShape shape(Index body, StepTime when) const;
  /// Whether it bends by a modal skin.
  bool skinned(Index body) const { return this->body(body).group->skinned(this->body(body).slot); }
  /// For means over the step. @pre skinned
  std::array<ShapeBetween, kShapesBetween> shapes_between(Index body) const {
    return this->body(body).group->shapes_between(this->body(body).slot);
  }
  bool is_static(Index body) const { return body < 0 || this->body(body).group == nullptr; }
  const ConstrainedBody& body(Index body) const { return table_[static_cast<std::size_t>(body)]; }

 private:
  inline static const RigidTransform kWorld{};

  std::span<const ConstrainedBody> table_;
};

/// A step, or a part of one.
struct PartOfStep {
  double length = 0.0;  ///< s, its own
  double left = 0.0;    ///< s, of the step, with it
  double whole = 0.0;   ///< s, the step
};

/// How what rows exert on one body changes with where another one, or it itself, ends a step. World axes; shifts are of
/// the origin, m, turns small rotations of the body at the step's end, rad.
class ForceDerivative {
 public:
  enum class Of { kForce, kMoment };
  enum class By { kShift, kTurn };
  virtual ~ForceDerivative() = default;
  /// Adds ∂(impulse or moment on `body`)/∂(shift or turn of `moved`). Bodies that are not of the island do not count.
  virtual void add(Index body, Of of, Index moved, By by, const Mat3& value) = 0;
  /// An impulse acts at a point of the body that its modes move: where it acts, and what the modes get of it, changes
  /// as the body bends and turns. @param shapes of the point, body axes, one per mode
  virtual void add_bending(Index body, const Vec3& impulse, std::span<const Vec3> shapes) = 0;
};

/// Rows with one owner, who knows their true gaps. In every step the solver calls begin_part() and add_rows() at its
/// start, gaps() after each prediction, add_rows() at its end and in its middle, and accept() with what was found. None
/// of them may allocate once warm, or throw.
class Constraint {
 public:
  virtual ~Constraint() = default;

  /// The two bodies (−1: the world) that the rows touch: they end in one island.
  virtual std::array<Index, 2> bodies() const = 0;
  /// What follows, up to accept(), is a part of a step.
  virtual void begin_part(const PartOfStep&) {}
  /// Appends the rows, linearised at the step's start, at its predicted end or in the middle, where J (Δp, τ, Δz) is
  /// to be what the gap changes by over the step, so that forces do the work that they are to do: as many, in the same
  /// order, in all parts of a step. Laws count at the start and at the end.
  virtual void add_rows(const BodyStates& states, StepTime when, double step, ConstraintRows& rows) = 0;
  /// The gaps of the rows in the order in which they were appended. At the step's start with what the rows' flexibility
  /// then gives, at its end without. @param gaps as many numbers
  virtual void gaps(const BodyStates& states, StepTime when, std::span<double> gaps) const = 0;
  /// Derivatives of what the rows' impulses do to the bodies by the rows of the step's middle: Newton's method gets
  /// along without where forces are small. The numbers are the impulses of the rows.
  virtual void add_force_derivative(const BodyStates&, std::span<const double> /*impulses*/, ForceDerivative&) const {}
  /// Whether it is contact.
  virtual bool is_contact() const { return false; }
  /// Whether islands of free bodies and nothing but such constraints may have a step that does not settle taken in
  /// shorter parts, each a step for the functions here.
  virtual bool may_be_divided() const { return false; }
  /// Before accept(): how far contacts that press slid, m, in their normal rows; 0 where forces did not come at the
  /// step's start.
  virtual void slid(std::span<const double> /*slip*/) {}
  /// @param impulses of the rows over the step that ends now, N·s, held part included
  virtual void accept(const BodyStates& states, std::span<const double> impulses) = 0;
  /// Whether accept_work() wants to know.
  virtual bool counts_work() const { return false; }
  /// After accept(), by small steps: what those impulses did on the bodies, J. Where counts_work().
  virtual void accept_work(double /*work*/) {}
};

}  // namespace limber
