// The frame of a body at one of the two instants that a step knows.
#pragma once

#include "limber/constraints/constraint.h"

namespace limber::internal {

/// Before the step, or as predicted for its end.
inline const RigidFrame& frame_at(const BodyGroup& group, Index slot, StepTime when) {
  return when == StepTime::kStart ? group.frame(slot) : group.predicted_frame(slot);
}

}  // namespace limber::internal
