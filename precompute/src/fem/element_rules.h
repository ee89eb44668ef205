/// @file element_rules.h
/// Constants of four- and ten-node tets that assembly and error estimates share (limber/precompute/fem.h).
#pragma once

#include <cstddef>
#include <vector>

#include "limber/mesh/ten_node_tet.h"

namespace limber::internal {

/// Points of a rule that integrates exactly what the stiffness of a tet of so many nodes asks for, all of one weight:
/// the centroid (degree 1), or four points (degree 2). Stresses are most accurate there.
const std::vector<Barycentric>& rule_points(std::size_t nodes_per_tet);

/// ∫ N_a N_b dV over the volume.
double mass_share(std::size_t a, std::size_t b, std::size_t nodes_per_tet);

}  // namespace limber::internal
