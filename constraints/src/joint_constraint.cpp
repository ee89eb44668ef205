#include "limber/constraints/joint_constraint.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <utility>

#include "limber/core/cross_matrix.h"
#include "limber/core/error.h"
#include "tuning.h"

namespace limber {
namespace {

Vec3 euler_xyz(const Mat3& Q) {
  return {std::atan2(-Q(1, 2), Q(2, 2)), std::asin(std::clamp(Q(0, 2), -1.0, 1.0)), std::atan2(-Q(0, 1), Q(0, 0))};
}

/// The vector a with a·ω = rate of the i-th Euler angle, in the axes of the first part.
Vec3 euler_rate(const Mat3& Q, int i) {
  const Vec3 angles = euler_xyz(Q);
  const Vec3 x = Vec3::UnitX();
  const Vec3 y(0.0, std::cos(angles.x()), std::sin(angles.x()));
  const Vec3 z = Q.col(2);
  const double determinant = std::max(x.dot(y.cross(z)), internal::kConstraintsTuning.rows.least_euler_determinant);
  const Vec3 dual = i == 0 ? y.cross(z) : i == 1 ? z.cross(x) : x.cross(y);
  return dual / determinant;
}

/// What it changes by with Q.
Vec3 euler_rate_change(const Mat3& Q, const Mat3& dQ, int i) {
  const double alpha = std::atan2(-Q(1, 2), Q(2, 2)), square = Q(1, 2) * Q(1, 2) + Q(2, 2) * Q(2, 2),
               dalpha = square > 0.0 ? (Q(1, 2) * dQ(2, 2) - Q(2, 2) * dQ(1, 2)) / square : 0.0;
  const Vec3 x = Vec3::UnitX(), y(0.0, std::cos(alpha), std::sin(alpha)), z = Q.col(2),
             dy = dalpha * Vec3(0.0, -std::sin(alpha), std::cos(alpha)), dz = dQ.col(2);
  const double determinant = x.dot(y.cross(z));
  if (!(determinant > internal::kConstraintsTuning.rows.least_euler_determinant)) return Vec3::Zero();
  const Vec3 dual = i == 0   ? y.cross(z)
                    : i == 1 ? z.cross(x)
                             : x.cross(y),
             change = i == 0   ? Vec3(dy.cross(z) + y.cross(dz))
                      : i == 1 ? dz.cross(x)
                               : x.cross(dy);
  return (change - dual * (x.dot(dy.cross(z) + y.cross(dz)) / determinant)) / determinant;
}

}  // namespace

JointConstraint::JointConstraint(MaterialFrame a, MaterialFrame b, const JointSpec& spec)
    : a_(std::move(a)), b_(std::move(b)), spec_(spec) {
  spec_.validate();
  plan();
}

void JointConstraint::set_actuation(int coordinate, const JointActuation& actuation) {
  if (coordinate < 0 || coordinate >= coordinates())
    throw InvalidArgument("JointConstraint: coordinate " + std::to_string(coordinate) + ", expected 0 to " +
                          std::to_string(coordinates() - 1) + " for a " + std::string(to_string(spec_.type)) +
                          " joint");
  actuation.validate();
  actuation_[static_cast<std::size_t>(coordinate)] = actuation;
  plan_actuation();
}

void JointConstraint::restore_state(StateReader& state) {
  state(*this);
  plan();
}

// What the rows are ---------------------------------------------------------------------------------------------------

void JointConstraint::plan() {
  plan_.clear();
  plan_locked_rows();
  plan_limits();
  plan_actuation();
}

void JointConstraint::plan_locked_rows() {
  const int rotations = freedoms(spec_.type).rotations;
  for (int axis = 0; axis < 3; ++axis) {
    bool is_free = false;
    for (int i = 0; i < coordinates(); ++i) is_free = is_free || (!is_rotation(spec_.type, i) && axis_of(i) == axis);
    if (!is_free) plan_.push_back({.measure = Measure::kTranslation, .axis = axis});
  }
  if (spec_.type == JointType::kCylindrical && spec_.pitch != 0.0) plan_.push_back({.measure = Measure::kScrew});
  for (int axis = 0; axis < 3 && rotations < 3; ++axis)
    if (rotations == 0 || axis != turning_axis())
      plan_.push_back({.measure = rotations == 0 ? Measure::kTurn : Measure::kAcross, .axis = axis});
}

void JointConstraint::plan_limits() {
  const JointLimits& limits = spec_.limits;
  for (int i = 0; i < coordinates(); ++i) {
    const Interval& interval = spec_.type == JointType::kBall ? limits.euler[static_cast<std::size_t>(i)]
                               : is_rotation(spec_.type, i)   ? limits.rotation
                                                            : limits.translation[static_cast<std::size_t>(axis_of(i))];
    if (std::isfinite(interval.low)) plan_.push_back(row_of(i, Law::kLimit, 1.0, interval.low));
    if (std::isfinite(interval.high)) plan_.push_back(row_of(i, Law::kLimit, -1.0, interval.high));
  }
  if (spec_.type == JointType::kBall && std::isfinite(limits.cone))
    plan_.push_back({.measure = Measure::kCone, .law = Law::kLimit, .sign = -1.0, .zero = limits.cone});
}

void JointConstraint::plan_actuation() {
  rows_ = plan_;
  for (int i = 0; i < coordinates(); ++i) {
    const JointActuation& act = actuation(i);
    if (act.motor_max_force > 0.0) rows_.push_back(row_of(i, Law::kMotor));
    if (act.drive_stiffness > 0.0 || act.drive_damping > 0.0)
      rows_.push_back(row_of(i, Law::kDrive, 1.0, act.drive_target));
    if (act.friction > 0.0) rows_.push_back(row_of(i, Law::kFriction));
  }
  sees_turns_ = std::ranges::any_of(rows_, [](const RowPlan& row) { return row.measure != Measure::kTranslation; });
  counts_turns_ = std::ranges::any_of(
      rows_, [](const RowPlan& row) { return row.measure == Measure::kAngle || row.measure == Measure::kScrew; });
}

JointConstraint::RowPlan JointConstraint::row_of(int coordinate, Law law, double sign, double zero) const {
  return {.measure = is_rotation(spec_.type, coordinate) ? Measure::kAngle : Measure::kTranslation,
          .law = law,
          .axis = axis_of(coordinate),
          .coordinate = coordinate,
          .sign = sign,
          .zero = zero};
}

// Coordinates ---------------------------------------------------------------------------------------------------------

int JointConstraint::axis_of(int coordinate) const { return spec_.type == JointType::kPlanar ? coordinate : 0; }

JointConstraint::Instant JointConstraint::instant(const BodyStates& states, StepTime when) const {
  return {.a = a_.at_end(states, when), .b = b_.at_end(states, when)};
}

/// With what rows look at: of b those of distances along a's axes see its origin alone.
JointConstraint::Instant JointConstraint::instant_of_rows(const BodyStates& states, StepTime when) const {
  return {.a = a_.at_end(states, when), .b = b_.at_end(states, when, sees_turns_)};
}

/// Of its coordinates, angles within half a turn.
Vec3 JointConstraint::raw_coordinates(const Instant& at) const {
  const Mat3 Q = at.a.axes.transpose() * at.b.axes;
  if (spec_.type == JointType::kBall) return euler_xyz(Q);
  Vec3 raw = Vec3::Zero();
  for (int i = 0; i < coordinates(); ++i) {
    const int x = (axis_of(i) + 1) % 3, y = (axis_of(i) + 2) % 3;
    raw[i] = is_rotation(spec_.type, i) ? std::atan2(Q(y, x) - Q(x, y), Q(x, x) + Q(y, y)) : at.d[axis_of(i)];
  }
  return raw;
}

/// Angles with the number of full turns that is nearest to the last step's.
double JointConstraint::unwrapped(double raw, int i) const {
  if (!is_rotation(spec_.type, i)) return raw;
  constexpr double kTurn = 2.0 * std::numbers::pi;
  return raw + kTurn * std::round((last_[static_cast<std::size_t>(i)] - raw) / kTurn);
}

// Gaps and their derivatives ------------------------------------------------------------------------------------------

/// What is across: an axis of b and that of a it is to be normal to, with the sign that makes the row a rotation. And
/// for rows that lock a turn the two products that make half the skew part of R_aᵀR_b, which is 0 where the turn is.
std::array<JointConstraint::TurnAxes, 2> JointConstraint::turn_axes(const RowPlan& row) const {
  const int j = (row.axis + 1) % 3, k = (row.axis + 2) % 3;
  if (row.measure == Measure::kTurn) return {TurnAxes{k, j, 0.5}, TurnAxes{j, k, -0.5}};
  return {k == turning_axis() ? TurnAxes{j, k, -1.0} : TurnAxes{k, j, 1.0}, {}};
}

double JointConstraint::measured(const Instant& at, const RowPlan& row) const {
  switch (row.measure) {
    case Measure::kTranslation:
      return at.d[row.axis];
    case Measure::kScrew:
      return at.d.x() - spec_.pitch * coordinate(at, 0);
    case Measure::kAcross: {
      const TurnAxes turn = turn_axes(row)[0];
      return turn.sign * at.a.axes.col(turn.of_a).dot(at.b.axes.col(turn.of_b));
    }
    case Measure::kTurn:
      return 2.0 * quaternion_from_matrix(at.a.axes.transpose() * at.b.axes).vector()[row.axis];
    case Measure::kAngle:
      return coordinate(at, row.coordinate);
    case Measure::kCone: {
      const Vec3 x_a = at.a.axes.col(0), x_b = at.b.axes.col(0);
      return std::atan2(x_a.cross(x_b).norm(), x_a.dot(x_b));
    }
  }
  return 0.0;
}

JointConstraint::Direction JointConstraint::direction(const Instant& at, const RowPlan& row) const {
  const Vec3 axis = row.sign * at.a.axes.col(row.axis);
  const auto across = [&](const TurnAxes& turn) {
    return Vec3(turn.sign * at.b.axes.col(turn.of_b).cross(at.a.axes.col(turn.of_a)));
  };
  switch (row.measure) {
    case Measure::kTranslation:
      return {.linear = axis};
    case Measure::kScrew:
      return {.linear = axis, .angular = -spec_.pitch * axis};
    case Measure::kAcross:
      return {.angular = across(turn_axes(row)[0])};
    case Measure::kTurn: {
      if (at.a.when == StepTime::kMiddle) return {.angular = across(turn_axes(row)[0]) + across(turn_axes(row)[1])};
      // d (2 vec q) = w ω + ω × vec q, in the axes of a
      const Quaternion q = normalized(quaternion_from_matrix(at.a.axes.transpose() * at.b.axes));
      return {.angular = at.a.axes * (q.w * Vec3::Unit(row.axis) + q.vector().cross(Vec3::Unit(row.axis)))};
    }
    case Measure::kAngle:
      if (spec_.type != JointType::kBall) return {.angular = axis};
      return {.angular = row.sign * (at.a.axes * euler_rate(at.a.axes.transpose() * at.b.axes, row.coordinate))};
    case Measure::kCone: {
      const Vec3 normal = at.a.axes.col(0).cross(at.b.axes.col(0));
      return {.angular = row.sign * (normal.norm() > 0.0 ? normal.normalized() : Vec3(-at.a.axes.col(1)))};
    }
  }
  return {};
}

/// What the angular part of direction() changes by with the axes, but for rows that turn_axes() tells.
Vec3 JointConstraint::direction_change(const Instant& at, const RowPlan& row, const Mat3& dR_a,
                                       const Mat3& dR_b) const {
  if (row.measure == Measure::kCone) {
    const Vec3 normal = at.a.axes.col(0).cross(at.b.axes.col(0)),
               change = dR_a.col(0).cross(at.b.axes.col(0)) + at.a.axes.col(0).cross(dR_b.col(0));
    const double size = normal.norm();
    if (!(size > 0.0)) return -row.sign * dR_a.col(1);
    return row.sign * (change - normal * (normal.dot(change) / (size * size))) / size;
  }
  if (row.measure == Measure::kScrew) return -spec_.pitch * dR_a.col(row.axis);
  if (spec_.type != JointType::kBall) return row.sign * dR_a.col(row.axis);
  const Mat3 Q = at.a.axes.transpose() * at.b.axes, dQ = dR_a.transpose() * at.b.axes + at.a.axes.transpose() * dR_b;
  return row.sign * (dR_a * euler_rate(Q, row.coordinate) + at.a.axes * euler_rate_change(Q, dQ, row.coordinate));
}

/// In the middle of the step an angle φ about an axis that both parts share changes by its direction times the relative
/// turn up to a factor: with Cayley vectors α of a and ρ of b against a, along the axis, |ρ| = 2 tan ½Δφ,
///   τ_b − τ_a = (1 + ¼α²)/(1 − ¼α·ρ) (1 − ½[α])⁻¹ρ,      (1 − ½[α])⁻¹ × the axis at the start = its mean
JointConstraint::Direction JointConstraint::mean_direction(const Instant& start, const Instant& end, const Instant& at,
                                                           const RowPlan& row, const Vec3& turn) const {
  Direction mean = direction(at, row);
  const bool turns = row.measure == Measure::kScrew || row.measure == Measure::kAngle;
  if (!turns || spec_.type == JointType::kBall) return mean;
  const int angle = row.measure == Measure::kScrew ? 0 : row.coordinate;
  const double half = 0.5 * (coordinate(end, angle) - coordinate(start, angle));
  const Vec3 axis = start.a.axes.col(row.axis), mean_axis = at.a.axes.col(row.axis);
  const double tangent = std::tan(half), ratio = half == 0.0 ? 1.0 : half / tangent;
  mean.angular *=
      ratio * (1.0 - 0.5 * tangent * turn.dot(axis)) / ((1.0 + 0.25 * turn.squaredNorm()) * mean_axis.squaredNorm());
  return mean;
}

// Rows of one step ----------------------------------------------------------------------------------------------------

void JointConstraint::write_law(const RowPlan& plan, double gap, RowParameters& law) const {
  law.gap = gap;
  if (plan.law >= Law::kMotor) return write_actuation_law(plan, gap, law);
  const double recovery = internal::kConstraintsTuning.rows.joint_recovery_speed * step_;
  law.holds = true;
  law.offset = gap - std::clamp(gap, -recovery, recovery);
  if (plan.law == Law::kLimit) law.lower = 0.0, law.offset = std::min(0.0, gap + recovery);
}

void JointConstraint::write_actuation_law(const RowPlan& plan, double gap, RowParameters& law) const {
  const JointActuation& act = actuation(plan.coordinate);
  law.goes_on = true;
  law.last_force = force_.actuation[actuator(plan)];
  if (plan.law == Law::kDrive) return law.make_spring(act.drive_stiffness, act.drive_damping, step_, gap);
  const bool motor = plan.law == Law::kMotor;
  law.upper = step_ * (motor ? act.motor_max_force : act.friction);
  law.lower = -law.upper;
  law.end_rate = motor ? act.motor_velocity : 0.0;
  law.prescribed_displacement = step_ * law.end_rate;
  law.offset = gap + law.prescribed_displacement;
}

/// All act at b's frame on both parts, opposite.
RowParameters& JointConstraint::add_row(const Instant& at, const Arms& arms, const RowPlan& plan,
                                        const Direction& along, ConstraintRows& rows) {
  const Vec3& n = along.linear;
  ConstraintRows::Row& row = rows.add();
  auto& [b, a] = row.sides;
  a.body = a_.body(), b.body = b_.body();
  for (int k = 0; k < 3; ++k) {
    a.linear[k] = -n[k], b.linear[k] = n[k];
    a.angular[k] = cross_component(n, arms.a, k) - along.angular[k];
    b.angular[k] = cross_component(arms.b, n, k) + along.angular[k];
  }
  a.modal_count = b.modal_count = 0;
  if (at.a.bend || at.b.bend) {
    FrameMeasure of_a, of_b;
    bend(at, plan, along, of_a, of_b);
    if (at.b.bend) b_.write_modal(at.b, of_b, modal_), rows.set_modal(b, modal_);
    if (at.a.bend) a_.write_modal(at.a, of_a, modal_), rows.set_modal(a, modal_);
  }
  rows.join(row);
  return row.law;
}

/// What modes add. Rows of axes and distances are exact for any step, in its middle too.
void JointConstraint::bend(const Instant& at, const RowPlan& plan, const Direction& along, FrameMeasure& of_a,
                           FrameMeasure& of_b) const {
  const FrameInstant &a = at.a, &b = at.b;
  if (plan.measure == Measure::kAcross || (plan.measure == Measure::kTurn && a.when == StepTime::kMiddle)) {
    for (const TurnAxes& turn : turn_axes(plan)) {
      if (turn.sign == 0.0) continue;
      if (a.bend) a.bend_axis(turn.of_a, turn.sign * b.axes.col(turn.of_b), of_a);
      if (b.bend) b.bend_axis(turn.of_b, turn.sign * a.axes.col(turn.of_a), of_b);
    }
    return;
  }
  if (b.bend) b.bend_origin(along.linear, of_b);
  if (plan.measure == Measure::kTranslation) {
    if (!a.bend) return;
    a.bend_axis(plan.axis, plan.sign * (b.position - a.position), of_a);
    a.bend_origin(-along.linear, of_a);
    return;
  }
  if (b.bend) b.bend_turn(along.angular, of_b);
  if (!a.bend) return;
  a.bend_point(b.position, -along.linear, of_a);
  a.bend_turn(-along.angular, of_a);
}

void JointConstraint::add_rows(const BodyStates& states, StepTime when, double step, ConstraintRows& rows) {
  if (when == StepTime::kMiddle) return add_mean_rows(states, rows);
  Instant at = instant_of_rows(states, when);
  at.a.find_turning(), at.b.find_turning();
  if (when == StepTime::kStart) step_ = step;
  if (when == StepTime::kStart && ends_step_) axes_at_start_ = at.a.axes;
  const Arms arms(at);
  const double square_a = at.a.body < 0 ? 0.0 : arms.a.squaredNorm(),
               square_b = at.b.body < 0 ? 0.0 : arms.b.squaredNorm(), length = std::sqrt(std::max(square_a, square_b)),
               from_origin = at.b.position.norm(),
               nearest = internal::kConstraintsTuning.rows.joint_tolerance * length + digits_of(from_origin),
               place_digits = digits_of(length + from_origin);
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    const RowPlan& plan = rows_[i];
    RowParameters& law = add_row(at, arms, plan, direction(at, plan), rows);
    const bool distance = is_distance(plan);
    const double gap = this->gap(at, plan);
    write_law(plan, gap, law);
    law.tolerance = distance ? nearest : internal::kConstraintsTuning.rows.joint_tolerance;
    law.digits = distance ? place_digits : digits_of(1.0 + std::abs(gap));
    if (i < force_.plan.size()) law.last_force = force_.plan[i];
  }
}

