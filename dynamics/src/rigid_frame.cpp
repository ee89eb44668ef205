#include "limber/dynamics/rigid_frame.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "limber/core/cross_matrix.h"
#include "limber/core/error.h"

namespace limber {
namespace {

// A swing whose angular frequency times the substep stays below this keeps its energy within a percent.
constexpr double kSwingPerSubstep = 0.25;
constexpr double kMostSubsteps = 4096.0;

bool turns_freely(const FrameConstants& c) { return c.motion == FrameMotion::kFree || c.motion == FrameMotion::kPoint; }

// The largest angular acceleration that a field of 1 m/s² gives the hanging body, 1/m: ‖I⁻¹[m c]ₓ‖, or its like about
// the line.
double swing_per_field(const ModalModelData& body) {
  const Vec3 s = body.mass * body.center_of_mass, e = body.line_axis;
  if (body.motion == FrameMotion::kLine) return e.cross(s).norm() / e.dot(body.inertia * e);
  if (body.motion != FrameMotion::kPoint) return 0.0;
  return (body.inertia.inverse() * cross_matrix(s)).norm();
}

bool turns_locked(const AxisLocks& locks) { return locks.rotation[0] || locks.rotation[1] || locks.rotation[2]; }

Mat3 inertia_in_world(const FrameConstants& c, const Quaternion& q_WB) {
  const Mat3 R = to_matrix(q_WB);
  return R * c.inertia * R.transpose();
}

/// Without what is along locked axes.
Vec3 without(const std::array<bool, 3>& locked, const Vec3& v) {
  return {locked[0] ? 0.0 : v.x(), locked[1] ? 0.0 : v.y(), locked[2] ? 0.0 : v.z()};
}

}  // namespace

void FrameSettings::validate() const {
  const auto refuse = [](const char* name, double value, const char* expected) {
    throw InvalidArgument(std::string("FrameSettings: ") + name + " is " + std::to_string(value) + ", expected " +
                          expected);
  };
  if (!std::isfinite(gravity_scale)) refuse("gravity_scale", gravity_scale, "a finite number");
  for (const auto& [name, value] :
       {std::pair("linear_damping", linear_damping), std::pair("angular_damping", angular_damping)})
    if (!(value >= 0.0 && std::isfinite(value))) refuse(name, value, "a finite number of at least 0");
}

/// By the series of φ₂ below 1, where its closed form would lose digits: 1/2 − x/6 + x²/24 …, of alternating terms, the
/// next of which is 1e−18.
Decay::Decay(double x) {
  if (x == 0.0) return;
  if (x < 1.0) {
    second = 0.0;
    for (int n = 19; n > 1; --n) second = (1.0 - x * second) / n;
    first = 1.0 - x * second;
    left = 1.0 - x * first;
  } else {
    left = std::exp(-x);
    first = (1.0 - left) / x;
    second = (1.0 - first) / x;
  }
}

TurnAxes::TurnAxes(const Mat3& inertia, const AxisLocks& locks) {
  int free[3] = {}, count = 0;
  for (int i = 0; i < 3; ++i)
    if (!locks.rotation[static_cast<std::size_t>(i)]) free[count++] = i;
  for (int i = 0; i < count; ++i) axes.col(i) = Vec3::Unit(free[i]);
  if (count == 2) {
    const int i = free[0], j = free[1];
    const double angle = 0.5 * std::atan2(2.0 * inertia(i, j), inertia(i, i) - inertia(j, j));
    axes.col(0) = std::cos(angle) * Vec3::Unit(i) + std::sin(angle) * Vec3::Unit(j);
    axes.col(1) = std::cos(angle) * Vec3::Unit(j) - std::sin(angle) * Vec3::Unit(i);
  }
  for (int i = 0; i < count; ++i) moments[i] = axes.col(i).dot(inertia * axes.col(i));
}

Mat3 TurnAxes::inverse_inertia() const {
  Mat3 sum = Mat3::Zero();
  for (int i = 0; i < 3; ++i)
    if (moments[i] > 0.0) sum += axes.col(i) * axes.col(i).transpose() / moments[i];
  return sum;
}

KinematicFrame between(const KinematicFrame& start, const KinematicFrame& target, double part, double step) {
  KinematicFrame at = target;
  if (part >= 1.0) return at;
  const double t = part * step;
  const Vec3& a = target.acceleration;
  const Vec3 velocity = (target.pose.p - start.pose.p) / step - 0.5 * step * a;
  at.pose.p = start.pose.p + t * velocity + 0.5 * t * t * a;
  at.pose.q = slerp(start.pose.q, target.pose.q, part);
  at.velocity = velocity + t * a;
  at.angular_velocity = (1.0 - part) * start.angular_velocity + part * target.angular_velocity;
  return at;
}

FrameConstants::FrameConstants(const ModalModelData& body)
    : motion(body.motion),
      mass(body.mass),
      center_of_mass(body.center_of_mass),
      inertia(body.inertia),
      line_axis(body.line_axis),
      principal(principal_inertia(body.inertia)),
      swing(swing_per_field(body)) {}

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
  velocity_ = parent_.velocity = without(settings_.locks.translation, velocity);
  parent_.acceleration = parent_.angular_acceleration = parent_.angular_velocity = Vec3::Zero();
  parent_was_set_ = false;
  if (turns_freely(c))
    set_momentum(pose_.q * (c.inertia * (pose_.q.conjugate() * without(settings_.locks.rotation, angular_velocity))));
  if (c.motion == FrameMotion::kLine) angle_rate_ = line_in_world(c).dot(angular_velocity);
  if (c.motion == FrameMotion::kKinematic) parent_.angular_velocity = angular_velocity;
  disturbed_ = true;
}

