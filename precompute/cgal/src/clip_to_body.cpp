#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/clip.h>
#include <CGAL/Surface_mesh.h>

#include <vector>

#include "cgal_steps.h"

namespace limber::internal {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Surface = CGAL::Surface_mesh<Kernel::Point_3>;

Surface to_surface(const SurfaceMesh& mesh) {
  using Vertex = Surface::Vertex_index;
  Surface surface;
  for (const Vec3& v : mesh.vertices) surface.add_vertex({v.x(), v.y(), v.z()});
  for (const Triangle& t : mesh.triangles) surface.add_face(Vertex(t[0]), Vertex(t[1]), Vertex(t[2]));
  return surface;
}

SurfaceMesh to_mesh(const Surface& surface) {
  SurfaceMesh mesh;
  std::vector<Index> index_of(surface.number_of_vertices() + surface.number_of_removed_vertices(), -1);
  for (const auto v : surface.vertices()) {
    index_of[v] = static_cast<Index>(mesh.vertices.size());
    const auto& p = surface.point(v);
    mesh.vertices.emplace_back(p.x(), p.y(), p.z());
  }
  for (const auto f : surface.faces()) {
    Triangle t;
    int a = 0;
    for (const auto v : surface.vertices_around_face(surface.halfedge(f))) t[a++] = index_of[v];
    mesh.triangles.push_back(t);
  }
  return mesh;
}

}  // namespace

bool clip_to_body(SurfaceMesh& surface, SurfaceMesh& boundary) {
  namespace parameters = CGAL::parameters;
  Surface clipped = to_surface(surface), body = to_surface(boundary);
  // Parts in the boundary are left out: its own faces follow them.
  if (!CGAL::Polygon_mesh_processing::clip(clipped, body, parameters::use_compact_clipper(false))) return false;
  surface = to_mesh(clipped);
  boundary = to_mesh(body);
  return true;
}

}  // namespace limber::internal
