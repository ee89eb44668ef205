#include "limber/mesh/ten_node_tet.h"

#include <Eigen/LU>
#include <algorithm>
#include <utility>

#include "limber/core/error.h"

namespace limber {
namespace {

// Node numbers within a ten-node tet, corners 0–3, edges 4–9. One eighth at each corner; the octahedron between them is
// cut in four around its diagonal from the middle of 01 to that of 23.
constexpr std::array<std::array<std::size_t, 4>, 8> kEighths{
    {{0, 4, 6, 7}, {4, 1, 5, 8}, {6, 5, 2, 9}, {7, 8, 9, 3}, {4, 9, 5, 6}, {4, 9, 6, 7}, {4, 9, 7, 8}, {4, 9, 8, 5}}};

/// Barycentric coordinates of a node of the ten in its tet.
Eigen::Vector4d place_of(std::size_t node) {
  if (node < 4) return Eigen::Vector4d::Unit(static_cast<Eigen::Index>(node));
  const auto [a, b] = kTetEdges[node - 4];
  return 0.5 * (Eigen::Vector4d::Unit(a) + Eigen::Vector4d::Unit(b));
}

using EighthMaps = std::array<std::array<double, 16>, 8>;

/// From coordinates in the tet to those in each eighth.
EighthMaps make_eighth_maps() {
  EighthMaps maps{};
  for (std::size_t e = 0; e < kEighths.size(); ++e) {
    Eigen::Matrix4d corners;
    for (std::size_t c = 0; c < 4; ++c) corners.col(static_cast<Eigen::Index>(c)) = place_of(kEighths[e][c]);
    Eigen::Map<Eigen::Matrix4d>(maps[e].data()) = corners.inverse();
  }
  return maps;
}

struct TetEdge {
  std::pair<Index, Index> nodes;  // ascending
  std::size_t tet, place;
};

/// The edges of all tets, equal ones beside each other.
std::vector<TetEdge> sorted_tet_edges(const TetMesh& mesh) {
  std::vector<TetEdge> edges;
  edges.reserve(6 * mesh.tets.size());
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    for (std::size_t e = 0; e < kTetEdges.size(); ++e)
      edges.push_back({std::minmax({mesh.tets[t][static_cast<std::size_t>(kTetEdges[e][0])],
                                    mesh.tets[t][static_cast<std::size_t>(kTetEdges[e][1])]}),
                       t, e});
  std::sort(edges.begin(), edges.end(), [](const TetEdge& a, const TetEdge& b) {
    return std::tie(a.nodes, a.tet, a.place) < std::tie(b.nodes, b.tet, b.place);
  });
  return edges;
}

}  // namespace

std::array<double, 10> quadratic_shape(const Barycentric& L) {
  std::array<double, 10> N{};
  for (std::size_t a = 0; a < 4; ++a) N[a] = L[a] * (2.0 * L[a] - 1.0);
  for (std::size_t e = 0; e < 6; ++e)
    N[4 + e] = 4.0 * L[static_cast<std::size_t>(kTetEdges[e][0])] * L[static_cast<std::size_t>(kTetEdges[e][1])];
  return N;
}

std::array<std::array<double, 4>, 10> quadratic_shape_slopes(const Barycentric& L) {
  std::array<std::array<double, 4>, 10> slopes{};
  for (std::size_t a = 0; a < 4; ++a) slopes[a][a] = 4.0 * L[a] - 1.0;
  for (std::size_t e = 0; e < 6; ++e) {
    const auto a = static_cast<std::size_t>(kTetEdges[e][0]), b = static_cast<std::size_t>(kTetEdges[e][1]);
    slopes[4 + e][a] = 4.0 * L[b];
    slopes[4 + e][b] = 4.0 * L[a];
  }
  return slopes;
}

void add_mid_edge_nodes(TetMesh& mesh) {
  if (mesh.has_mid_edge_nodes()) return;
  mesh.mid_edge_nodes.resize(mesh.tets.size());
  const std::size_t corners = mesh.nodes.size();
  std::vector<std::pair<Index, Index>> ends;  // of each new node
  for (const TetEdge& edge : sorted_tet_edges(mesh)) {
    if (ends.empty() || ends.back() != edge.nodes) {
      ends.push_back(edge.nodes);
      mesh.nodes.push_back(0.5 * (mesh.nodes[static_cast<std::size_t>(edge.nodes.first)] +
                                  mesh.nodes[static_cast<std::size_t>(edge.nodes.second)]));
    }
    mesh.mid_edge_nodes[edge.tet][edge.place] = static_cast<Index>(mesh.nodes.size()) - 1;
  }
  for (NodeGroup& group : mesh.node_groups) {
    std::vector<char> has(corners, 0);
    for (const Index n : group.nodes) has[static_cast<std::size_t>(n)] = 1;
    for (std::size_t e = 0; e < ends.size(); ++e)
      if (has[static_cast<std::size_t>(ends[e].first)] && has[static_cast<std::size_t>(ends[e].second)])
        group.nodes.push_back(static_cast<Index>(corners + e));
  }
}

std::vector<Index> drop_mid_edge_nodes(TetMesh& mesh) {
  mesh.mid_edge_nodes.clear();
  return drop_unused_nodes(mesh);
}

TetMesh split_into_eight(const TetMesh& mesh) {
  if (!mesh.has_mid_edge_nodes()) throw InvalidArgument("split_into_eight: the mesh has no mid-edge nodes");
  TetMesh split{.nodes = mesh.nodes, .regions = mesh.regions, .node_groups = mesh.node_groups};
  split.tets.reserve(8 * mesh.tets.size());
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    const TetNodes nodes(mesh, t);
    for (const auto& e : kEighths) split.tets.push_back({nodes[e[0]], nodes[e[1]], nodes[e[2]], nodes[e[3]]});
    split.tet_region.insert(split.tet_region.end(), kEighths.size(), mesh.tet_region[t]);
  }
  return split;
}

PointInEighth point_in_eighth(const Barycentric& L) {
  static const EighthMaps kMaps = make_eighth_maps();
  const Eigen::Map<const Eigen::Vector4d> point(L.data());
  PointInEighth best;
  double greatest = -kUnbounded;
  for (std::size_t e = 0; e < kMaps.size(); ++e) {
    const Eigen::Vector4d there = Eigen::Map<const Eigen::Matrix4d>(kMaps[e].data()) * point;
    if (!(there.minCoeff() > greatest)) continue;
    greatest = there.minCoeff();
    best.eighth = static_cast<Index>(e);
    best.corner = kEighths[e];
    std::copy_n(there.data(), 4, best.L.begin());
  }
  return best;
}

}  // namespace limber
