// Edges along which the boundary of a tetrahedral mesh touches itself.
#pragma once

#include "limber/mesh/tet_mesh.h"

namespace limber::internal {

/// The tets around such an edge form several fans that share nothing but the edge. All fans but one get a node of their
/// own in the middle of it, which halves their tets: the shape stays, and every edge of the boundary then has two
/// triangles. @return edges opened
Index open_pinched_edges(TetMesh& mesh);

}  // namespace limber::internal
