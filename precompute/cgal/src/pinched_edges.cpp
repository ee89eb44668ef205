#include "pinched_edges.h"

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "limber/core/disjoint_sets.h"
#include "limber/mesh/surface_mesh.h"

namespace limber::internal {
namespace {

using Edge = std::pair<Index, Index>;

std::vector<Edge> pinched_edges(const TetMesh& mesh) {
  const BoundarySurface boundary = boundary_surface(mesh);
  std::map<Edge, int> triangles_at;
  for (const Triangle& t : boundary.surface.triangles)
    for (int a = 0; a < 3; ++a)
      triangles_at[std::minmax(boundary.node_of[t[a]], boundary.node_of[t[(a + 1) % 3]])] += 1;
  std::vector<Edge> pinched;
  for (const auto& [edge, triangles] : triangles_at)
    if (triangles > 2) pinched.push_back(edge);
  return pinched;
}

bool contains(const Tet& tet, Index node) { return std::find(tet.begin(), tet.end(), node) != tet.end(); }

/// A mesh whose tets can be halved.
class Halving {
 public:
  explicit Halving(TetMesh& mesh) : mesh_(mesh), tets_at_(mesh.nodes.size()) {
    for (std::size_t i = 0; i < mesh.tets.size(); ++i)
      for (const Index n : mesh.tets[i]) tets_at_[n].push_back(static_cast<Index>(i));
  }

  /// The tets around an edge, those that share a face together.
  std::vector<std::vector<Index>> fans(const Edge& edge) const {
    std::vector<Index> around;
    for (const Index i : tets_at_[edge.first])
      if (contains(mesh_.tets[i], edge.first) && contains(mesh_.tets[i], edge.second)) around.push_back(i);
    DisjointSets sets(around.size());
    std::map<Index, Index> seen;  // per node beside the edge, a tet that has it
    for (std::size_t k = 0; k < around.size(); ++k)
      for (const Index n : mesh_.tets[around[k]]) {
        if (n == edge.first || n == edge.second) continue;
        const auto [entry, fresh] = seen.try_emplace(n, static_cast<Index>(k));
        if (!fresh) sets.join(static_cast<Index>(k), entry->second);
      }
    const std::vector<Index> label = sets.labels();
    std::vector<std::vector<Index>> fans;
    for (std::size_t k = 0; k < around.size(); ++k) {
      fans.resize(std::max<std::size_t>(fans.size(), label[k] + 1));
      fans[label[k]].push_back(around[k]);
    }
    return fans;
  }

  void halve(const std::vector<Index>& fan, const Edge& edge) {
    const auto middle = static_cast<Index>(mesh_.nodes.size());
    mesh_.nodes.push_back(0.5 * (mesh_.nodes[edge.first] + mesh_.nodes[edge.second]));
    tets_at_.emplace_back();
    for (const Index i : fan) {
      const auto other = static_cast<Index>(mesh_.tets.size());
      mesh_.tets.push_back(mesh_.tets[i]);
      std::replace(mesh_.tets[i].begin(), mesh_.tets[i].end(), edge.second, middle);
      std::replace(mesh_.tets[other].begin(), mesh_.tets[other].end(), edge.first, middle);
      tets_at_[middle].push_back(i);
      for (const Index n : mesh_.tets[other]) tets_at_[n].push_back(other);
    }
  }

 private:
  TetMesh& mesh_;
  std::vector<std::vector<Index>> tets_at_;  ///< per node; tets that have since lost it too
};

}  // namespace

Index open_pinched_edges(TetMesh& mesh) {
  const std::vector<Edge> pinched = pinched_edges(mesh);
  if (pinched.empty()) return 0;
  Halving halving(mesh);
  for (const Edge& edge : pinched) {
    const auto fans = halving.fans(edge);
    for (std::size_t f = 1; f < fans.size(); ++f) halving.halve(fans[f], edge);
  }
  return static_cast<Index>(pinched.size());
}

}  // namespace limber::internal
