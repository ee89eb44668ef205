// What a file that Assimp has read states of its unit and its upward axis.
#pragma once

#include <assimp/scene.h>

#include <assimp/Importer.hpp>
#include <filesystem>

#include "limber/mesh_assimp/file_unit.h"

namespace limber::internal {

/// A unit, and what is left of it to apply: Assimp scales COLLADA files itself.
struct UnitOfScene {
  FileUnit unit;
  double factor = 1.0;  ///< metres per unit of the scene's coordinates
};

/// @param importer that has just read the scene @throws InputError where the unit that the file states is none
UnitOfScene unit_of(const Assimp::Importer& importer, const aiScene& scene, const std::filesystem::path& path);

}  // namespace limber::internal
