#include "limber/constraints/constraint.h"

#include <algorithm>

#include "frame_at.h"
#include "limber/core/cross_matrix.h"

namespace limber {

using internal::frame_at;

Vec3 BodyStates::origin(Index body, StepTime when) const {
  if (when != StepTime::kMiddle) return pose(body, when).p;
  return 0.5 * (pose(body, StepTime::kStart).p + pose(body, StepTime::kEnd).p);
}

Mat3 BodyStates::rotation(Index body, StepTime when) const {
  if (when != StepTime::kMiddle) return to_matrix(pose(body, when).q);
  return to_matrix(pose(body, StepTime::kStart).q) +
         0.5 * cross_matrix(turn(body)) * to_matrix(pose(body, StepTime::kStart).q);
}

Vec3 BodyStates::turn(Index body) const {
  if (is_static(body)) return Vec3::Zero();
  const Quaternion q = pose(body, StepTime::kEnd).q * pose(body, StepTime::kStart).q.conjugate();
  return 2.0 / q.w * q.vector();
}

std::span<const double> BodyStates::amplitudes(Index body, StepTime when) const {
  if (is_static(body)) return {};
  const ConstrainedBody& b = this->body(body);
  return when == StepTime::kStart ? b.group->amplitudes(b.slot) : b.group->predicted_amplitudes(b.slot);
}

BodyShape BodyStates::shape(Index body, StepTime when) const {
  const ConstrainedBody& b = this->body(body);
  return when == StepTime::kStart ? b.group->shape(b.slot) : b.group->predicted_shape(b.slot);
}

std::span<const double> BodyStates::rates(Index body, StepTime when) const {
  if (is_static(body)) return {};
  const ConstrainedBody& b = this->body(body);
  return when == StepTime::kStart ? b.group->rates(b.slot) : b.group->predicted_rates(b.slot);
}

Vec3 BodyStates::velocity(Index body, StepTime when) const {
  if (is_static(body)) return Vec3::Zero();
  const ConstrainedBody& b = this->body(body);
  return frame_at(*b.group, b.slot, when).velocity();
}

Vec3 BodyStates::angular_velocity(Index body, StepTime when) const {
  if (is_static(body)) return Vec3::Zero();
  const ConstrainedBody& b = this->body(body);
  return frame_at(*b.group, b.slot, when).angular_velocity(b.group->frame_constants());
}

}  // namespace limber
