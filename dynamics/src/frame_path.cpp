#include "limber/dynamics/frame_path.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace limber {
namespace {

/// sup |ω| over a free rotation, from one point of it. With x_i = l_i², the polhode is the segment
/// x + s (α, −(α+γ), γ), α = 1/I₂ − 1/I₃, γ = 1/I₁ − 1/I₂: on it |ω|² grows with s up to where x₂ = 0.
double largest_angular_speed(const Vec3& moments, const Vec3& momentum_P) {
  const Vec3 inverse = moments.cwiseInverse();
  const double alpha = std::max(inverse.y() - inverse.z(), 0.0), gamma = std::max(inverse.x() - inverse.y(), 0.0);
  const double middle = momentum_P.y() * momentum_P.y();
  return std::sqrt(momentum_P.cwiseProduct(inverse).squaredNorm() + middle * alpha * gamma);
}

}  // namespace

void FramePath::start(const RigidMotion& motion, double step) {
  step_ = step;
  start_ = end_ = motion;
  acceleration_ = motion.acceleration;
  parts_.clear();
}

void FramePath::set(const RigidMotion& motion, double step) {
  start_carried(motion, step, Vec3::UnitX());
  add_carried(0.0, 0.0, 0.0);
  finish({.pose = {normalized(quaternion_from_rotation_vector(step * motion.angular_velocity) * motion.pose.q),
                   motion.pose.p + step * motion.velocity + 0.5 * step * step * motion.acceleration},
          .velocity = motion.velocity + step * motion.acceleration,
          .angular_velocity = motion.angular_velocity});
}

void FramePath::start_free(const RigidMotion& origin, double step, const PrincipalInertia& inertia) {
  start(origin, step);
  free_ = true;
  inertia_ = inertia;
}

void FramePath::start_carried(const RigidMotion& parent, double step, const Vec3& line_axis) {
  start(parent, step);
  free_ = false;
  line_axis_ = line_axis;
}

void FramePath::add_free(double begin, const FreeRotation& rotation, double since, const Vec3& momentum_W) {
  const Quaternion q_WP = rotation.attitude(since) * inertia_.q_BP;
  parts_.push_back({.begin = begin,
                    .rotation = rotation,
                    .since = since,
                    .momentum = momentum_W,
                    .angular_speed = largest_angular_speed(inertia_.moments, q_WP.conjugate() * momentum_W)});
}

void FramePath::add_carried(double begin, double angle, double angle_rate) {
  parts_.push_back({.begin = begin,
                    .angle = angle,
                    .angle_rate = angle_rate,
                    .angular_speed = start_.angular_velocity.norm() + std::abs(angle_rate)});
}

void FramePath::finish(const RigidMotion& motion) { end_ = motion; }

const FramePath::Part& FramePath::part_at(double t) const {
  const auto after = std::upper_bound(parts_.begin() + 1, parts_.end(), t,
                                      [](double time, const Part& part) { return time < part.begin; });
  return *(after - 1);
}

double FramePath::end_of(const Part& part) const { return &part == &parts_.back() ? step_ : (&part + 1)->begin; }

Quaternion FramePath::attitude(const Part& part, double t) const {
  if (free_) return part.rotation.attitude(part.since + (t - part.begin));
  const Quaternion carried = quaternion_from_rotation_vector(t * start_.angular_velocity) * start_.pose.q;
  const double angle = part.angle + (t - part.begin) * part.angle_rate;
  return normalized(carried * quaternion_from_rotation_vector(angle * line_axis_));
}

RigidTransform FramePath::pose(double t) const {
  if (t >= step_) return end_.pose;
  return {attitude(part_at(t), t), start_.pose.p + t * (start_.velocity + 0.5 * t * acceleration_)};
}

Vec3 FramePath::velocity(double t) const {
  return t >= step_ ? end_.velocity : Vec3(start_.velocity + t * acceleration_);
}

Vec3 FramePath::angular_velocity(double t) const {
  if (t >= step_) return end_.angular_velocity;
  const Part& part = part_at(t);
  if (!free_) return start_.angular_velocity + part.angle_rate * (attitude(part, t) * line_axis_);
  const Quaternion q_WP = attitude(part, t) * inertia_.q_BP;
  return q_WP * (q_WP.conjugate() * part.momentum).cwiseQuotient(inertia_.moments);
}

/// t |v₀ − d/T + ½ a t| is largest at the end, or where t is and the rest is not.
double FramePath::travel_beside(const Vec3& displacement) const {
  const Vec3 start = step_ * start_.velocity - displacement;
  return std::max(start.norm(), (start + 0.5 * step_ * step_ * acceleration_).norm());
}

double FramePath::turn() const {
  double turn = 0.0;
  for (const Part& part : parts_) turn += (end_of(part) - part.begin) * part.angular_speed;
  return std::min(turn, std::numbers::pi);
}

}  // namespace limber
