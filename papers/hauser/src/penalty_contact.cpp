#include "penalty_contact.h"

#include <algorithm>
#include <numbers>

namespace limber::internal {
namespace {

double reduced_mass(const BodyStates& states, const ConstraintRows::Row& row) {
  double inverse = 0.0;
  for (const ConstraintRows::Side& side : row.sides)
    if (!states.is_static(side.body)) inverse += 1.0 / states.body(side.body).group->frame_constants().mass;
  return 1.0 / inverse;
}

}  // namespace

void PenaltyContact::set(Constraint& contact, double frequency, double damping) {
  contact_ = &contact;
  frequency_ = frequency, damping_ = damping;
}

void PenaltyContact::add_rows(const BodyStates& states, StepTime when, double step, ConstraintRows& rows) {
  const Index first = rows.size();
  contact_->add_rows(states, when, step, rows);
  if (when == StepTime::kMiddle) return;  // laws count at the ends
  gaps_.resize(static_cast<std::size_t>(rows.size() - first));
  contact_->gaps(states, when, gaps_);
  for (Index i = first; i < rows.size(); ++i) {
    RowParameters& law = rows.row(i).law;
    if (!law.contact || law.slides) continue;
    const double mass = reduced_mass(states, rows.row(i)), omega = 2.0 * std::numbers::pi * frequency_;
    law.make_spring(mass * omega * omega, 2.0 * damping_ * mass * omega, step,
                    std::min(0.0, gaps_[static_cast<std::size_t>(i - first)]));
    law.holds = false;
    law.prescribed_displacement = 0.0;
  }
}

}  // namespace limber::internal
