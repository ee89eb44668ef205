#include "island_energy.h"

#include <algorithm>
#include <cmath>

#include "../tuning.h"
#include "island_work.h"

namespace limber::internal {
namespace {

/// A body whose parent moves gets work from it that nobody books.
bool carried(const BodyGroup& group, Index slot) {
  const FrameConstants& c = group.frame_constants();
  if (c.motion == FrameMotion::kFree) return false;
  const RigidFrame& frame = group.frame(slot);
  return !frame.velocity().isZero(0.0) ||
         (c.motion == FrameMotion::kKinematic && !frame.angular_velocity(c).isZero(0.0));
}

struct RelativeMotion {
  Vec3 momentum, angular_momentum;
  double energy;
};

const RigidFrame& end_frame(const BodyGroup& group, Index slot) { return frame_at(group, slot, StepTime::kEnd); }

Vec3 end_center(const BodyGroup& group, Index slot) {
  return end_frame(group, slot).pose() * group.frame_constants().center_of_mass;
}

RelativeMotion relative_motion(const BodyGroup& group, Index slot, const CommonMotion& common) {
  const FrameConstants& c = group.frame_constants();
  const RigidFrame& frame = end_frame(group, slot);
  const Mat3 R = to_matrix(frame.pose().q);
  const Vec3 carried_along = common.velocity + common.angular_velocity.cross(end_center(group, slot) - common.center);
  const Vec3 velocity = frame.velocity() - carried_along;
  const Vec3 omega = frame.angular_velocity(c) - common.angular_velocity;
  const Vec3 angular_momentum = R * (c.inertia * (R.transpose() * omega));
  return {c.mass * velocity, angular_momentum,
          0.5 * c.mass * velocity.squaredNorm() + 0.5 * omega.dot(angular_momentum)};
}

/// Of a row, all in all: in the step, at a touch before it, and at its end.
double whole_impulse(const IslandStep& step, std::size_t row) {
  return step.f[row] + step.length() * (step.reaction[row] + step.end_reaction[row]) + step.touch_impulse[row];
}

/// Whether nothing holds the island. Rows that exert nothing hold nothing.
bool is_free(const IslandStep& step) {
  for (Index local = 0; local < step.bodies.count(); ++local)
    if (step.bodies.response(local).translations == 0) return false;
  for (std::size_t i = 0; i < step.size(); ++i)
    for (const ConstraintRows::Side& side : step.rows.row(static_cast<Index>(i)).sides)
      if (side.body < 0 && whole_impulse(step, i) != 0.0) return false;
  return true;
}

}  // namespace

void IslandEnergy::begin(const IslandStep& step) {
  const Vec3& gravity = step.part.options.gravity;
  before_ = scale_ = recovery_ = 0.0;
  driven_ = false;
  for (Index local = 0; local < step.bodies.count(); ++local) {
    const auto& [group, slot, pose] = step.bodies.body(local);
    const FrameConstants& c = group->frame_constants();
    const BodyEnergy energy = group->energy(slot, gravity);
    before_ += energy.total();
    recovery_ += c.mass * kConstraintsTuning.energy.recovery_speed * kConstraintsTuning.energy.recovery_speed;
    scale_ += energy.kinetic_rigid + energy.kinetic_modal + energy.elastic +
              step.gravity_of(local).norm() * std::sqrt(c.mass * c.inertia.trace());
    driven_ = driven_ || carried(*group, slot) || group->has_delayed_impulse(slot);
  }
}

double IslandEnergy::close(const IslandStep& step, IslandReport& report) {
  // Loads at the start take ½ m g² Δt² of all that falls: no row's work, and nothing to make relative motion of.
  const bool give_back = step.part.options.undisturbed && report.accepted && !step.loads_at_start && is_workless(step);
  const Change done = guard(step, give_back);
  report.energy_removed = done.removed;
  report.energy_surplus = done.surplus;
  return done.left;
}

IslandEnergy::Change IslandEnergy::guard(const IslandStep& step, bool give_back) {
  if (driven_) return {};
  double after = 0.0, damped = 0.0;
  for (Index local = 0; local < step.bodies.count(); ++local) {
    const auto& [group, slot, pose] = step.bodies.body(local);
    after += group->predicted_energy(slot, step.part.options.gravity).total();
    damped += group->predicted_dissipation(slot);
    if (carried(*group, slot)) return {};
  }
  damped += step.end_modal_gain;  // which is no damping
  const double work = agent_work(step) + load_work(step) + step.end_work;
  const double gain = after - before_ - work + step.part.options.energy_surplus;
  // Of what there was, never of what came out: that may be any number where the rows did not come together.
  const double at_hand = scale_ + std::max(0.0, work);
  const double patience = kConstraintsTuning.energy.patience * (at_hand > 0.0 ? at_hand : recovery_);
  const double excess = gain > 0.0 ? gain : give_back ? std::min(0.0, gain + damped) : 0.0;
  if (!std::isfinite(gain)) return {.left = kUnbounded};
  if (excess == 0.0) return {};
  if (!step.mean && excess > kConstraintsTuning.energy.nonsense * std::max(at_hand, recovery_)) return {.left = excess};
  const CommonMotion common = common_motion(step);
  const double removed = remove_relative_energy(step.bodies, common, excess,
                                                excess < patience ? kConstraintsTuning.energy.largest_change : 1.0);
  const double left = excess - removed;
  if (step.mean) return {removed, 0.0, std::clamp(left, 0.0, patience)};
  return {removed, left > patience ? left : 0.0, std::max(0.0, left)};
}

CommonMotion IslandEnergy::common_motion(const IslandStep& step) const {
  if (!is_free(step)) return {};
  double mass = 0.0;
  Vec3 first = Vec3::Zero(), momentum = Vec3::Zero();
  for (Index local = 0; local < step.bodies.count(); ++local) {
    const auto& [group, slot, pose] = step.bodies.body(local);
    const FrameConstants& c = group->frame_constants();
    mass += c.mass;
    first += c.mass * end_center(*group, slot);
    momentum += end_frame(*group, slot).linear_momentum(c);
  }
  CommonMotion common{.center = first / mass, .velocity = momentum / mass};
  Mat3 inertia = Mat3::Zero();
  Vec3 angular_momentum = Vec3::Zero();
  for (Index local = 0; local < step.bodies.count(); ++local) {
    const auto& [group, slot, pose] = step.bodies.body(local);
    const FrameConstants& c = group->frame_constants();
    const RigidFrame& frame = end_frame(*group, slot);
    const Mat3 R = to_matrix(frame.pose().q);
    const Vec3 x = end_center(*group, slot) - common.center;
    inertia += R * c.inertia * R.transpose() + c.mass * (x.squaredNorm() * Mat3::Identity() - x * x.transpose());
    angular_momentum += frame.angular_momentum(c) + x.cross(c.mass * frame.velocity());
  }
  common.angular_velocity = inertia.llt().solve(angular_momentum);
  return common;
}

/// Scales all velocities relative to the common motion so that their energy, which the split leaves free of mixed
/// terms, falls by the excess or rises by what is missing. @return J taken out
double IslandEnergy::remove_relative_energy(const IslandBodies& bodies, const CommonMotion& common, double excess,
                                            double largest_part) {
  double kinetic = 0.0;
  for (Index local = 0; local < bodies.count(); ++local) {
    const auto& [group, slot, pose] = bodies.body(local);
    kinetic += relative_motion(*group, slot, common).energy;
    for (const double rate : group->predicted_rates(slot)) kinetic += 0.5 * rate * rate;
  }
  if (!(kinetic > 0.0)) return 0.0;
  excess = std::clamp(excess, -kConstraintsTuning.energy.largest_change * kinetic, largest_part * kinetic);
  const double slower = std::sqrt(1.0 - excess / kinetic) - 1.0;
  for (Index local = 0; local < bodies.count(); ++local) {
    const auto& [group, slot, pose] = bodies.body(local);
    const RelativeMotion r = relative_motion(*group, slot, common);
    const std::span<const double> rates = group->predicted_rates(slot);
    modal_.assign(rates.size(), 0.0);
    for (std::size_t i = 0; i < rates.size(); ++i) modal_[i] = slower * rates[i];
    group->adjust_prediction(slot, slower * r.momentum, slower * r.angular_momentum, modal_);
  }
  return excess;
}

}  // namespace limber::internal
