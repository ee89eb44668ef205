/// @file limber/model/embedding.h
/// A surface embedded in a tetrahedral mesh: each vertex gets a tet and four weights, its barycentric coordinates
/// there. Its modal displacement is then a sum over the tet's nodes, Σ_a weight[a] · u(node a) with four of them:
/// inside, the finite elements' own interpolation ([H03] section 3.5). node_shares() is that sum, for ten-node tets
/// too.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "limber/core/types.h"
#include "limber/mesh/tet_mesh.h"

namespace limber {

/// Tet and weights that a vertex moves with.
struct EmbeddedVertex {
  Index tet = 0;
  std::array<double, 4> weight{};  ///< sums to 1; size at most kMaxEmbeddingWeight; some negative outside the mesh
};

/// Bound on the size of a weight outside the mesh.
inline constexpr double kMaxEmbeddingWeight = 2.0;

struct Embedding {
  std::vector<EmbeddedVertex> vertices;
  Index outside = 0;          ///< how many lie outside every tet
  Index limited = 0;          ///< how many of these are too far out for the whole linear field
  double max_distance = 0.0;  ///< the farthest of these from the mesh, m
};

/// Finds for each point the tet that holds it, else the nearest (ties as in TetLocator::locate).
///
/// A render surface lies partly outside the tets that approximate it. There the nearest tet's linear displacement field
/// is continued, not held at its boundary value: a vertex at distance d from the tets must turn with them, and a held
/// value would err by d times the rotation. If the tet is too flat or the point too far for that, weights of
/// size above kMaxEmbeddingWeight would fling the vertex about: then the field is followed only part of the way, on the
/// line from the nearest point of the mesh (weights in [0, 1]) to the vertex, as far as the bound allows. So always Σ
/// weight = 1, hence translations are exact everywhere, and any linear field is exact inside and for every vertex not
/// counted as `limited`; for all but those Σ weight · node is the vertex itself.
/// @throws InvalidArgument if a point is not finite, or if the mesh has no tets. @pre the mesh is validated
Embedding embed(std::span<const Vec3> points, const TetMesh& mesh);

/// Nodes of the mesh as embedded vertices: each lies in the first tet that uses it, at a corner (weight 1) or in the
/// middle of an edge (twice ½).
/// @throws InvalidArgument naming a node that is out of range or in no tet
Embedding embed_nodes(std::span<const Index> nodes, const TetMesh& mesh);

/// Parts that a vertex takes of the displacements of a tet's nodes: u = Σ share[i] · u(node[i]). Sum 1; any linear
/// field is exact.
struct NodeShares {
  std::array<Index, 10> node{};
  std::array<double, 10> share{};
  std::size_t count = 0;  ///< 4 or 10
};

/// Of a four-node tet the weights themselves. Of a ten-node tet the quadratic shape functions; outside, the field goes
/// on linearly from the point in the tet whose weights are the vertex's positive ones: a parabola would run away.
NodeShares node_shares(const TetMesh& mesh, const EmbeddedVertex& vertex);

}  // namespace limber
