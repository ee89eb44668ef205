/// @file limber/tet_overlap/tet_overlap_normals.h
/// Normals of overlaps from the tetrahedra of both bodies that overlap, as in [H03], which gives no formula: out of B
/// into A
///
///   n ∝ ∮_{∂B∩A} n_B dA = −∮_{∂A∩B} n_A dA
///
/// over each connected part (patch) of the region A ∩ B. Moving A by d changes the region's volume by
/// −d · ∮_{∂B∩A} n_B dA, so n is the way that frees the bodies fastest; it does not change sides in the middle of a
/// body. All vertices inside, of A and of B, have their patch's normal. Patches whose area vectors cancel (a body
/// inside another, a bar right through a wall) have none. Costs O(nodes · modes) for each pair that overlaps.
///
/// For compact overlaps. Where a patch wraps around (a ball in a close cup) one normal cannot free all of it, and
/// depths along it are long at the sides: there OverlapMethod::kRestDepth is the better choice.
///
///   ContactFinder finder({.normals = tet_overlap_normals});
#pragma once

#include <memory>

#include "limber/collision/narrow_phase.h"

namespace limber {

/// For one thread. It allocates the first time that it sees a model or a larger pair.
std::unique_ptr<OverlapNormals> tet_overlap_normals();

}  // namespace limber
