/// @file limber/model/embedding.h
/// A surface embedded in a tetrahedral mesh: each vertex gets a tet and four barycentric weights, so that its modal
/// displacement is the exact interpolation of the nodes' ([H03] section 3.5).
#pragma once

#include <array>
#include <span>
#include <vector>

#include "limber/core/types.h"
#include "limber/mesh/tet_mesh.h"

namespace limber {

/// Where one vertex sits: p = Σ_a weight[a] · node[tet[a]].
struct EmbeddedVertex {
  Index tet = 0;
  std::array<double, 4> weight{};  ///< sums to 1; negative for a vertex outside every tet (linear extrapolation of the nearest)
};

struct Embedding {
  std::vector<EmbeddedVertex> vertices;
  Index outside = 0;          ///< how many lie outside every tet
  double max_distance = 0.0;  ///< the farthest of these from the mesh, m
};

/// Finds for each point the tet that holds it, else the nearest. Ties (shared faces) go to the lowest tet index.
/// Barycentric weights outside are clamped to the nearest tet's linear field at distances up to its size: weights stay
/// bounded, so a far vertex is not flung about.
Embedding embed(std::span<const Vec3> points, const TetMesh& mesh);

/// The exact embedding of boundary vertices that are nodes themselves.
Embedding embed_nodes(std::span<const Index> nodes, const TetMesh& mesh);

}  // namespace limber
