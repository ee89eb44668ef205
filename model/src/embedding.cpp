#include "limber/model/embedding.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "limber/core/error.h"
#include "limber/mesh/ten_node_tet.h"
#include "limber/mesh/tet_locator.h"

namespace limber {
namespace {

/// How much of the way from the nearest point's weights, all in [0, 1], to the point's own keeps every weight in
/// bounds.
double allowed_extrapolation(const TetLocation& at) {
  double allowed = 1.0;
  for (int a = 0; a < 4; ++a) {
    const double step = at.weight[a] - at.nearest[a];
    const double room = step > 0.0 ? kMaxEmbeddingWeight - at.nearest[a] : kMaxEmbeddingWeight + at.nearest[a];
    if (std::abs(step) > room) allowed = std::min(allowed, room / std::abs(step));
  }
  return allowed;
}

}  // namespace

Embedding embed(std::span<const Vec3> points, const TetMesh& mesh) {
  const TetLocator locator(mesh);
  Embedding out;
  out.vertices.reserve(points.size());
  for (const Vec3& p : points) {
    if (!p.allFinite())
      throw InvalidArgument("embed: point " + std::to_string(out.vertices.size()) +
                            " (counted from 0) has a coordinate that is not finite");
    const TetLocation at = locator.locate(p);
    EmbeddedVertex vertex{at.tet, at.weight};
    if (at.distance > 0.0) {
      const double s = allowed_extrapolation(at);
      for (int a = 0; a < 4; ++a) vertex.weight[a] = at.nearest[a] + s * (at.weight[a] - at.nearest[a]);
      ++out.outside;
      out.limited += s < 1.0;
      out.max_distance = std::max(out.max_distance, at.distance);
    }
    out.vertices.push_back(vertex);
  }
  return out;
}

Embedding embed_nodes(std::span<const Index> nodes, const TetMesh& mesh) {
  std::vector<EmbeddedVertex> at_node(mesh.nodes.size(), {-1, {}});
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    const TetNodes tet(mesh, t);
    for (std::size_t a = 0; a < tet.size(); ++a) {
      EmbeddedVertex& vertex = at_node[tet[a]];
      if (vertex.tet >= 0) continue;
      vertex.tet = static_cast<Index>(t);
      if (a < 4)
        vertex.weight[a] = 1.0;
      else
        for (const int end : kTetEdges[a - 4]) vertex.weight[end] = 0.5;
    }
  }
  Embedding out;
  out.vertices.reserve(nodes.size());
  for (const Index n : nodes) {
    if (n < 0 || static_cast<std::size_t>(n) >= at_node.size() || at_node[n].tet < 0)
      throw InvalidArgument("embed_nodes: node " + std::to_string(n) +
                            " is in no tetrahedron; the mesh has nodes 0 to " +
                            std::to_string(static_cast<std::int64_t>(at_node.size()) - 1));
    out.vertices.push_back(at_node[n]);
  }
  return out;
}

NodeShares node_shares(const TetMesh& mesh, const EmbeddedVertex& vertex) {
  const TetNodes tet(mesh, static_cast<std::size_t>(vertex.tet));
  NodeShares out{.count = tet.size()};
  std::copy(tet.begin(), tet.end(), out.node.begin());
  if (tet.size() == 4) {
    std::copy(vertex.weight.begin(), vertex.weight.end(), out.share.begin());
    return out;
  }
  Barycentric inside{};
  double sum = 0.0;
  for (std::size_t c = 0; c < 4; ++c) sum += inside[c] = std::max(vertex.weight[c], 0.0);
  for (double& L : inside) L /= sum;
  out.share = quadratic_shape(inside);
  if (inside == vertex.weight) return out;
  const auto slopes = quadratic_shape_slopes(inside);
  for (std::size_t a = 0; a < 10; ++a)
    for (std::size_t c = 0; c < 4; ++c) out.share[a] += slopes[a][c] * (vertex.weight[c] - inside[c]);
  return out;
}

}  // namespace limber
