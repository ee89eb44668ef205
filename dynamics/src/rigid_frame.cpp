#include "limber/dynamics/rigid_frame.h"

namespace limber {
namespace {

bool turns_freely(const FrameConstants& c) { return c.motion == FrameMotion::kFree || c.motion == FrameMotion::kPoint; }

}  // namespace

FrameConstants::FrameConstants(const ModalModelData& body)
    : motion(body.motion),
      mass(body.mass),
      center_of_mass(body.center_of_mass),
      inertia(body.inertia),
      line_axis(body.line_axis),
      principal(principal_inertia(body.inertia)) {}

RigidFrame::RigidFrame(const FrameConstants& c, const RigidTransform& X_WB, const Vec3& velocity,
                       const Vec3& angular_velocity) {
  set_pose(X_WB);
  set_velocity(c, velocity, angular_velocity);
}

void RigidFrame::set_pose(const RigidTransform& X_WB) {
  pose_ = {normalized(X_WB.q), X_WB.p};
  parent_.pose = pose_;
  parent_was_set_ = false;
  angle_ = 0.0;
  disturbed_ = true;
}

void RigidFrame::set_velocity(const FrameConstants& c, const Vec3& velocity, const Vec3& angular_velocity) {
  velocity_ = parent_.velocity = velocity;
  parent_.acceleration = parent_.angular_acceleration = parent_.angular_velocity = Vec3::Zero();
  parent_was_set_ = false;
  if (turns_freely(c)) momentum_ = pose_.q * (c.inertia * (pose_.q.conjugate() * angular_velocity));
  if (c.motion == FrameMotion::kLine) angle_rate_ = line_in_world(c).dot(angular_velocity);
  if (c.motion == FrameMotion::kKinematic) parent_.angular_velocity = angular_velocity;
  disturbed_ = true;
}

void RigidFrame::set_parent(const KinematicFrame& at_step_end) {
  parent_was_set_ = true;
  next_parent_ = at_step_end;
  next_parent_.pose.q = normalized(at_step_end.pose.q);
}

Vec3 RigidFrame::angular_velocity(const FrameConstants& c) const {
  if (c.motion == FrameMotion::kKinematic) return parent_.angular_velocity;
  if (c.motion == FrameMotion::kLine) return parent_.angular_velocity + angle_rate_ * line_in_world(c);
  const Quaternion q_WP = pose_.q * c.principal.q_BP;
  return q_WP * (q_WP.conjugate() * momentum_).cwiseQuotient(c.principal.moments);
}

Vec3 RigidFrame::angular_momentum(const FrameConstants& c) const {
  if (turns_freely(c)) return momentum_;
  return pose_.q * (c.inertia * (pose_.q.conjugate() * angular_velocity(c)));
}

Vec3 RigidFrame::linear_momentum(const FrameConstants& c) const {
  return c.mass * (velocity_ + angular_velocity(c).cross(pose_.q * c.center_of_mass));
}

double RigidFrame::kinetic_energy(const FrameConstants& c) const {
  const Vec3 omega = angular_velocity(c);
  const Vec3 arm = pose_.q * c.center_of_mass;
  return 0.5 * c.mass * velocity_.squaredNorm() + c.mass * velocity_.dot(omega.cross(arm)) +
         0.5 * omega.dot(angular_momentum(c));
}

void RigidFrame::apply_impulse(const FrameConstants& c, const Vec3& impulse, const Vec3& moment) {
  if (c.motion == FrameMotion::kFree) velocity_ += impulse / c.mass;
  if (turns_freely(c)) {
    momentum_ += moment;
    disturbed_ = true;
  }
  if (c.motion == FrameMotion::kLine)
    angle_rate_ += line_in_world(c).dot(moment) / c.line_axis.dot(c.inertia * c.line_axis);
}

void RigidFrame::kick(const FrameConstants& c, const FrameLoad& load, const Vec3& first_moment, double seconds) {
  const Vec3 field = load.gravity - parent_.acceleration;
  if (c.motion == FrameMotion::kLine) {
    const Quaternion q_BW = pose_.q.conjugate();
    const Vec3 omega = q_BW * parent_.angular_velocity, alpha = q_BW * parent_.angular_acceleration;
    const Vec3 torque =
        q_BW * load.torque + first_moment.cross(q_BW * field) - c.inertia * alpha - omega.cross(c.inertia * omega);
    angle_rate_ += seconds * c.line_axis.dot(torque) / c.line_axis.dot(c.inertia * c.line_axis);
    return;
  }
  Vec3 torque = load.torque;
  if (c.motion == FrameMotion::kPoint) torque += (pose_.q * first_moment).cross(field);
  if (torque.isZero(0.0)) return;  // an undisturbed body keeps its closed form
  momentum_ += seconds * torque;
  disturbed_ = true;
}

void RigidFrame::rotate_freely(const FrameConstants& c, double h) {
  if (disturbed_ || h != rotation_step_) {
    rotation_ = FreeRotation(c.principal, pose_.q, momentum_);
    rotation_step_ = h;
    rotation_steps_ = 0;
    disturbed_ = false;
  }
  ++rotation_steps_;
  pose_.q = rotation_.attitude(static_cast<double>(rotation_steps_) * h);
}

FrameExcitation RigidFrame::begin_step(const FrameConstants& c, const FrameLoad& load, const Vec3& first_moment,
                                       double h) {
  FrameExcitation excitation;
  if (c.motion == FrameMotion::kFree) {
    const Vec3 acceleration = load.gravity + load.force / c.mass;
    kick(c, load, first_moment, 0.5 * h);
    pose_.p += h * velocity_ + 0.5 * h * h * acceleration;
    velocity_ += h * acceleration;
    rotate_freely(c, h);
    return excitation;
  }
  hold_parent_accelerations();
  add_excitation(c, load.gravity, excitation);
  if (c.motion != FrameMotion::kKinematic) kick(c, load, first_moment, 0.5 * h);
  move_parent(h);
  if (c.motion == FrameMotion::kPoint) {
    rotate_freely(c, h);
  } else {
    angle_ += h * angle_rate_;
    pose_.q = normalized(parent_.pose.q * quaternion_from_rotation_vector(angle_ * c.line_axis));
  }
  add_excitation(c, load.gravity, excitation);
  return excitation;
}

void RigidFrame::end_step(const FrameConstants& c, const FrameLoad& load, const Vec3& first_moment, double h) {
  if (c.motion != FrameMotion::kKinematic) kick(c, load, first_moment, 0.5 * h);
}

/// The accelerations that a parent is given for a step hold from its start; without a parent given there are none.
void RigidFrame::hold_parent_accelerations() {
  parent_.acceleration = parent_was_set_ ? next_parent_.acceleration : Vec3::Zero();
  parent_.angular_acceleration = parent_was_set_ ? next_parent_.angular_acceleration : Vec3::Zero();
}

void RigidFrame::move_parent(double h) {
  if (parent_was_set_) {
    parent_ = next_parent_;
    parent_was_set_ = false;
  } else {
    parent_.pose.p += h * parent_.velocity;
    parent_.pose.q = normalized(quaternion_from_rotation_vector(h * parent_.angular_velocity) * parent_.pose.q);
  }
  pose_.p = parent_.pose.p;
  velocity_ = parent_.velocity;
}

void RigidFrame::add_excitation(const FrameConstants& c, const Vec3& gravity, FrameExcitation& sum) const {
  const Quaternion q_BW = pose_.q.conjugate();
  sum.field += 0.5 * (q_BW * (gravity - parent_.acceleration));
  if (c.motion == FrameMotion::kPoint) return;  // a dynamic rotation does not shake the modes (to first order)
  const Vec3 omega = q_BW * parent_.angular_velocity;
  Vec3 alpha = q_BW * parent_.angular_acceleration;
  if (c.motion == FrameMotion::kLine) alpha += omega.cross(angle_rate_ * c.line_axis);
  sum.angular_acceleration += 0.5 * alpha;
  sum.spin += 0.5 * omega * omega.transpose();
}

}  // namespace limber
