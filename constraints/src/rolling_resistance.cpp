#include "rolling_resistance.h"

#include "prepared_contact.h"
#include "tuning.h"

namespace limber {
void RollingResistance::set(Index a, Index b, double largest, const Vec3& last) {
  a_ = a, b_ = b, largest_ = largest, moment_ = last;
}

/// About the world's axes: a ball looks the same from all sides.
void RollingResistance::add_rows(const BodyStates& states, StepTime, double step, ConstraintRows& rows) {
  step_ = step;
  const double radius = step * largest_;
  for (int i = 0; i < 3; ++i) {
    const Vec3 axis = Vec3::Unit(i);
    const auto side = [&](Index body, double sign) {
      return states.is_static(body) ? RowSide{} : RowSide{.body = body, .angular = sign * axis};
    };
    rows.add(side(a_, 1.0), side(b_, -1.0),
             {.lower = -radius,
              .upper = radius,
              .tolerance = internal::kConstraintsTuning.rows.rolling_tolerance,
              .goes_on = true,
              .last_force = moment_[i],
              .radius = radius,
              .contact = true});
  }
}

void RollingResistance::gaps(const BodyStates& states, StepTime when, std::span<double> gaps) const {
  Vec3 turned = Vec3::Zero();
  if (when == StepTime::kEnd) turned = turn_of_step(states, a_, step_) - turn_of_step(states, b_, step_);
  for (int i = 0; i < 3; ++i) gaps[static_cast<std::size_t>(i)] = turned[i];
}

void RollingResistance::accept(const BodyStates&, std::span<const double> impulses) {
  moment_ = Vec3(impulses[0], impulses[1], impulses[2]) / step_;
}

}  // namespace limber
