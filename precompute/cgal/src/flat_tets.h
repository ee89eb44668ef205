// Flat tetrahedra in the boundary of a mesh.
#pragma once

#include "limber/mesh/tet_mesh.h"

namespace limber::internal {

/// Volume over that of the regular tet with the same mean squared edge: 1 is best, 0 flat, negative turned.
double shape(const TetMesh& mesh, const Tet& tet);
double worst_shape(const TetMesh& mesh);

/// Takes away tets of less than `least_shape` that have two faces in the boundary, while there are any: that flips an
/// edge of the boundary, between four nodes which lie in about one plane, as they do where a flat side of a body is but
/// one cell wide. An edge that the boundary has already is not made again. @return tets taken away
Index peel_flat_tets(TetMesh& mesh, double least_shape);

}  // namespace limber::internal
