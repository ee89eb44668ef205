#include "pair_contacts.h"

#include <algorithm>
#include <cmath>

#include "limber/core/cross_matrix.h"
#include "tuning.h"

namespace limber {
namespace {

/// Where a side touches, at a step's end or in its middle.
Vec3 place(const BodyStates& states, StepTime when, const PreparedSide& side) {
  if (when != StepTime::kMiddle) return side.position(states, when);
  return 0.5 * (side.position(states, StepTime::kStart) + side.position(states, StepTime::kEnd));
}

/// Of the place where both forces act, that of a side's point: the other's is 1 less.
double share_of_place(const PreparedContact& contact, std::size_t side) {
  if (is_round(contact.a) == is_round(contact.b)) return 0.5;
  return is_round(contact.side(side)) ? 1.0 : 0.0;
}

/// Where both forces act. What is round touches at its own point, wherever that of the other has gone.
Vec3 point_of_action(const PreparedContact& contact, const Vec3& a, const Vec3& b) {
  return share_of_place(contact, 0) * a + share_of_place(contact, 1) * b;
}

double reduced_mass(const BodyStates& states, const PreparedContact& contact) {
  double inverse = 0.0;
  for (const PreparedSide* side : {&contact.a, &contact.b})
    if (!states.is_static(side->body)) inverse += 1.0 / states.body(side->body).group->frame_constants().mass;
  return 1.0 / inverse;
}

}  // namespace

void PairContacts::set(std::span<PreparedContact> contacts, const ContactOptions& options,
                       ContactIndentations& indentations) {
  contacts_ = contacts;
  options_ = &options;
  indentations_ = &indentations;
  const PreparedContact& first = contacts.front();
  flexes_ = flexes(first.a) || flexes(first.b);
  yields_ = {options.residual_compliance && yields(first.a), options.residual_compliance && yields(first.b)};
}

void PairContacts::add_rows(const BodyStates& states, StepTime when, double step, ConstraintRows& rows) {
  step_ = step;
  if (when == StepTime::kStart) begin(states);
  const Index first = rows.size();
  for (const PreparedContact& contact : contacts_) add_contact(states, when, contact, rows);
  if (when == StepTime::kStart) add_flexibility(states, first, rows);
}

void PairContacts::gaps(const BodyStates& states, StepTime when, std::span<double> gaps) const {
  const bool start = when == StepTime::kStart;
  visit_rows([&](const PreparedContact& contact, std::size_t row) {
    const Vec3 apart = contact.apart(states, when), indentation = start ? indentation_of(contact) : Vec3(Vec3::Zero());
    gaps[row] = contact.axes.col(0).dot(apart) + indentation[0];
    if (contact.friction == 0.0) return;
    Vec3 slip = apart - contact.offset;
    if (!start) slip += contact.a.rolled(states, step_) - contact.b.rolled(states, step_);
    for (int t = 1; t < 3; ++t)
      gaps[row + static_cast<std::size_t>(t)] = contact.axes.col(t).dot(slip) + indentation[t];
  });
}

void PairContacts::slid(std::span<const double> slip) {
  visit_rows([&](PreparedContact& contact, std::size_t row) { contact.slip = slip[row]; });
}

void PairContacts::accept(const BodyStates&, std::span<const double> impulses) {
  visit_rows([&](PreparedContact& contact, std::size_t row) {
    const Vec3 impulse = contact.impulse_of(impulses.subspan(row));
    contact.last_force = impulse / step_;
    contact.compliance = compliance_;
    contact.impulse += impulse;
    for (std::size_t i = 0; i < 2; ++i) {
      const PreparedSide& side = contact.side(i);
      if (yields_[i])
        indentations_->press(side.body, side.corners,
                             side.turned_back(turn_[i].conjugate() * (PreparedContact::sign(i) * contact.last_force)));
    }
  });
}

void PairContacts::begin(const BodyStates& states) {
  for (PreparedContact& contact : contacts_) contact.offset = contact.apart(states, StepTime::kStart);
  const PreparedContact& first = contacts_.front();
  for (std::size_t i = 0; i < 2; ++i)
    if (yields_[i]) turn_[i] = states.pose(first.side(i).body, StepTime::kStart).q;
  for (PreparedContact& contact : contacts_)
    for (const PreparedSide* side : {&contact.a, &contact.b})
      if (side->turn != nullptr)
        *side->turn = side->shape(states.amplitudes(side->body, StepTime::kStart)).turn(side->at);
  compliance_ = options_->compliance > 0.0 && flexes_ ? compliance(states) : 0.0;
  indentation_.clear();
  for (const PreparedContact& contact : contacts_) {
    Vec3 indentation = Vec3::Zero();
    for (std::size_t i = 0; i < 2; ++i) {
      const PreparedSide& side = contact.side(i);
      if (yields_[i])
        indentation += PreparedContact::sign(i) *
                       (turn_[i] * side.turned(indentations_->displacement(states, side.body, side.corners)));
    }
    indentation_.push_back(contact.axes.transpose() * (indentation + contact.compliance * contact.last_force));
  }
  caught_ = flexes_ && is_caught();
}

double PairContacts::compliance(const BodyStates& states) const {
  const double share = yields_[0] || yields_[1] ? internal::kConstraintsTuning.rows.compliance_beside_residual : 1.0;
  return share * options_->compliance * step_ * step_ / reduced_mass(states, contacts_.front());
}

bool PairContacts::is_caught() const {
  const auto overlaps = [](const PreparedContact& c) { return c.axes.col(0).dot(c.offset) < 0.0; };
  for (const PreparedContact& contact : contacts_)
    if (overlaps(contact) && std::ranges::any_of(contacts_, [&](const PreparedContact& other) {
          return overlaps(other) &&
                 contact.axes.col(0).dot(other.axes.col(0)) < internal::kConstraintsTuning.rows.opposed_normals;
        }))
      return true;
  return false;
}

/// Of the moments, by where the bodies end: forces keep their directions, and act midway between where the points were
/// and are.
void PairContacts::add_force_derivative(const BodyStates& states, std::span<const double> impulses,
                                        ForceDerivative& sum) const {
  using Of = ForceDerivative::Of;
  using By = ForceDerivative::By;
  visit_rows([&](const PreparedContact& contact, std::size_t row) {
    const Vec3 impulse = contact.impulse_of(impulses.subspan(row));
    if (impulse.isZero(0.0)) return;
    for (std::size_t pressed = 0; pressed < 2; ++pressed) {
      const Index of = contact.side(pressed).body;
      if (states.is_static(of)) continue;
      const Mat3 half = 0.5 * PreparedContact::sign(pressed) * cross_matrix(impulse);
      sum.add(of, Of::kMoment, of, By::kShift, half);
      for (std::size_t moved = 0; moved < 2; ++moved) {
        const PreparedSide& side = contact.side(moved);
        if (states.is_static(side.body)) continue;
        const Vec3 arm = side.position(states, StepTime::kEnd) - side.rim - states.origin(side.body, StepTime::kEnd);
        const Mat3 by_place = -share_of_place(contact, moved) * half;
        sum.add(of, Of::kMoment, side.body, By::kShift, by_place);
        sum.add(of, Of::kMoment, side.body, By::kTurn, -by_place * cross_matrix(arm));
      }
    }
  });
}

void PairContacts::add_compliance(Index first, ConstraintRows& rows) const {
  for (Index row = first; compliance_ > 0.0 && row < rows.size(); ++row) rows.add_compliance(row, compliance_);
  double stored = 0.0;
  for (const PreparedContact& contact : contacts_)
    stored += 0.5 * contact.compliance * contact.last_force.squaredNorm();
  rows.add_stored_energy(stored);
}

void PairContacts::add_flexibility(const BodyStates& states, Index first, ConstraintRows& rows) {
  add_compliance(first, rows);
  for (std::size_t i = 0; i < 2; ++i) {
    if (!yields_[i]) continue;
    const Mat3 R = to_matrix(turn_[i]);
    visit_rows([&](const PreparedContact& contact, std::size_t row) {
      const PreparedSide& side = contact.side(i);
      Mat3 axes = PreparedContact::sign(i) * (R.transpose() * contact.axes);
      for (Index axis = 0; axis < 3; ++axis) axes.col(axis) = side.turned_back(axes.col(axis));
      indentations_->add_rows(states, side.body, {side.corners, axes, first + static_cast<Index>(row), contact.rows()},
                              rows);
    });
  }
}

void PairContacts::add_contact(const BodyStates& states, StepTime when, const PreparedContact& contact,
                               ConstraintRows& rows) {
  const Vec3 a = place(states, when, contact.a), b = place(states, when, contact.b);
  const Vec3 end = point_of_action(contact, a, b);
  const double tolerance = gap_tolerance(states, when, contact, a, b);
  for (Index axis = 0; axis < contact.rows(); ++axis) {
    const Vec3 n = contact.axes.col(axis);
    RowParameters law{.tolerance = tolerance, .contact = true};
    if (axis == 0) {
      const double gap = n.dot(a - b) + (when == StepTime::kStart ? indentation_of(contact)[0] : 0.0);
      const double recovery = caught_
                                  ? 0.0
                                  : std::min(internal::kConstraintsTuning.rows.overlap_recovery * std::max(0.0, -gap),
                                             step_ * options_->recovery_speed);
      law.offset = std::min(0.0, gap) + recovery;
      law.prescribed_displacement = recovery;
      law.lower = 0.0;
      law.holds = true;
      law.friction = contact.friction;
      law.shift = contact.friction * contact.slip;
    } else {
      law.offset = indentation_of(contact)[axis];
      law.slides = true;
      law.goes_on = true;
    }
    law.last_force = n.dot(contact.last_force);
    const RowSide on_a = point_row(states, when, contact.a, end, n, modal_[0]);
    const RowSide on_b = point_row(states, when, contact.b, end, -n, modal_[1]);
    rows.add(on_a, on_b, law);
  }
}

}  // namespace limber
