#include "limber/constraints/constraint.h"

#include <algorithm>

namespace limber {

const RigidTransform& BodyStates::pose(Index body, StepTime when) const {
  static const RigidTransform kWorld{};
  if (body < 0) return kWorld;
  const ConstrainedBody& b = this->body(body);
  if (b.group == nullptr) return b.pose;
  return when == StepTime::kStart ? b.group->frame(b.slot).pose() : b.group->predicted_frame(b.slot).pose();
}

std::span<const double> BodyStates::amplitudes(Index body, StepTime when) const {
  if (is_static(body)) return {};
  const ConstrainedBody& b = this->body(body);
  return when == StepTime::kStart ? b.group->amplitudes(b.slot) : b.group->predicted_amplitudes(b.slot);
}

std::span<const double> BodyStates::rates(Index body, StepTime when) const {
  if (is_static(body)) return {};
  const ConstrainedBody& b = this->body(body);
  return when == StepTime::kStart ? b.group->rates(b.slot) : b.group->predicted_rates(b.slot);
}

const ExactMotion* FreeMotions::of(Index body) const {
  const auto found = std::ranges::lower_bound(members, body);
  return found != members.end() && *found == body ? &motions[static_cast<std::size_t>(found - members.begin())]
                                                  : nullptr;
}

Vec3 BodyStates::velocity(Index body, StepTime when) const {
  if (is_static(body)) return Vec3::Zero();
  const ConstrainedBody& b = this->body(body);
  return when == StepTime::kStart ? b.group->frame(b.slot).velocity() : b.group->predicted_frame(b.slot).velocity();
}

Vec3 BodyStates::angular_velocity(Index body, StepTime when) const {
  if (is_static(body)) return Vec3::Zero();
  const ConstrainedBody& b = this->body(body);
  const FrameConstants& c = b.group->frame_constants();
  return when == StepTime::kStart ? b.group->frame(b.slot).angular_velocity(c)
                                  : b.group->predicted_frame(b.slot).angular_velocity(c);
}

}  // namespace limber
