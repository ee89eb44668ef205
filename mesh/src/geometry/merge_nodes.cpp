#include "limber/mesh/merge_nodes.h"

#include <algorithm>

#include "geometry/near_points.h"

namespace limber {
namespace {

/// Per node the node that stands for it; unused nodes stand for themselves, and for no other.
std::vector<Index> merged_into(const TetMesh& mesh, double tolerance) {
  std::vector<Index> used;
  std::vector<char> is_used(mesh.nodes.size(), 0);
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    for (const Index n : TetNodes(mesh, t)) is_used[n] = 1;
  std::vector<Vec3> places;
  std::vector<Index> of(mesh.nodes.size());
  for (std::size_t n = 0; n < of.size(); ++n) {
    of[n] = static_cast<Index>(n);
    if (!is_used[n]) continue;
    used.push_back(static_cast<Index>(n));
    places.push_back(mesh.nodes[n]);
  }
  const std::vector<Index> near = internal::representatives(places, tolerance);
  for (std::size_t i = 0; i < used.size(); ++i) of[used[i]] = used[near[i]];
  return of;
}

}  // namespace

Index count_touching_nodes(const TetMesh& mesh, double tolerance) {
  const std::vector<Index> body_of_tet = connected_components(mesh);
  std::vector<Index> body(mesh.nodes.size(), -1);
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    for (const Index n : TetNodes(mesh, t)) body[n] = body_of_tet[t];
  const std::vector<Index> of = merged_into(mesh, tolerance);
  Index count = 0;
  for (std::size_t n = 0; n < of.size(); ++n)
    if (body[of[n]] != body[n]) ++count;
  return count;
}

Index merge_nodes(TetMesh& mesh, double tolerance) {
  const std::vector<Index> of = merged_into(mesh, tolerance);
  for (Tet& t : mesh.tets)
    for (Index& n : t) n = of[n];
  for (MidEdgeNodes& middles : mesh.mid_edge_nodes)
    for (Index& n : middles) n = of[n];
  for (NodeGroup& group : mesh.node_groups) {
    for (Index& n : group.nodes) n = of[n];
    std::sort(group.nodes.begin(), group.nodes.end());
    group.nodes.erase(std::unique(group.nodes.begin(), group.nodes.end()), group.nodes.end());
  }
  Index gone = 0;
  for (std::size_t n = 0; n < of.size(); ++n) gone += of[n] != static_cast<Index>(n) ? 1 : 0;
  return gone;
}

Index count_crowded_faces(const TetMesh& mesh) {
  std::vector<Triangle> faces;
  faces.reserve(4 * mesh.tets.size());
  for (const Tet& t : mesh.tets)
    for (std::size_t left_out = 0; left_out < 4; ++left_out) {
      Triangle& face = faces.emplace_back();
      for (std::size_t a = 0; a < 3; ++a) face[a] = t[a < left_out ? a : a + 1];
      std::sort(face.begin(), face.end());
    }
  std::sort(faces.begin(), faces.end());
  Index crowded = 0;
  for (std::size_t i = 0; i < faces.size();) {
    const auto end =
        std::upper_bound(faces.begin() + static_cast<std::ptrdiff_t>(i), faces.end(), faces[i]) - faces.begin();
    if (static_cast<std::size_t>(end) - i > 2) ++crowded;
    i = static_cast<std::size_t>(end);
  }
  return crowded;
}

}  // namespace limber
