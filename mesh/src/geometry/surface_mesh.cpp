#include "limber/mesh/surface_mesh.h"

#include <algorithm>
#include <utility>

#include "geometry/near_points.h"
#include "limber/core/disjoint_sets.h"
#include "limber/core/error.h"
#include "limber/mesh/ten_node_tet.h"

namespace limber {
namespace {

/// An edge between two vertices, the lower first, with the direction its triangle runs through it.
struct Edge {
  Index low, high;
  bool forward;
  friend bool operator<(const Edge& a, const Edge& b) { return std::pair(a.low, a.high) < std::pair(b.low, b.high); }
  bool same_place(const Edge& o) const { return low == o.low && high == o.high; }
};

std::vector<Edge> sorted_edges(const SurfaceMesh& surface) {
  std::vector<Edge> edges;
  edges.reserve(3 * surface.triangles.size());
  for (const Triangle& t : surface.triangles)
    for (int a = 0; a < 3; ++a) {
      const Index i = t[a], j = t[(a + 1) % 3];
      edges.push_back({std::min(i, j), std::max(i, j), i < j});
    }
  std::sort(edges.begin(), edges.end());
  return edges;
}

Index count_components(const SurfaceMesh& surface) {
  DisjointSets sets(surface.vertices.size());
  for (const Triangle& t : surface.triangles) {
    sets.join(t[1], t[0]);
    sets.join(t[2], t[0]);
  }
  std::vector<char> used(surface.vertices.size(), 0);
  for (const Triangle& t : surface.triangles)
    for (const Index v : t) used[v] = 1;
  Index count = 0;
  for (std::size_t i = 0; i < used.size(); ++i)
    if (used[i] && sets.root(static_cast<Index>(i)) == static_cast<Index>(i)) ++count;
  return count;
}

}  // namespace

void validate(SurfaceMesh& surface, const std::string& name, Warnings& warnings) {
  for (std::size_t i = 0; i < surface.vertices.size(); ++i)
    if (!surface.vertices[i].allFinite())
      throw InputError(name + ": vertex " + std::to_string(i) +
                       " (counted from 0) has a coordinate that is not finite");
  for (std::size_t i = 0; i < surface.triangles.size(); ++i)
    for (const Index v : surface.triangles[i])
      if (v < 0 || static_cast<std::size_t>(v) >= surface.vertices.size())
        throw InputError(name + ": triangle " + std::to_string(i) + " (counted from 0) names vertex " +
                         std::to_string(v) + ", expected 0 to " +
                         std::to_string(static_cast<std::int64_t>(surface.vertices.size()) - 1));
  const auto dropped =
      std::erase_if(surface.triangles, [](const Triangle& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; });
  if (dropped > 0)
    warnings.push_back(name + ": " + std::to_string(dropped) + " triangles name a vertex twice and have been dropped");
  if (surface.triangles.empty()) throw InputError(name + ": holds no triangles");
}

Index weld(SurfaceMesh& surface) {
  const std::vector<Index> of = internal::representatives(surface.vertices, 0.0);
  std::vector<Index> new_index(of.size());
  std::vector<Vec3> kept;
  for (std::size_t i = 0; i < of.size(); ++i) {
    const bool stays = of[i] == static_cast<Index>(i);
    new_index[i] = stays ? static_cast<Index>(kept.size()) : new_index[of[i]];
    if (stays) kept.push_back(surface.vertices[i]);
  }
  const auto gone = static_cast<Index>(surface.vertices.size() - kept.size());
  for (Triangle& t : surface.triangles)
    for (Index& v : t) v = new_index[v];
  surface.vertices = std::move(kept);
  return gone;
}

BoundarySurface boundary_surface(const TetMesh& mesh) {
  if (mesh.has_mid_edge_nodes()) return boundary_surface(split_into_eight(mesh));
  // A face's key is its sorted nodes; a face that stands once is on the boundary.
  struct Face {
    Triangle key, outward;
  };
  std::vector<Face> faces;
  faces.reserve(4 * mesh.tets.size());
  constexpr int kOutward[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};
  for (const Tet& t : mesh.tets)
    for (const auto& f : kOutward) {
      const Triangle outward = {t[f[0]], t[f[1]], t[f[2]]};
      Triangle key = outward;
      std::sort(key.begin(), key.end());
      faces.push_back({key, outward});
    }
  std::stable_sort(faces.begin(), faces.end(), [](const Face& a, const Face& b) { return a.key < b.key; });

  BoundarySurface out;
  std::vector<Index> vertex_of(mesh.nodes.size(), -1);
  for (std::size_t i = 0; i < faces.size();) {
    std::size_t j = i + 1;
    while (j < faces.size() && faces[j].key == faces[i].key) ++j;
    if (j == i + 1) {
      out.surface.triangles.push_back(faces[i].outward);
      for (const Index n : faces[i].outward) vertex_of[n] = 0;
    }
    i = j;
  }
  for (std::size_t n = 0; n < mesh.nodes.size(); ++n) {
    if (vertex_of[n] < 0) continue;
    vertex_of[n] = static_cast<Index>(out.node_of.size());
    out.node_of.push_back(static_cast<Index>(n));
    out.surface.vertices.push_back(mesh.nodes[n]);
  }
  for (Triangle& t : out.surface.triangles)
    for (Index& v : t) v = vertex_of[v];
  return out;
}

double enclosed_volume(const SurfaceMesh& surface) {
  if (surface.vertices.empty()) return 0.0;
  const Vec3 base = surface.vertices.front();
  double six_volumes = 0.0;
  for (const Triangle& t : surface.triangles)
    six_volumes +=
        (surface.vertices[t[0]] - base).cross(surface.vertices[t[1]] - base).dot(surface.vertices[t[2]] - base);
  return six_volumes / 6.0;
}

// Tetrahedra from a point near the surface to each triangle. Over one with corners 0, a, b, c and volume V:
// ∫ x = V (a + b + c)/4,  ∫ x xᵀ = V/20 (a aᵀ + b bᵀ + c cᵀ + s sᵀ) with s = a + b + c.
SolidProperties solid_properties(const SurfaceMesh& surface) {
  SolidProperties out;
  if (surface.vertices.empty()) return out;
  const Vec3 near = surface.vertices.front();
  Vec3 first = Vec3::Zero();
  Mat3 second = Mat3::Zero();
  for (const Triangle& t : surface.triangles) {
    const Vec3 a = surface.vertices[t[0]] - near, b = surface.vertices[t[1]] - near, c = surface.vertices[t[2]] - near;
    const double volume = a.dot(b.cross(c)) / 6.0;
    const Vec3 s = a + b + c;
    out.volume += volume;
    first += 0.25 * volume * s;
    second += volume / 20.0 * (a * a.transpose() + b * b.transpose() + c * c.transpose() + s * s.transpose());
  }
  if (out.volume == 0.0) return out;
  const Vec3 offset = first / out.volume;
  out.centroid = near + offset;
  second -= out.volume * offset * offset.transpose();
  out.inertia = second.trace() * Mat3::Identity() - second;
  return out;
}

SurfaceQuality surface_quality(const SurfaceMesh& surface) {
  SurfaceQuality q;
  const auto edges = sorted_edges(surface);
  for (std::size_t i = 0; i < edges.size();) {
    std::size_t j = i + 1;
    while (j < edges.size() && edges[j].same_place(edges[i])) ++j;
    if (j - i == 1) ++q.boundary_edges;
    if (j - i > 2) ++q.non_manifold_edges;
    if (j - i == 2 && edges[i].forward == edges[i + 1].forward) ++q.misoriented_edges;
    i = j;
  }
  q.components = count_components(surface);
  return q;
}

}  // namespace limber