void RigidFrame::set_motion(const RigidTransform& X_WB, const Vec3& velocity, const Vec3& angular_momentum) {
  set_pose(X_WB);
  velocity_ = parent_.velocity = without(settings_.locks.translation, velocity);
  set_momentum(angular_momentum);
}

void RigidFrame::set_momentum(const Vec3& angular_momentum) {
  momentum_ = without(settings_.locks.rotation, angular_momentum);
}

void RigidFrame::set_settings(const FrameConstants& c, const FrameSettings& settings) {
  const Vec3 momentum = angular_momentum(c);  // of how it turns, all of it
  settings_ = settings;
  velocity_ = without(settings_.locks.translation, velocity_);
  if (turns_freely(c)) set_momentum(momentum);
  disturbed_ = true;
}

void RigidFrame::set_turn(const FrameConstants& c, const Quaternion& q_WB, const Vec3& angular_momentum) {
  disturbed_ = true;
  if (c.motion == FrameMotion::kPoint) {
    pose_.q = q_WB;
    momentum_ = angular_momentum;
    return;
  }
  const Quaternion turn = parent_.pose.q.conjugate() * q_WB;
  const double angle = 2.0 * std::atan2(c.line_axis.dot(turn.vector()), turn.w);
  angle_ += std::remainder(angle - angle_, 2.0 * std::numbers::pi);
  pose_.q = normalized(parent_.pose.q * quaternion_from_rotation_vector(angle_ * c.line_axis));
  const Quaternion q_BW = pose_.q.conjugate();
  const Vec3 own = q_BW * angular_momentum - c.inertia * (q_BW * parent_.angular_velocity);
  angle_rate_ = c.line_axis.dot(own) / c.line_axis.dot(c.inertia * c.line_axis);
}

void RigidFrame::set_parent(const KinematicFrame& at_step_end) {
  parent_was_set_ = true;
  next_parent_ = at_step_end;
  next_parent_.pose.q = normalized(at_step_end.pose.q);
}

Vec3 RigidFrame::angular_velocity(const FrameConstants& c) const {
  if (c.motion == FrameMotion::kKinematic) return parent_.angular_velocity;
  if (c.motion == FrameMotion::kLine) return parent_.angular_velocity + angle_rate_ * line_in_world(c);
  if (turns_locked(settings_.locks))
    return TurnAxes(inertia_in_world(c, pose_.q), settings_.locks).inverse_inertia() * momentum_;
  const Quaternion q_WP = pose_.q * c.principal.q_BP;
  return q_WP * (q_WP.conjugate() * momentum_).cwiseQuotient(c.principal.moments);
}

