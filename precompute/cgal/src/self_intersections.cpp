#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/self_intersections.h>
#include <CGAL/Surface_mesh.h>

#include "cgal_steps.h"

namespace limber::internal {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Surface = CGAL::Surface_mesh<Kernel::Point_3>;

/// Vertices whose triangles form more than one fan: the corners around them are not all reached across shared edges.
Index count_pinched_vertices(const SurfaceMesh& surface) {
  const std::size_t n = surface.vertices.size();
  std::vector<std::vector<std::pair<Index, Index>>> fan(n);  // per vertex, its triangles' other two vertices in order
  for (const Triangle& t : surface.triangles)
    for (int a = 0; a < 3; ++a) fan[t[a]].emplace_back(t[(a + 1) % 3], t[(a + 2) % 3]);
  Index pinched = 0;
  for (const auto& corner : fan) {
    if (corner.empty()) continue;
    std::size_t walked = 0;
    Index at = corner.front().first;
    do {
      const Index here = at;
      for (const auto& [from, to] : corner)
        if (from == here) at = to;
      ++walked;
    } while (at != corner.front().first && walked <= corner.size());
    if (walked != corner.size()) ++pinched;
  }
  return pinched;
}

}  // namespace

Crossings find_crossings(const SurfaceMesh& surface) {
  Crossings crossings;
  crossings.pinched_vertices = count_pinched_vertices(surface);
  if (crossings.pinched_vertices > 0) return crossings;  // not a mesh in CGAL's sense, and not clean either way

  Surface mesh;
  mesh.reserve(static_cast<Surface::size_type>(surface.vertices.size()),
               static_cast<Surface::size_type>(3 * surface.triangles.size() / 2),
               static_cast<Surface::size_type>(surface.triangles.size()));
  for (const Vec3& v : surface.vertices) mesh.add_vertex({v.x(), v.y(), v.z()});
  using Vertex = Surface::Vertex_index;
  for (const Triangle& t : surface.triangles) mesh.add_face(Vertex(t[0]), Vertex(t[1]), Vertex(t[2]));
  std::vector<std::pair<Surface::Face_index, Surface::Face_index>> pairs;
  CGAL::Polygon_mesh_processing::self_intersections(mesh, std::back_inserter(pairs));
  crossings.triangle_pairs = static_cast<Index>(pairs.size());
  return crossings;
}

}  // namespace limber::internal
