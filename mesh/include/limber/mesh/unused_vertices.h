/// @file limber/mesh/unused_vertices.h
/// Vertices that no triangle uses.
#pragma once

#include <string>

#include "limber/mesh/surface_mesh.h"

namespace limber {

/// Leaves them out, with one warning that counts them; the others keep their order. Readers of surfaces end with it.
/// @param name of the file, for the warning @pre the surface is valid (see validate())
void drop_unused_vertices(SurfaceMesh& surface, const std::string& name, Warnings& warnings);

}  // namespace limber
