#include "limber/mesh/surface_mesh.h"

#include <algorithm>
#include <utility>

#include "geometry/edge_sides.h"
#include "limber/core/disjoint_sets.h"
#include "limber/core/error.h"
#include "limber/mesh/mend_surface.h"
#include "limber/mesh/ten_node_tet.h"

namespace limber {
namespace {

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

Index weld(SurfaceMesh& surface) { return weld_within(surface, 0.0); }

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
  internal::for_each_edge(internal::edge_sides(surface), [&](std::span<const internal::EdgeSide> at) {
    if (at.size() == 1) ++q.boundary_edges;
    if (at.size() > 2) ++q.non_manifold_edges;
    if (at.size() == 2 && at[0].forward == at[1].forward) ++q.misoriented_edges;
  });
  q.components = count_components(surface);
  return q;
}

}  // namespace limber
