/// @file soup.h
/// Components of surfaces whose triangles or shells share no vertices where they continue each other. Private to the
/// articulation module.
#pragma once

#include <vector>

#include "limber/articulation/assembly.h"

namespace limber::internal {

/// Shells of a triangle soup, a label per triangle, numbered by first triangle. Two triangles belong together if they
/// run through the same edge (vertices within `tolerance`) in opposite senses. If more than two do, those that
/// bound the least wedge of material go together; a fold onto itself is none: it is two parts that touch.
std::vector<Index> shells_of_soup(SurfaceMesh surface, double tolerance);

/// Proposes to merge components most of whose open edges lie on each other.
void propose_by_open_edges(Assembly& assembly);

}  // namespace limber::internal
