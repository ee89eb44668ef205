#include "island_energy.h"

#include <algorithm>
#include <cmath>

namespace limber {
namespace {

// Energy is given back, and where little of it is too much is taken, at most at this part of the relative kinetic
// energy in a step: a pendulum that turns round is not to stop there.
constexpr double kLargestChange = 0.1;
// This part of the energies at hand may wait for the next step.
constexpr double kPatience = 1e-7;
// A gain above this many times the energies at hand is nonsense, not motion to be slowed: digits would not be left.
constexpr double kNonsense = 10.0;
// m/s: joints and stops that are out of place bring even resting bodies together about this fast.
constexpr double kRecoverySpeed = 1.0;

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

Vec3 center_at(const BodyGroup& group, Index slot, StepTime when) {
  return frame_at(group, slot, when).pose() * group.frame_constants().center_of_mass;
}

RelativeMotion relative_motion(const BodyGroup& group, Index slot, StepTime when, const CommonMotion& common) {
  const FrameConstants& c = group.frame_constants();
  const RigidFrame& frame = frame_at(group, slot, when);
  const Mat3 R = to_matrix(frame.pose().q);
  const Vec3 carried_along =
      common.velocity + common.angular_velocity.cross(center_at(group, slot, when) - common.center);
  const Vec3 velocity = frame.velocity() - carried_along;
  const Vec3 omega = frame.angular_velocity(c) - common.angular_velocity;
  const Vec3 angular_momentum = R * (c.inertia * (R.transpose() * omega));
  return {c.mass * velocity, angular_momentum,
          0.5 * c.mass * velocity.squaredNorm() + 0.5 * omega.dot(angular_momentum)};
}

}  // namespace

void IslandEnergy::begin(const IslandBodies& bodies, const Vec3& gravity) {
  before_ = scale_ = recovery_ = 0.0;
  driven_ = false;
  for (Index local = 0; local < bodies.count(); ++local) {
    const auto& [group, slot, pose] = bodies.body(local);
    const FrameConstants& c = group->frame_constants();
    const BodyEnergy energy = group->energy(slot, gravity);
    before_ += energy.total();
    recovery_ += c.mass * kRecoverySpeed * kRecoverySpeed;
    scale_ += energy.kinetic_rigid + energy.kinetic_modal + energy.elastic +
              gravity.norm() * std::sqrt(c.mass * c.inertia.trace());
    driven_ = driven_ || carried(*group, slot) || group->has_delayed_impulse(slot);
  }
}

IslandEnergy::Change IslandEnergy::guard(const IslandBodies& bodies, const ConstraintRows& rows,
                                         std::span<const double> impulses, double agent_work, bool give_back,
                                         const IslandOptions& options) {
  if (driven_) return {};
  double after = 0.0, damped = 0.0;
  for (Index local = 0; local < bodies.count(); ++local) {
    const auto& [group, slot, pose] = bodies.body(local);
    after += group->predicted_energy(slot, options.gravity).total();
    damped += group->predicted_dissipation(slot);
    if (carried(*group, slot)) return {};
  }
  const double work = agent_work + load_work(bodies, options.step);
  const double gain = after - before_ - work + options.energy_surplus;
  // Of what there was, never of what came out: that may be any number where the rows did not come together.
  const double at_hand = scale_ + std::max(0.0, work);
  const double patience = kPatience * (at_hand > 0.0 ? at_hand : recovery_);
  const double excess = gain > 0.0 ? gain : give_back ? std::min(0.0, gain + damped) : 0.0;
  if (!std::isfinite(gain)) return {.left = kUnbounded};
  if (excess == 0.0) return {};
  if (excess > kNonsense * std::max(at_hand, recovery_)) return {.left = excess};
  const CommonMotion common = is_free(bodies, rows, impulses) ? common_motion(bodies, StepTime::kEnd) : CommonMotion{};
  const double removed = remove_relative_energy(bodies, common, excess, excess < patience ? kLargestChange : 1.0);
  const double left = excess - removed;
  return {removed, left > patience ? left : 0.0, std::max(0.0, left)};
}

/// Work of the forces that the caller holds over the step.
double IslandEnergy::load_work(const IslandBodies& bodies, double step) {
  double work = 0.0;
  for (Index local = 0; local < bodies.count(); ++local) {
    const auto& [group, slot, pose] = bodies.body(local);
    const FrameConstants& c = group->frame_constants();
    const RigidFrame &start = group->frame(slot), &end = group->predicted_frame(slot);
    work += group->held_force(slot).dot(end.pose().p - start.pose().p) +
            0.5 * step * group->held_torque(slot).dot(start.angular_velocity(c) + end.angular_velocity(c));
    const std::span<const double> g = group->held_modal_forces(slot), z0 = group->amplitudes(slot),
                                  z1 = group->predicted_amplitudes(slot);
    for (std::size_t i = 0; i < g.size(); ++i) work += g[i] * (z1[i] - z0[i]);
  }
  return work;
}

bool IslandEnergy::is_free(const IslandBodies& bodies, const ConstraintRows& rows, std::span<const double> impulses) {
  for (Index local = 0; local < bodies.count(); ++local)
    if (bodies.response(local).translations == 0) return false;
  for (Index i = 0; i < rows.size(); ++i)
    for (const ConstraintRows::Side& side : rows.row(i).sides)
      if (side.body < 0 && impulses[static_cast<std::size_t>(i)] != 0.0) return false;
  return true;
}

CommonMotion IslandEnergy::common_motion(const IslandBodies& bodies, StepTime when) {
  double mass = 0.0;
  Vec3 first = Vec3::Zero(), momentum = Vec3::Zero();
  for (Index local = 0; local < bodies.count(); ++local) {
    const auto& [group, slot, pose] = bodies.body(local);
    const FrameConstants& c = group->frame_constants();
    mass += c.mass;
    first += c.mass * center_at(*group, slot, when);
    momentum += frame_at(*group, slot, when).linear_momentum(c);
  }
  CommonMotion common{.center = first / mass, .velocity = momentum / mass};
  Mat3 inertia = Mat3::Zero();
  Vec3 angular_momentum = Vec3::Zero();
  for (Index local = 0; local < bodies.count(); ++local) {
    const auto& [group, slot, pose] = bodies.body(local);
    const FrameConstants& c = group->frame_constants();
    const RigidFrame& frame = frame_at(*group, slot, when);
    const Mat3 R = to_matrix(frame.pose().q);
    const Vec3 x = center_at(*group, slot, when) - common.center;
    inertia += R * c.inertia * R.transpose() + c.mass * (x.squaredNorm() * Mat3::Identity() - x * x.transpose());
    angular_momentum += frame.angular_momentum(c) + x.cross(c.mass * frame.velocity());
  }
  common.angular_velocity = inertia.llt().solve(angular_momentum);
  return common;
}

double IslandEnergy::start_motion(const IslandBodies& bodies, const ConstraintRows& rows,
                                  std::span<const double> impulses, std::vector<FrameMomentum>& momenta) {
  const CommonMotion common =
      is_free(bodies, rows, impulses) ? common_motion(bodies, StepTime::kStart) : CommonMotion{};
  double energy = 0.0;
  momenta.clear();
  for (Index local = 0; local < bodies.count(); ++local) {
    const auto& [group, slot, pose] = bodies.body(local);
    const RelativeMotion r = relative_motion(*group, slot, StepTime::kStart, common);
    momenta.push_back({r.momentum, r.angular_momentum});
    energy += r.energy;
  }
  return energy;
}

/// Scales all velocities relative to the common motion so that their energy, which the split leaves free of mixed
/// terms, falls by the excess or rises by what is missing. @return J taken out
double IslandEnergy::remove_relative_energy(const IslandBodies& bodies, const CommonMotion& common, double excess,
                                            double largest_part) {
  double kinetic = 0.0;
  for (Index local = 0; local < bodies.count(); ++local) {
    const auto& [group, slot, pose] = bodies.body(local);
    kinetic += relative_motion(*group, slot, StepTime::kEnd, common).energy;
    for (const double rate : group->predicted_rates(slot)) kinetic += 0.5 * rate * rate;
  }
  if (!(kinetic > 0.0)) return 0.0;
  excess = std::clamp(excess, -kLargestChange * kinetic, largest_part * kinetic);
  const double slower = std::sqrt(1.0 - excess / kinetic) - 1.0;
  for (Index local = 0; local < bodies.count(); ++local) {
    const auto& [group, slot, pose] = bodies.body(local);
    const RelativeMotion r = relative_motion(*group, slot, StepTime::kEnd, common);
    const std::span<const double> rates = group->predicted_rates(slot);
    modal_.assign(rates.size(), 0.0);
    for (std::size_t i = 0; i < rates.size(); ++i) modal_[i] = slower * rates[i];
    group->adjust_prediction(slot, slower * r.momentum, slower * r.angular_momentum, modal_);
  }
  return excess;
}

}  // namespace limber