/// What the rows are to be met by is told at the step's start.
void JointConstraint::add_mean_rows(const BodyStates& states, ConstraintRows& rows) {
  const Instant start = instant(states, StepTime::kStart), end = instant(states, StepTime::kEnd),
                at{.a = a_.between(start.a, end.a), .b = b_.between(start.b, end.b)};
  const Vec3 turn = a_.turn(states);
  const Arms arms(at);
  for (const RowPlan& plan : rows_) add_row(at, arms, plan, mean_direction(start, end, at, plan, turn), rows);
}

void JointConstraint::add_force_derivative(const BodyStates& states, std::span<const double> impulses,
                                           ForceDerivative& sum) const {
  using Of = ForceDerivative::Of;
  using By = ForceDerivative::By;
  const Instant start = instant(states, StepTime::kStart), end = instant(states, StepTime::kEnd),
                mean{.a = a_.between(start.a, end.a), .b = b_.between(start.b, end.b)};
  // On b, by the mean rows; as the rows of the end would have it; and how the couple follows the turns of a and b.
  Vec3 force = Vec3::Zero(), force_end = Vec3::Zero();
  Mat3 by_a = Mat3::Zero(), by_b = Mat3::Zero();
  for (std::size_t i = 0; i < impulses.size(); ++i) {
    const RowPlan& plan = rows_[i];
    const double p = impulses[i];
    if (p == 0.0) continue;
    const Direction along = direction(mean, plan), there = direction(end, plan);
    force += p * along.linear, force_end += p * there.linear;
    if (along.angular.isZero(0.0)) continue;
    if (plan.measure == Measure::kAcross || plan.measure == Measure::kTurn) {
      for (const auto& [axis_a, axis_b, sign] : turn_axes(plan)) {  // the couple on b is b × a
        by_a -= 0.5 * sign * p * cross_matrix(mean.b.axes.col(axis_b)) * cross_matrix(end.a.axes.col(axis_a));
        by_b += 0.5 * sign * p * cross_matrix(mean.a.axes.col(axis_a)) * cross_matrix(end.b.axes.col(axis_b));
      }
    } else {
      for (int k = 0; k < 3; ++k) {
        const Mat3 turn = 0.5 * cross_matrix(Vec3::Unit(k));
        by_a.col(k) += p * direction_change(mean, plan, turn * end.a.axes, Mat3::Zero());
        by_b.col(k) += p * direction_change(mean, plan, Mat3::Zero(), turn * end.b.axes);
      }
    }
  }
  const Index a = a_.body(), b = b_.body();
  if (b >= 0) sum.add_bending(b, force, b_.displacements(states, shapes_));
  if (a >= 0) sum.add_bending(a, -force, a_.displacements(states, shapes_));
  const Mat3 F = cross_matrix(force), F_end = cross_matrix(force_end);
  if (b >= 0) {
    const Vec3 to_b = mean.b.position - states.origin(b, StepTime::kMiddle),
               arm = end.b.position - states.origin(b, StepTime::kEnd);
    sum.add(b, Of::kMoment, b, By::kTurn, 0.5 * F * cross_matrix(arm) + by_b);
    if (a >= 0) {
      sum.add(b, Of::kForce, a, By::kTurn, -0.5 * F_end);
      sum.add(b, Of::kMoment, a, By::kTurn, -0.5 * cross_matrix(to_b) * F_end + by_a);
      sum.add(a, Of::kMoment, b, By::kTurn, -0.5 * F * cross_matrix(arm) - by_b);
      sum.add(a, Of::kMoment, b, By::kShift, 0.5 * F);
    }
  }
  if (a >= 0) {
    const Vec3 to_b = mean.b.position - states.origin(a, StepTime::kMiddle);
    sum.add(a, Of::kForce, a, By::kTurn, 0.5 * F_end);
    sum.add(a, Of::kMoment, a, By::kTurn, 0.5 * cross_matrix(to_b) * F_end - by_a);
    sum.add(a, Of::kMoment, a, By::kShift, -0.5 * F);
  }
}

