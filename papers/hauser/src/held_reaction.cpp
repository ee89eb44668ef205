#include "held_reaction.h"

#include <algorithm>
#include <cmath>

namespace limber::internal {
namespace {

constexpr double kRestsWithin = 2.0;  // tolerances of a gap, by which a row that lies still may be open

FrameAcceleration held_acceleration(const BodyGroup& group, Index slot, StepTime when, const BodyResponse& r,
                                    const Vec3& gravity) {
  const FrameConstants& c = group.frame_constants();
  Vec3 torque = group.held_torque(slot);
  FrameAcceleration a;
  if (c.motion == FrameMotion::kFree)
    a.linear = gravity + group.held_force(slot) / c.mass;
  else
    torque += (frame_at(group, slot, when).pose().q * group.first_moment(slot)).cross(gravity);
  for (int i = 0; i < r.rotations; ++i) a.angular += r.axes.col(i) * (r.inverse_moments[i] * r.axes.col(i).dot(torque));
  return a;
}

/// Whether bodies lie still on a row of one sign: closed, and slower than what held forces make of rest in a step.
bool rests(const RowParameters& law, double gap, const HeldReaction::Motion& held) {
  const double open = gap - law.offset, within = kRestsWithin * law.tolerance;
  const bool closed = (law.lower < 0.0 || open <= within) && (law.upper > 0.0 || open >= -within);
  return closed && std::abs(held.speed) <= held.speed_of_a_step;
}

const ConstraintRows& rows_at(const IslandStep& step, StepTime when) {
  return when == StepTime::kStart ? step.rows : step.end_rows;
}

}  // namespace

void HeldReaction::find(IslandStep& step, StepTime when) {
  std::vector<double>& forces = when == StepTime::kStart ? step.reaction : step.end_reaction;
  std::ranges::fill(forces, 0.0);
  find_accelerations(step, when);
  if (!bound_rows(step, when)) return;
  weigh_frames(step, rows_at(step, when));
  answer(forces);
}

void HeldReaction::find_accelerations(const IslandStep& step, StepTime when) {
  accelerations_.clear();
  for (Index local = 0; local < step.bodies.count(); ++local)
    accelerations_.push_back(held_acceleration(*step.bodies.body(local).group, step.bodies.body(local).slot, when,
                                               step.bodies.response(local), step.gravity_of(local)));
}

HeldReaction::Motion HeldReaction::motion_of(const IslandStep& step, StepTime when, Index row) const {
  Motion motion;
  double inverse_mass = 0.0, acceleration_squared = 0.0;
  for (const ConstraintRows::Side& side : rows_at(step, when).row(row).sides) {
    const Index local = step.bodies.local(side.body);
    if (local < 0) continue;
    const auto& [group, slot, pose] = step.bodies.body(local);
    const FrameConstants& c = group->frame_constants();
    const BodyResponse& r = step.bodies.response(local);
    const RigidFrame& frame = frame_at(*group, slot, when);
    const FrameAcceleration& a = accelerations_[static_cast<std::size_t>(local)];
    motion.acceleration += side.linear.dot(a.linear) + side.angular.dot(a.angular);
    motion.speed += side.linear.dot(frame.velocity()) + side.angular.dot(frame.angular_velocity(c));
    if (r.translations > 0) {
      inverse_mass += r.inverse_mass * side.linear.squaredNorm();
      acceleration_squared += a.linear.squaredNorm() / r.inverse_mass;
    }
    for (int i = 0; i < r.rotations; ++i) {
      const double turn = r.axes.col(i).dot(side.angular), turned = r.axes.col(i).dot(a.angular);
      inverse_mass += r.inverse_moments[i] * turn * turn;
      acceleration_squared += turned * turned / r.inverse_moments[i];
    }
  }
  // |J a| ≤ |J|_{M⁻¹} |a|_M, whatever other rows make of a.
  motion.speed_of_a_step = step.length() * std::sqrt(inverse_mass * acceleration_squared);
  return motion;
}

/// What each row may answer: nothing, what it did before (where its force goes on), or what it takes.
/// @return whether any has to
bool HeldReaction::bound_rows(const IslandStep& step, StepTime when) {
  const ConstraintRows& rows = rows_at(step, when);
  for (std::vector<double>* v : {&b_, &lower_, &upper_}) v->assign(step.size(), 0.0);
  equalities_ = true;
  bool any = false, rested = false;  // the normal row of the contact at hand
  for (Index i = 0; i < rows.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    const RowParameters& law = rows.row(i).law;
    const Motion held = motion_of(step, when, i);
    const bool lies = rests(law, step.gap[at], held);
    if (law.friction > 0.0) rested = lies;
    double lower = law.lower / step.length(), upper = law.upper / step.length();
    if (law.goes_on && (!law.slides || rested)) {
      const double force = when == StepTime::kStart ? law.last_force : step.f[at] / step.length() + step.reaction[at];
      lower = upper = std::clamp(force, lower, upper);
      equalities_ = equalities_ && lower == 0.0;
      b_[at] = lower == 0.0 ? 0.0 : held.acceleration;
    } else if (law.holds && (is_equality(law) || lies)) {
      equalities_ = equalities_ && is_equality(law);
      b_[at] = held.acceleration;
    } else {
      continue;
    }
    lower_[at] = lower, upper_[at] = upper;
    any = any || b_[at] != 0.0 || lower > 0.0 || upper < 0.0;
  }
  return any;
}

/// J M^−½ of the frames alone, as the modes answer to held forces by themselves; rows that answer nothing have none.
void HeldReaction::weigh_frames(const IslandStep& step, const ConstraintRows& rows) {
  columns_.clear(), metric_.clear();
  for (Index local = 0; local < step.bodies.count(); ++local) {
    const BodyResponse& r = step.bodies.response(local);
    columns_.push_back(metric_.size());
    one_row_.resize(static_cast<std::size_t>(r.size()));
    r.write_frame_metric(one_row_.data());
    metric_.insert(metric_.end(), one_row_.begin(), one_row_.begin() + r.translations + r.rotations);
  }
  const std::size_t n = metric_.size();
  G_.assign(step.size() * n, 0.0);
  for (std::size_t at = 0; at < step.size(); ++at) {
    if (lower_[at] == 0.0 && upper_[at] == 0.0) continue;
    double* row = G_.data() + at * n;
    for (const ConstraintRows::Side& side : rows.row(static_cast<Index>(at)).sides) {
      const Index local = step.bodies.local(side.body);
      if (local < 0) continue;
      step.bodies.response(local).add_row(side.linear, side.angular, {},
                                          row + columns_[static_cast<std::size_t>(local)]);
    }
    for (std::size_t k = 0; k < n; ++k) row[k] *= std::sqrt(metric_[k]);
  }
}

/// To accelerations b within the bounds.
void HeldReaction::answer(std::span<double> forces) {
  const std::size_t m = forces.size(), n = metric_.size();
  if (equalities_) {
    std::ranges::fill(metric_, 1.0);
    least_squares_.factor(G_, metric_, static_cast<int>(m));
    for (double& acceleration : b_) acceleration = -acceleration;
    least_squares_.solve(b_, forces);
    return;
  }
  bounded_.solve({.dimension = n, .G = G_, .b = b_, .lower = lower_, .upper = upper_}, forces);
}

}  // namespace limber::internal
