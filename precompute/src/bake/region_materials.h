/// @file region_materials.h
/// Materials of a mesh's regions, by a table of names.
#pragma once

#include <vector>

#include "limber/mesh/tet_mesh.h"
#include "limber/model/material.h"

namespace limber::internal {

/// The material of each region; one that no tet uses may have none. @throws InputError naming a region without one
std::vector<Material> materials_by_region(const TetMesh& mesh, const MaterialTable& table);

void warn_of_unknown_regions(const TetMesh& mesh, const MaterialTable& table, Warnings& warnings);

}  // namespace limber::internal
