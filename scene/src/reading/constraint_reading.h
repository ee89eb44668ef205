/// @file constraint_reading.h
/// Handles and joints as scenes tell them.
#pragma once

#include <string>

#include "limber/internal/strict_json.h"
#include "limber/scene/scene_file.h"

namespace limber::internal {

SceneHandle read_handle(const nlohmann::json& value, const std::string& where, const Scene& scene);
SceneJoint read_joint(const nlohmann::json& value, const std::string& where);

}  // namespace limber::internal
