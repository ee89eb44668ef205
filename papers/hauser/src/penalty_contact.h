// Contacts whose normals are springs: [H03]'s first method, with the spring at the step's end.
#pragma once

#include <vector>

#include "limber/constraints/constraint.h"

namespace limber::internal {

/// A pair's contacts with other laws: F = −k x' − c (x' − min(0, x))/Δt ≥ 0, x the gap at the step's start and x' at
/// its end.
class PenaltyContact final : public Constraint {
 public:
  /// @param contact kept by reference. @param frequency Hz. @param damping share of the critical one
  void set(Constraint& contact, double frequency, double damping);

  std::array<Index, 2> bodies() const override { return contact_->bodies(); }
  void begin_part(const PartOfStep& part) override { contact_->begin_part(part); }
  void add_rows(const BodyStates& states, StepTime when, double step, ConstraintRows& rows) override;
  void gaps(const BodyStates& states, StepTime when, std::span<double> gaps) const override {
    contact_->gaps(states, when, gaps);
  }
  void add_force_derivative(const BodyStates& states, std::span<const double> impulses,
                            ForceDerivative& sum) const override {
    contact_->add_force_derivative(states, impulses, sum);
  }
  bool is_contact() const override { return contact_->is_contact(); }
  bool may_be_divided() const override { return contact_->may_be_divided(); }
  void slid(std::span<const double> slip) override { contact_->slid(slip); }
  void accept(const BodyStates& states, std::span<const double> impulses) override {
    contact_->accept(states, impulses);
  }

 private:
  Constraint* contact_ = nullptr;
  double frequency_ = 0.0, damping_ = 0.0;
  std::vector<double> gaps_;
};

}  // namespace limber::internal
