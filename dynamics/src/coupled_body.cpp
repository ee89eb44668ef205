// Bodies whose turning and modes feel each other's inertia.
#include <utility>
#include <vector>

#include "limber/core/error.h"
#include "limber/dynamics/body_group.h"

namespace limber {

void BodyGroup::couple(Index slot) {
  if (skinned(slot))
    throw InvalidArgument("BodyGroup::couple: a body of \"" + model_->name() +
                          "\" bends by its modal skin, expected one that bends by its modes alone");
  if (!coupling_) coupling_ = std::make_unique<InertialCoupling>(model_->data(), step_length());
  const Vec3 omega = frame(slot).angular_velocity(constants_);
  coupled_[static_cast<std::size_t>(slot)] = std::make_unique<CoupledMotion>(*coupling_);
  const std::span<const double> rates = now_.rates.modes(slot);
  set_coupled_velocities(slot, omega, std::vector<double>(rates.begin(), rates.end()));
}

/// The body's momenta from its velocities, and its velocities as the momenta give them.
void BodyGroup::set_coupled_velocities(Index slot, const Vec3& angular_velocity, std::span<const double> rates) {
  RigidFrame& f = body(slot).frame;
  const Quaternion q_WB = f.pose().q;
  const Vec3 L = coupled_[static_cast<std::size_t>(slot)]->set_velocities(
      now_.amplitudes.row(slot), q_WB.conjugate() * angular_velocity, rates, now_.rates.row(slot));
  f.set_motion(f.pose(), f.velocity(), q_WB * L);
}

void BodyGroup::find_coupled_velocities(Index slot) {
  if (!coupled(slot)) return;
  const RigidFrame& f = frame(slot);
  coupled_[static_cast<std::size_t>(slot)]->set_momenta(
      now_.amplitudes.row(slot), f.pose().q.conjugate() * f.angular_momentum(constants_), now_.rates.row(slot));
}

Vec3 BodyGroup::angular_velocity(Index slot) const {
  const RigidFrame& f = frame(slot);
  if (coupled(slot)) return f.pose().q * coupled_[static_cast<std::size_t>(slot)]->angular_velocity();
  return f.angular_velocity(constants_);
}

/// @param modal k numbers, to which the forces' Uᵀ is added @return their torque, world
Vec3 BodyGroup::add_point_forces(Index slot, const Quaternion& q_WB, std::span<double> modal) const {
  Vec3 torque = Vec3::Zero();
  for (const PointForce& p : body(slot).point_forces) {
    torque += (q_WB * shape(slot).position(p.at)).cross(p.force);
    shape(slot).add_force(p.at, q_WB.conjugate() * p.force, modal);
  }
  return torque;
}

/// Half a step of what the start's loads give, and half of what the end's do, about the coupled flow, in which momenta
/// are kept.
void BodyGroup::advance_coupled(Index slot, const Vec3& gravity) {
  Body& b = body(slot);
  CoupledMotion& motion = *coupled_[static_cast<std::size_t>(slot)];
  const double h = step_length();
  const Vec3 acceleration = own_gravity(slot, gravity) + b.force / constants_.mass;
  const ModeArrays modes{now_.amplitudes.row(slot), now_.rates.row(slot), predicted_.forces.row(slot)};
  RigidTransform pose = b.frame.pose();
  pose.p += h * b.frame.velocity() + 0.5 * h * h * acceleration;
  Vec3 L = b.frame.angular_momentum(constants_);
  predicted_.forces.copy_from(now_.forces, slot);
  L += 0.5 * h * (b.torque + add_point_forces(slot, pose.q, predicted_.forces.modes(slot)));
  motion.begin_step(modes.forces, modes.z, modes.rates, pose.q, L);
  predicted_.forces.copy_from(now_.forces, slot);
  add_point_forces(slot, pose.q, predicted_.forces.modes(slot));
  motion.end_step(modes.forces, modes.z, modes.rates, pose.q, L);
  for (const DelayedImpulse& impulse : b.delayed) add_delayed(impulse, modes, h - impulse.time);
  L += 0.5 * h * (b.torque + add_point_forces(slot, pose.q, predicted_.forces.modes(slot)));
  b.frame.set_motion(pose, b.frame.velocity() + h * acceleration, L);
  find_coupled_velocities(slot);
  clear_loads(slot);
}

}  // namespace limber
