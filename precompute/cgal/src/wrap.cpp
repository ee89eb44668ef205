// Alpha wrapping (Portaneri, Rouxel-Labbé, Hemmer, Cohen-Steiner, Alliez, 2022) of a triangle soup.
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/alpha_wrap_3.h>

#include "cgal_steps.h"
#include "limber/core/error.h"

namespace limber::internal {

SurfaceMesh wrap(const SurfaceMesh& soup, double alpha, double offset) {
  using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
  using Surface = CGAL::Surface_mesh<Kernel::Point_3>;
  std::vector<Kernel::Point_3> points;
  points.reserve(soup.vertices.size());
  for (const Vec3& v : soup.vertices) points.emplace_back(v.x(), v.y(), v.z());
  std::vector<std::array<std::size_t, 3>> triangles;
  triangles.reserve(soup.triangles.size());
  for (const Triangle& t : soup.triangles)
    triangles.push_back(
        {static_cast<std::size_t>(t[0]), static_cast<std::size_t>(t[1]), static_cast<std::size_t>(t[2])});

  Surface wrapped;
  try {
    CGAL::alpha_wrap_3(points, triangles, alpha, offset, wrapped);
  } catch (const CGAL::Failure_exception& e) {
    throw ComputationError("tetrahedralise: CGAL's alpha wrap failed (" + e.expression() + "); try another alpha");
  }
  if (wrapped.has_garbage()) wrapped.collect_garbage();

  SurfaceMesh out;
  for (const auto v : wrapped.vertices())
    out.vertices.emplace_back(wrapped.point(v).x(), wrapped.point(v).y(), wrapped.point(v).z());
  for (const auto f : wrapped.faces()) {
    const auto h = wrapped.halfedge(f);
    out.triangles.push_back({static_cast<Index>(wrapped.source(h).idx()), static_cast<Index>(wrapped.target(h).idx()),
                             static_cast<Index>(wrapped.target(wrapped.next(h)).idx())});
  }
  return out;
}

}  // namespace limber::internal
