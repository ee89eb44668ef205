/// @file mesh_files.h
/// Meshes from and to files, as tests want them.
#pragma once

#include <filesystem>
#include <variant>

#include "limber/core/file.h"
#include "limber/mesh/read_mesh.h"
#include "limber/mesh/write_mesh.h"

namespace limber::testing {

/// @throws std::bad_variant_access if the file holds a surface
inline TetMesh read_tets(const std::filesystem::path& path, Warnings& warnings) {
  return std::get<TetMesh>(read_mesh(path, warnings));
}

inline void write_obj(const std::filesystem::path& path, const SurfaceMesh& surface) {
  write_file(path, obj_text(surface));
}

}  // namespace limber::testing
