#include "running/frame_movement.h"

#include <cmath>
#include <numbers>

namespace limber::internal {
namespace {

FrameState between(const PoseKey& a, const PoseKey& b, double t) {
  const double span = b.time - a.time, u = (t - a.time) / span;
  const double s = u * u * u * (10.0 + u * (-15.0 + 6.0 * u));
  const double rate = 30.0 * u * u * (1.0 - u) * (1.0 - u) / span;
  const Vec3 way = b.pose.p - a.pose.p, turn = rotation_vector(b.pose.q * a.pose.q.conjugate());
  return {.pose = {quaternion_from_rotation_vector(s * turn) * a.pose.q, a.pose.p + s * way},
          .velocity = rate * way,
          .angular_velocity = rate * turn};
}

FrameState at(const std::monostate&, const RigidTransform& start, double) { return {.pose = start}; }

FrameState at(const Shake& shake, const RigidTransform& start, double t) {
  FrameState state{.pose = start};
  const double since = t - shake.start;
  if (since <= 0.0 || since >= shake.duration) return state;
  const double omega = 2.0 * std::numbers::pi * shake.frequency;
  state.pose.p += shake.axis * (shake.amplitude * std::sin(omega * since));
  state.velocity = shake.axis * (shake.amplitude * omega * std::cos(omega * since));
  return state;
}

FrameState at(const std::vector<PoseKey>& keys, const RigidTransform& start, double t) {
  PoseKey before{.time = 0.0, .pose = start};
  for (const PoseKey& key : keys) {
    if (t < key.time) return between(before, key, t);
    before = key;
  }
  return {.pose = before.pose};
}

}  // namespace

FrameState frame_at(const FrameMovement& movement, const RigidTransform& start, double t) {
  return std::visit([&](const auto& told) { return at(told, start, t); }, movement);
}

KinematicFrame frame_over_step(const FrameMovement& movement, const RigidTransform& start, double t, double h) {
  const FrameState from = frame_at(movement, start, t), to = frame_at(movement, start, t + h);
  return {.pose = to.pose,
          .velocity = to.velocity,
          .acceleration = (to.velocity - from.velocity) / h,
          .angular_velocity = to.angular_velocity,
          .angular_acceleration = (to.angular_velocity - from.angular_velocity) / h};
}

}  // namespace limber::internal
