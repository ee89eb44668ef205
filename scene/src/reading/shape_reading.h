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

/// The member `shape` of a body or static. @param folder that files are relative to @param ends whether a half-space,
/// which has no end, is refused @throws InputError
SceneShape read_shape(const JsonObject& parent, const std::filesystem::path& folder, bool ends);

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
