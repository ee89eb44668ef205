/// @file limber/constraints/handle.h
/// Direct manipulation: a point of a body is held, dragged or pulled ([H03] section 3.4.1, position level).
///
/// The point is asked to be at its target at the *end* of the step. A handle without stiffness puts it there, to
/// round-off, whatever the body's stiffness, as far as the held rows do not exceed what the body can do; conflicting
/// handles meet in the least-squares sense. One with stiffness k and damping c pulls like a spring and a damper,
/// evaluated at the end of the step, and so is stable for every k and c:
///   F = −k (p − target) − c d/dt (p − target)
#pragma once

#include <tuple>
#include <vector>

#include "limber/constraints/material_frame.h"

namespace limber {

struct HandleOptions {
  /// World directions in which the point is held: 1 to 3, orthonormal. Empty: all three.
  std::vector<Vec3> directions{};
  double max_force = kUnbounded;  ///< N, along each direction; > 0
  double stiffness = 0.0;         ///< k, N/m; 0: the target is met exactly
  double damping = 0.0;           ///< c, N·s/m; ≥ 0, only with a stiffness
  void validate() const;          ///< @throws InvalidArgument naming the field and its value
};

/// Where a handle wants its point.
struct HandleTarget {
  Vec3 position = Vec3::Zero();  ///< world, at the end of the coming step, m
  Vec3 velocity = Vec3::Zero();  ///< world, after it, m/s: the target goes on by itself
};

class Handle final : public Constraint {
 public:
  /// @param start world: where the target is now, usually the point itself
  Handle(MaterialFrame point, const Vec3& start, const HandleOptions& options = {});

  void set_target(const HandleTarget& target);
  const HandleTarget& target() const { return next_; }
  /// Where the target is at the start of the coming step, world, m.
  const Vec3& target_now() const { return now_; }
  const HandleOptions& options() const { return options_; }
  const MaterialFrame& point() const { return point_; }
  /// Mean force on the body over the last step, world, N.
  const Vec3& force() const { return force_; }
  /// What it did on the body over the last step, J. ContactSolver::kGame: the energy that its impulses gave, to
  /// round-off. kExact: each part's force along the point's way in it.
  double work() const { return work_; }
  /// Distance from the target along the held directions now, between steps, m.
  double error(const BodyStates& states) const;

  std::array<Index, 2> bodies() const override { return {point_.body(), -1}; }
  bool may_be_divided() const override { return true; }
  void begin_part(const PartOfStep& part) override;
  void add_force_derivative(const BodyStates& states, std::span<const double> impulses,
                            ForceDerivative& sum) const override;
  void add_rows(const BodyStates& states, StepTime when, double step, ConstraintRows& rows) override;
  void gaps(const BodyStates& states, StepTime when, std::span<double> gaps) const override;
  void accept(const BodyStates& states, std::span<const double> impulses) override;
  bool counts_work() const override { return true; }
  void accept_work(double work) override { work_ += work - part_work_; }

 private:
  friend struct StateFields;
  template <class Self>
  static auto state_fields(Self& s) {
    return std::tie(s.point_, s.options_.directions, s.options_.max_force, s.options_.stiffness, s.options_.damping,
                    s.now_, s.next_.position, s.next_.velocity, s.work_, s.force_, s.last_force_);
  }

  MaterialFrame point_;
  HandleOptions options_;
  Vec3 now_, then_;  // the target at the start and at the end of the step's part at hand
  HandleTarget next_;
  double step_ = 0.0, left_ = 0.0, whole_ = 0.0, work_ = 0.0;  // of the part; of the step
  double part_work_ = 0.0;                                     // J, by the point's way in the last part
  Vec3 from_ = Vec3::Zero();                                   // where the point is at the start of the part
  Vec3 force_ = Vec3::Zero();
  std::array<double, 3> last_force_{};
  std::vector<double> modal_;
  mutable std::vector<Vec3> shapes_;  // scratch of add_force_derivative()
};

}  // namespace limber
