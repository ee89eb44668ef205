/// @file limber/mesh/write_mesh.h
/// Meshes to files. Numbers are written so that reading gives the same bits back; a file appears whole or not at all.
#pragma once

#include <filesystem>
#include <string>

#include "limber/mesh/surface_mesh.h"
#include "limber/mesh/tet_mesh.h"

namespace limber {

/// Gmsh MSH 2.2, text: tets of 4 or 10 nodes, regions as physical volumes with their names and tags (a fresh tag where
/// one is 0 or taken), node groups as physical points. read_mesh() gives the same mesh back, and each region as a
/// node group besides.
/// @throws InvalidArgument if an index is out of range or a name holds a quote or a line end. @throws InputError (see
/// write_file())
void write_gmsh(const std::filesystem::path& path, const TetMesh& mesh);

/// Wavefront OBJ: positions and triangles; numbers read back to the same bits.
/// @throws InvalidArgument if an index is out of range
std::string obj_text(const SurfaceMesh& surface);

/// Binary STL: three float32 corners and a normal per triangle; vertices are not shared.
/// @throws InvalidArgument if an index is out of range or there are more than 2³² − 1 triangles
std::string stl_bytes(const SurfaceMesh& surface);

}  // namespace limber
