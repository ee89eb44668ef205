/// @file limber/mesh/merge_nodes.h
/// Nodes of tetrahedra at one place that are several: parts that were meshed one by one.
#pragma once

#include "limber/mesh/tet_mesh.h"

namespace limber {

/// How many nodes lie within `tolerance` of a node of another body (tets that share nodes are one body).
/// @param tolerance ≥ 0, m @pre the mesh is valid
Index count_touching_nodes(const TetMesh& mesh, double tolerance);

/// Makes one node of those within `tolerance` of each other: the first stays where it is, and the groups of all have
/// it. Nodes that are merged away stay in the list, unused, so that numbers of nodes stay the same. Validate the mesh
/// afterwards: a tolerance as long as an edge makes tets that have a node twice.
/// @param tolerance ≥ 0, m @return how many nodes were merged away @pre the mesh is valid
Index merge_nodes(TetMesh& mesh, double tolerance);

/// How many triangles are faces of three or more tets: there tets overlap.
Index count_crowded_faces(const TetMesh& mesh);

}  // namespace limber
