/// @file limber/internal/joint_spec_json.h
/// Joints as files tell them (docs/formats/joints.md): type, origin, axis or frame, pitch, limits, and what drives
/// them. Shared by the joints file, scenes and assets. Private to limber's own sources.
#pragma once

#include <optional>
#include <string>
#include <vector>

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

/// Actuation of one coordinate: `motor`, `drive`, `friction`.
JointActuation read_joint_actuation(const nlohmann::json& value, const std::string& where);
/// The member `coordinates`: of as many coordinates as the type has at most; none where it is not there.
std::vector<JointActuation> read_joint_coordinates(const JsonObject& o, JointType type);

// The other way: numbers read back to the same bits.
/// Adds `type`, `origin`, `axis`, `frame`, and `pitch` where there is one.
void write_joint_kind(const JointSpec& joint, nlohmann::ordered_json& out);
/// `limits`; null where nothing stops the motion.
nlohmann::ordered_json joint_limits_json(const JointSpec& joint);
nlohmann::ordered_json joint_actuation_json(const JointActuation& actuation);

}  // namespace limber::internal
