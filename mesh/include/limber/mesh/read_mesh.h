/// @file limber/mesh/read_mesh.h
/// Meshes from files. The format is told by the content where it has a signature, else by the extension.
///
/// Strict about meaning, lenient about form: comments, blank lines, CRLF, 0-based or 1-based numbering and polygons with
/// more than three sides are all read; a wrong count, index or number is one error naming file, place, seen and expected.
#pragma once

#include <filesystem>
#include <string>

#include "limber/mesh/surface_mesh.h"
#include "limber/mesh/tet_mesh.h"

namespace limber {

enum class MeshKind { kTets, kSurface };

/// What is in a file, from its signature and extension; reads only what it must.
/// @throws InputError if the file cannot be read or its format is not known (the message lists the known ones).
MeshKind mesh_kind(const std::filesystem::path& path);

/// Gmsh MSH 2.2 and 4.1 (ASCII and binary), MEDIT .mesh, TetGen .node/.ele (name either), VTK legacy (ASCII and binary).
/// The result is validated. @throws InputError
TetMesh read_tet_mesh(const std::filesystem::path& path, Warnings& warnings);

/// OBJ, STL and PLY (text and binary). STL, a soup of triangles, is welded at equal coordinates. The result is validated.
/// Other formats: limber::mesh_assimp. @throws InputError
SurfaceMesh read_surface_mesh(const std::filesystem::path& path, Warnings& warnings);

}  // namespace limber
