/// @file rolling_resistance.h
/// What keeps round bodies from rolling on others without end.
///
///   |m| ≤ C Σ R F_n,   m opposes the relative turn of the step
///
/// m is a moment, C the coefficient of rolling resistance, F_n the normal forces of the pair's contacts in the last
/// step, R the distance of each from the nearer of the two bodies' origins. For a ball of radius R that rolls on a
/// plane, C F_n is the force at its rim (Bowden and Tabor, *The Friction and Lubrication of Solids*, 1964). The bound
/// lags by a step, and the moment never does work on the bodies.
#pragma once

#include "limber/constraints/constraint.h"

namespace limber {

class RollingResistance final : public Constraint {
 public:
  /// @param largest C Σ R F_n, N·m, > 0. @param last what acted on a in the last step, world, N·m
  void set(Index a, Index b, double largest, const Vec3& last);

  std::array<Index, 2> bodies() const override { return {a_, b_}; }
  void add_rows(const BodyStates& states, StepTime when, double step, ConstraintRows& rows) override;
  void gaps(const BodyStates& states, StepTime when, std::span<double> gaps) const override;
  bool is_contact() const override { return true; }
  void accept(const BodyStates& states, std::span<const double> impulses) override;

  /// On a, mean over the step, world, N·m.
  const Vec3& moment() const { return moment_; }

 private:
  Index a_ = -1, b_ = -1;
  double largest_ = 0.0, step_ = 0.0;
  Vec3 moment_ = Vec3::Zero();
};

}  // namespace limber
