/// @file limber/mesh/ten_node_tet.h
/// Ten-node tetrahedra: quadratic displacements on straight sides. With barycentric coordinates L of a point in a tet,
///
///   N_a = L_a (2 L_a − 1)  at corner a,      N_ab = 4 L_a L_b  at the middle of edge ab.
#pragma once

#include <array>

#include "limber/mesh/tet_mesh.h"

namespace limber {

/// Barycentric coordinates of a point: of corners, sum 1.
using Barycentric = std::array<double, 4>;

/// N: four corners, then edges in the order of kTetEdges. Sum 1.
std::array<double, 10> quadratic_shape(const Barycentric& L);

/// ∂N/∂L_c, [node][c], the four L taken as independent.
std::array<std::array<double, 4>, 10> quadratic_shape_slopes(const Barycentric& L);

/// Gives each edge a node in its middle, behind the nodes there are, in ascending order of the edge's two nodes.
/// A node group gains the middles of edges whose two nodes it has, so that it names the same places as before.
/// Nothing happens to a mesh that has mid-edge nodes. @pre mesh is valid
void add_mid_edge_nodes(TetMesh& mesh);

/// Four-node tets on the corners alone; all other nodes go, from the groups too, and so do groups left empty.
/// @return per node that stayed, its index before
std::vector<Index> drop_mid_edge_nodes(TetMesh& mesh);

/// Eight four-node tets in the place of each tet, those of tet t being 8 t … 8 t + 7, on the same nodes with the same
/// groups and regions. @pre mesh has mid-edge nodes
TetMesh split_into_eight(const TetMesh& mesh);

/// Where in split_into_eight()'s tets a point of a ten-node tet lies: in the one of eight where its least coordinate is
/// greatest (of equal ones the first), which holds it if it lies in the tet; and its coordinates there.
struct PointInEighth {
  Index eighth = 0;
  std::array<std::size_t, 4> corner{};  ///< as TetNodes counts the ten nodes
  Barycentric L{};
};
PointInEighth point_in_eighth(const Barycentric& L);

}  // namespace limber
