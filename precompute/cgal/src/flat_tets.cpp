#include "flat_tets.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

namespace limber::internal {
namespace {

using Edge = std::pair<Index, Index>;
using Face = std::array<Index, 3>;

Face opposite(const Tet& tet, int corner) {
  Face face{tet[(corner + 1) % 4], tet[(corner + 2) % 4], tet[(corner + 3) % 4]};
  std::sort(face.begin(), face.end());
  return face;
}

/// The boundary of a mesh from which tets are taken away.
class Boundary {
 public:
  explicit Boundary(const TetMesh& mesh) {
    for (const Tet& t : mesh.tets)
      for (int a = 0; a < 4; ++a) ++tets_at_[opposite(t, a)];
    for (const auto& [face, tets] : tets_at_)
      if (tets == 1) count_edges(face, 1);
  }

  /// Takes a tet away if that flips an edge of the boundary. @return whether it did
  bool flip(const Tet& tet) {
    std::array<int, 4> corner{};  // first the two opposite to faces in the boundary
    int outside = 0, inside = 4;
    for (int a = 0; a < 4; ++a) (tets_at_.at(opposite(tet, a)) == 1 ? corner[outside++] : corner[--inside]) = a;
    // The faces opposite to corners 0 and 1 share the edge between 2 and 3; the new faces share that between 0 and 1.
    if (outside != 2 || edge_count(tet[corner[0]], tet[corner[1]]) > 0) return false;
    for (int a = 0; a < 4; ++a) {
      const Face face = opposite(tet, a);
      const bool was_boundary = --tets_at_.at(face) == 0;
      count_edges(face, was_boundary ? -1 : 1);
    }
    return true;
  }

 private:
  int edge_count(Index a, Index b) const {
    const auto found = triangles_at_.find(std::minmax(a, b));
    return found == triangles_at_.end() ? 0 : found->second;
  }
  void count_edges(const Face& face, int by) {
    for (int a = 0; a < 3; ++a) triangles_at_[std::minmax(face[a], face[(a + 1) % 3])] += by;
  }

  std::map<Face, int> tets_at_;
  std::map<Edge, int> triangles_at_;  ///< of the boundary, per edge
};

}  // namespace

double shape(const TetMesh& mesh, const Tet& tet) {
  double squared = 0.0;
  for (int a = 0; a < 4; ++a)
    for (int b = a + 1; b < 4; ++b) squared += (mesh.nodes[tet[a]] - mesh.nodes[tet[b]]).squaredNorm();
  const double regular = std::pow(squared / 6.0, 1.5) / (6.0 * std::numbers::sqrt2);
  Mat3 edges;
  for (int a = 0; a < 3; ++a) edges.col(a) = mesh.nodes[tet[a + 1]] - mesh.nodes[tet[0]];
  return edges.determinant() / 6.0 / regular;
}

double worst_shape(const TetMesh& mesh) {
  double worst = 1.0;
  for (const Tet& t : mesh.tets) worst = std::min(worst, shape(mesh, t));
  return worst;
}

Index peel_flat_tets(TetMesh& mesh, double least_shape) {
  std::vector<std::size_t> flat;
  for (std::size_t i = 0; i < mesh.tets.size(); ++i)
    if (shape(mesh, mesh.tets[i]) < least_shape) flat.push_back(i);
  if (flat.empty()) return 0;
  Boundary boundary(mesh);
  std::vector<bool> gone(mesh.tets.size(), false);
  Index peeled = 0;
  for (bool again = true; again;) {
    again = false;
    for (const std::size_t i : flat) {
      if (gone[i] || !boundary.flip(mesh.tets[i])) continue;
      gone[i] = again = true;
      ++peeled;
    }
  }
  std::size_t kept = 0;
  for (std::size_t i = 0; i < mesh.tets.size(); ++i)
    if (!gone[i]) mesh.tets[kept++] = mesh.tets[i];
  mesh.tets.resize(kept);
  return peeled;
}

}  // namespace limber::internal