void JointConstraint::gaps(const BodyStates& states, StepTime when, std::span<double> gaps) const {
  const Instant at = instant_of_rows(states, when);
  for (std::size_t i = 0; i < gaps.size(); ++i) gaps[i] = gap(at, rows_[i]);
}

void JointConstraint::accept(const BodyStates& states, std::span<const double> impulses) {
  const double by = 1.0 / step_;
  force_.actuation = {};
  force_.plan.resize(plan_.size());
  for (std::size_t i = 0; i < impulses.size(); ++i) last_force(i) = by * impulses[i];
  if (ends_step_) sum_forces();
  if (!ends_step_ && !counts_turns_) return;
  const Instant at = instant(states, StepTime::kStart);  // the state has been taken: the step's end
  const Vec3 raw = raw_coordinates(at);
  for (int i = 0; i < coordinates(); ++i) last_[static_cast<std::size_t>(i)] = unwrapped(raw[i], i);
}

/// What is told of a step.
void JointConstraint::sum_forces() {
  force_.coordinate = {}, force_.locked.setZero();
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    const RowPlan& plan = rows_[i];
    const double force = last_force(i);
    if (plan.coordinate >= 0)
      force_.coordinate[static_cast<std::size_t>(plan.coordinate)] += plan.sign * force;
    else if (plan.measure == Measure::kTranslation)
      force_.locked += force * axes_at_start_.col(plan.axis);
  }
}

JointConstraint::Error JointConstraint::error(const BodyStates& states) const {
  const Instant at = instant(states, StepTime::kStart);
  Vec3 distance = Vec3::Zero(), angle = Vec3::Zero();
  for (const RowPlan& plan : plan_) {
    if (plan.law == Law::kLocked) (is_distance(plan) ? distance : angle)[plan.axis] = gap(at, plan);
  }
  return {distance.norm(), angle.norm()};
}

}  // namespace limber
