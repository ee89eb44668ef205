/// @file limber/internal/joint_spec_json.h
/// Joints as files tell them (docs/formats/joints.md): type, origin, axis or frame, pitch and limits. Shared by the
/// joints file and scenes. Private to limber's own sources.
#pragma once

#include <optional>

#include "limber/internal/strict_json.h"
#include "limber/model/joint_spec.h"

namespace limber::internal {

// Members of limits that each type has.
bool has_rotation(JointType type);
bool has_translation(JointType type);

/// The column of the frame that `axis` repeats: x, or z for planar; none for ball and fixed.
std::optional<int> axis_column(JointType type);

/// The member `limits` of a joint, which must be there; null: nothing stops the motion.
JointLimits read_joint_limits(const JsonObject& joint, JointType type);

/// All but the limits. `axis` wins over `frame`: it is what people edit.
JointSpec read_joint_kind(const JsonObject& o);

}  // namespace limber::internal
