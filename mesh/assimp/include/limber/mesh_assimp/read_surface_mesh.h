/// @file limber/mesh_assimp/read_surface_mesh.h
/// Surfaces from every format that the Assimp library reads: 3DS, COLLADA, FBX, 3MF and some forty more. A target
/// of its own (limber::mesh_assimp), so that only those who ask for it link Assimp.
#pragma once

#include <filesystem>
#include <variant>

#include "limber/mesh/grouped_surface.h"
#include "limber/mesh/read_mesh.h"
#include "limber/mesh_assimp/file_unit.h"

namespace limber {

/// Every mesh of the file in one surface: placed by the transforms of the nodes that show it, triangulated, welded (see
/// weld(); vertices that differ in normal or texture alone become one). A node that mirrors keeps the outside out.
/// Points and lines are left out, with a warning. Lengths are in metres where the file states its unit (see FileUnit);
/// axes are the file's own. Nothing is logged. Assimp works in a forked child process with limits of time and memory,
/// so that a damaged file cannot end the caller. The result is validated.
/// @param unit if given, what was taken @throws InputError in one line, with Assimp's reason
SurfaceMesh read_surface_mesh_with_assimp(const std::filesystem::path& path, Warnings& warnings,
                                          FileUnit* unit = nullptr);

/// The door for programs: limber's own reader where is_known_mesh_format(), else Assimp's. @throws InputError
SurfaceMesh read_any_surface_mesh(const std::filesystem::path& path, Warnings& warnings, FileUnit* unit = nullptr);

/// Tets or a surface, whatever the file holds, by limber's own reader or Assimp's. @throws InputError
std::variant<TetMesh, SurfaceMesh> read_any_mesh(const std::filesystem::path& path, Warnings& warnings,
                                                 FileUnit* unit = nullptr);

/// A surface with the names of nodes and materials: by read_grouped_surface() where is_known_mesh_format(), else by
/// Assimp. Assimp splits vertices that differ in normal or texture; they are joined again within each node, not
/// across. @throws InputError
GroupedSurface read_any_grouped_surface(const std::filesystem::path& path, Warnings& warnings,
                                        FileUnit* unit = nullptr);

}  // namespace limber
