/// @file limber/mesh/read_mesh.h
/// Meshes from files. The format is told by the content where it has a signature, else by the extension; what each
/// format gives is in docs/formats/meshes.md.
///
/// | format | holds | signature or extension |
/// |---|---|---|
/// | Gmsh MSH 2.x, 4.1, text and binary | tets or surface | `$MeshFormat`, .msh |
/// | MEDIT, text | tets or surface | `MeshVersionFormatted`, .mesh |
/// | VTK legacy 1 to 5.1, text and binary | tets or surface | `# vtk DataFile`, .vtk |
/// | TetGen | tets | .node, .ele (name either; both must be there) |
/// | PLY, text and binary | surface | `ply`, .ply |
/// | OBJ; glTF 2.0, text and binary | surface | .obj; `glTF`, .gltf, .glb |
/// | OFF, text and binary | surface | .off |
/// | STL, text and binary | surface | .stl |
///
/// Strict about meaning, lenient about form: comments, blank lines, CRLF, 0-based or 1-based numbering and polygons
/// with more than three sides are all read; a wrong count, index or number is one error naming file, place, seen and
/// expected. Errors and warnings are one line each. Lengths are taken as metres. The results are validated (see
/// validate()).
#pragma once

#include <filesystem>
#include <string>
#include <variant>

#include "limber/mesh/surface_mesh.h"
#include "limber/mesh/tet_mesh.h"

namespace limber {

/// True if limber reads the file's format itself; the content may still be wrong.
/// @throws InputError if the file cannot be read
bool is_known_mesh_format(const std::filesystem::path& path);

/// Whatever the file holds: tets if there are any, else the surface. Tets come with their regions and node groups;
/// these are sorted by name, and every region whose name no group has is a group too. @throws InputError
std::variant<TetMesh, SurfaceMesh> read_mesh(const std::filesystem::path& path, Warnings& warnings);

/// A surface, polygons cut into triangles. Vertices in the order of the file, but for STL, a soup of triangles, and
/// glTF, which are welded (see weld()). Other formats: limber::mesh_assimp. @throws InputError, also for a file that
/// holds tetrahedra
SurfaceMesh read_surface_mesh(const std::filesystem::path& path, Warnings& warnings);

}  // namespace limber
