/// @file hole_caps.h
/// Triangles that close the small holes of a surface, so that it bounds a solid. Private to the articulation module.
#pragma once

#include <optional>
#include <vector>

#include "limber/mesh/surface_mesh.h"

namespace limber::internal {

/// Triangles over the surface's vertices that close its holes: a fan over each rim, turned like the surface. None are
/// needed where every edge is run through as often one way as the other. Nothing comes back where the fan of one hole
/// has more than 1 % of the surface's area, all together more than 5 %, or no volume is enclosed.
std::optional<std::vector<Triangle>> small_hole_caps(const SurfaceMesh& surface);

}  // namespace limber::internal