Vec3 RigidFrame::angular_momentum(const FrameConstants& c) const {
  if (turns_freely(c) && !turns_locked(settings_.locks)) return momentum_;
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
  if (c.motion == FrameMotion::kFree) velocity_ += without(settings_.locks.translation, impulse / c.mass);
  if (turns_freely(c)) {
    set_momentum(momentum_ + moment);
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
  set_momentum(momentum_ + seconds * torque);
  disturbed_ = true;
}

/// A free body, to the step's end but for the last kick. Where it is damped its path is the parabola through both ends
/// at its mean acceleration; where two axes are left to turn about, a steady turn.
void RigidFrame::fly(const FrameConstants& c, const FrameLoad& load, double h, FramePath* path) {
  const Vec3 a = without(settings_.locks.translation, load.gravity + load.force / c.mass), v = velocity_;
  const Decay decay(settings_.linear_damping * h);
  const Vec3 turning = Decay(settings_.angular_damping * h).first * momentum_;
  const RigidTransform start = pose_;
  pose_.p += h * (decay.first * v) + h * h * (decay.second * a);
  velocity_ = decay.left * v + h * (decay.first * a);
  rotate_freely(c, h);
  if (path == nullptr) return;
  const Vec3 mean = settings_.linear_damping == 0.0 ? a : Vec3((velocity_ - v) / h);
  RigidMotion motion{.pose = start,
                     .velocity = settings_.linear_damping == 0.0 ? v : Vec3((pose_.p - start.p) / h - 0.5 * h * mean),
                     .acceleration = mean};
  if (turns_locked(settings_.locks)) {
    motion.angular_velocity = rotation_vector(pose_.q * start.q.conjugate()) / h;
    path->start_carried(motion, h, c.line_axis);
    path->add_carried(0.0, 0.0, 0.0);
    return;
  }
  path->start_free(motion, h, c.principal);
  path->add_free(0.0, rotation_, static_cast<double>(rotation_steps_ - 1) * h, turning);
}

/// Turns a body that keeps its momentum but for damping: what decays turns it in h as its mean over h would.
void RigidFrame::rotate_freely(const FrameConstants& c, double h) {
  const Decay decay(settings_.angular_damping * h);
  if (settings_.angular_damping > 0.0) momentum_ *= decay.first, disturbed_ = true;
  if (turns_locked(settings_.locks))
    rotate_about_axes(c, h);
  else
    rotate_undamped(c, h);
  if (settings_.angular_damping > 0.0) momentum_ *= decay.left / decay.first, disturbed_ = true;
}

/// By the inertia in the middle of the way, which iterations find: each brings it nearer by a factor of half the turn.
void RigidFrame::rotate_about_axes(const FrameConstants& c, double h) {
  constexpr int kIterations = 12;
  Vec3 turn = h * angular_velocity(c);
  const Quaternion start = pose_.q;
  for (int i = 0; i < kIterations; ++i) {
    const Quaternion middle = quaternion_from_rotation_vector(0.5 * turn) * start;
    turn = h * (TurnAxes(inertia_in_world(c, middle), settings_.locks).inverse_inertia() * momentum_);
  }
  pose_.q = normalized(quaternion_from_rotation_vector(turn) * start);
  disturbed_ = true;
}

void RigidFrame::rotate_undamped(const FrameConstants& c, double h) {
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
                                       double h, FramePath* path) {
  FrameExcitation excitation;
  if (c.motion == FrameMotion::kFree) {
    kick(c, load, first_moment, 0.5 * h);
    fly(c, load, h, path);
    return excitation;
  }
  hold_parent_accelerations();
  const int n = substeps(c, load, h);
  const double part = h / n;
  add_excitation(c, load.gravity, 0.5 / n, excitation);
  if (c.motion != FrameMotion::kKinematic) kick(c, load, first_moment, 0.5 * part);
  if (path && c.motion == FrameMotion::kPoint) path->start_free(parent_path(h), h, c.principal);
  if (path && c.motion != FrameMotion::kPoint) path->start_carried(parent_path(h), h, c.line_axis);
  const KinematicFrame before = parent_;
  move_parent(h);
  const KinematicFrame after = parent_;
  for (int i = 1; i <= n; ++i) {
    place_parent_between(before, after, static_cast<double>(i) / n);
    if (c.motion == FrameMotion::kPoint) {
      const Vec3 turning = Decay(settings_.angular_damping * part).first * momentum_;
      rotate_freely(c, part);
      if (path) path->add_free((i - 1) * part, rotation_, static_cast<double>(rotation_steps_ - 1) * part, turning);
    } else {
      const Decay decay(settings_.angular_damping * part);
      if (path) path->add_carried((i - 1) * part, angle_, decay.first * angle_rate_);
      angle_ += part * (decay.first * angle_rate_);
      angle_rate_ *= decay.left;
      pose_.q = normalized(parent_.pose.q * quaternion_from_rotation_vector(angle_ * c.line_axis));
    }
    add_excitation(c, load.gravity, (i < n ? 1.0 : 0.5) / n, excitation);
    if (i < n) kick(c, load, first_moment, part);
  }
  return excitation;
}

void RigidFrame::end_step(const FrameConstants& c, const FrameLoad& load, const Vec3& first_moment, double h,
                          FramePath* path) {
  if (c.motion != FrameMotion::kKinematic) kick(c, load, first_moment, 0.5 * h / substeps(c, load, h));
  if (path) path->finish({.pose = pose_, .velocity = velocity_, .angular_velocity = angular_velocity(c)});
}

/// Parts of a step in which a hanging body cannot swing far. Given by the model and the field, not by the motion, so
/// that the splitting stays symplectic.
int RigidFrame::substeps(const FrameConstants& c, const FrameLoad& load, double h) const {
  const double frequency = std::sqrt(c.swing * (load.gravity - parent_.acceleration).norm());
  return static_cast<int>(std::clamp(std::ceil(frequency * h / kSwingPerSubstep), 1.0, kMostSubsteps));
}

/// The parent part way through a step; exactly at its end for part = 1.
void RigidFrame::place_parent_between(const KinematicFrame& before, const KinematicFrame& after, double part) {
  if (part == 1.0) {
    parent_ = after;
    return;
  }
  parent_.pose.q = slerp(before.pose.q, after.pose.q, part);
  parent_.angular_velocity = (1.0 - part) * before.angular_velocity + part * after.angular_velocity;
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

/// From the parent's pose now to that at the step's end: the parabola of its held acceleration through both, and a
/// steady turn.
RigidMotion RigidFrame::parent_path(double h) const {
  if (!parent_was_set_)
    return {.pose = parent_.pose, .velocity = parent_.velocity, .angular_velocity = parent_.angular_velocity};
  const Vec3& a = next_parent_.acceleration;
  return {.pose = parent_.pose,
          .velocity = (next_parent_.pose.p - parent_.pose.p) / h - 0.5 * h * a,
          .acceleration = a,
          .angular_velocity = rotation_vector(next_parent_.pose.q * parent_.pose.q.conjugate()) / h};
}

void RigidFrame::add_excitation(const FrameConstants& c, const Vec3& gravity, double weight,
                                FrameExcitation& sum) const {
  const Quaternion q_BW = pose_.q.conjugate();
  sum.field += weight * (q_BW * (gravity - parent_.acceleration));
  if (c.motion == FrameMotion::kPoint) return;  // a dynamic rotation does not shake the modes (to first order)
  const Vec3 omega = q_BW * parent_.angular_velocity;
  Vec3 alpha = q_BW * parent_.angular_acceleration;
  if (c.motion == FrameMotion::kLine) alpha += omega.cross(angle_rate_ * c.line_axis);
  sum.angular_acceleration += weight * alpha;
  sum.spin += weight * omega * omega.transpose();
}

}  // namespace limber
