#include "rolling_resistance.h"

#include "contact_geometry.h"

namespace limber {
namespace {

// Turns are braked to this, rad.
constexpr double kTolerance = 1e-9;

Vec3 angular_velocity(const BodyStates& states, Index body) {
  return states.is_static(body) ? Vec3(Vec3::Zero()) : states.angular_velocity(body, StepTime::kStart);
}

}  // namespace

void RollingResistance::set(Index a, Index b, double largest, const Vec3& last) {
  a_ = a, b_ = b, largest_ = largest, moment_ = last;
}

void RollingResistance::add_rows(const BodyStates& states, StepTime when, double step, ConstraintRows& rows) {
  if (when == StepTime::kStart) {
    step_ = step;
    const Vec3 w = angular_velocity(states, a_) - angular_velocity(states, b_);
    const double speed = w.norm();
    axes_ = frame_along(speed > kTolerance / step ? Vec3(w / speed) : Vec3(Vec3::UnitX()));
  }
  for (Index i = 0; i < 3; ++i) {
    const Vec3 axis = axes_.col(i);
    const auto side = [&](Index body, double sign) {
      return states.is_static(body) ? RowSide{} : RowSide{.body = body, .angular = sign * axis};
    };
    rows.add(side(a_, 1.0), side(b_, -1.0),
             {.lower = -step_ * largest_,
              .upper = step_ * largest_,
              .tolerance = kTolerance,
              .goes_on = true,
              .last_force = axis.dot(moment_),
              .contact = true});
  }
}

void RollingResistance::gaps(const BodyStates& states, StepTime when, std::span<double> gaps) const {
  const Vec3 turned = when == StepTime::kStart
                          ? Vec3(Vec3::Zero())
                          : Vec3(axes_.transpose() * (turn_of_step(states, a_) - turn_of_step(states, b_)));
  for (Index i = 0; i < 3; ++i) gaps[static_cast<std::size_t>(i)] = turned[i];
}

void RollingResistance::accept(const BodyStates&, std::span<const double> impulses) {
  moment_ = axes_ * Vec3(impulses[0], impulses[1], impulses[2]) / step_;
}

}  // namespace limber
