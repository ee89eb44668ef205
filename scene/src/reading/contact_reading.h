/// @file contact_reading.h
/// Reads contact of a scene: its rules, statics, sensors, and the contact properties of bodies.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "limber/internal/strict_json.h"
#include "limber/scene/scene_file.h"

namespace limber::internal {

/// The member `contact`; without one, the defaults where there are statics, else none.
void read_contact(const JsonObject& o, Scene& scene);

SceneStatic read_static(const nlohmann::json& value, const std::string& where, const Scene& scene,
                        const std::filesystem::path& folder);

SceneSensor read_sensor(const nlohmann::json& value, const std::string& where, const std::filesystem::path& folder);

/// `friction`, `shape` and the like of a body, which only a scene with contact may have, and `layers` and `meets`,
/// which one with sensors may have too.
void read_touch(const JsonObject& o, const Scene& scene, const std::filesystem::path& folder, SceneBody& body);

}  // namespace limber::internal
