/// @file assign_regions.h
/// Which tets of a mesh take which material.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "limber/mesh/grouped_surface.h"
#include "limber/mesh/tet_mesh.h"
#include "limber/precompute/material_regions.h"

namespace limber::internal {

/// Gives each tet its region: the last of `shapes` that holds its centroid, else the one that the table has a name for:
/// of the mesh's own, or of the nearest face. The mesh's regions are then those that have tets, one for each material;
/// those of a field carry one name. @param faces of the mesh's surface @return a material per region
/// @throws InputError if a region gets no tet, a field does not cover its region, a tet has no material, the table
/// names what is neither region nor faces, or faces are asked for that are not there
std::vector<Material> assign_regions(TetMesh& mesh, const MaterialTable& table, std::span<const MaterialRegion> shapes,
                                     const std::optional<GroupedSurface>& faces);

}  // namespace limber::internal
