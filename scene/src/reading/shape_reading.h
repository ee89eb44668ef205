/// @file shape_reading.h
/// Rigid shapes as scenes tell them.
#pragma once

#include <filesystem>
#include <memory>
#include <utility>
#include <vector>

#include "limber/internal/strict_json.h"
#include "limber/scene/scene_file.h"

namespace limber::internal {

/// What wears a shape, which not every kind suits: a half-space is for statics, sensors are convex.
enum class Wearer { kStatic, kBody, kSensor };

/// The member `shape` of a body, static or sensor. @param folder that files are relative to @throws InputError
SceneShape read_shape(const JsonObject& parent, const std::filesystem::path& folder, Wearer wearer);

/// Makes shapes, each file once.
class ShapeLoader {
 public:
  /// @param where for messages @throws InputError
  std::shared_ptr<const Shape> load(const SceneShape& shape, const std::string& where, Warnings& warnings);

 private:
  std::vector<std::pair<ShapeFile, std::shared_ptr<const Shape>>> read_;
};

/// Warns of an open mesh that lets what falls on it pass: triangles are solid from in front alone.
void warn_of_facing(const Shape& shape, const RigidTransform& pose, const Vec3& gravity, const std::string& where,
                    Warnings& warnings);

}  // namespace limber::internal
