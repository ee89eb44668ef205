// Delaunay refinement of a body bounded by triangles: CGAL Mesh_3 (Rineau and Yvinec; slivers exuded after
// Cheng, Dey, Edelsbrunner, Facello and Teng).
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Mesh_complex_3_in_triangulation_3.h>
#include <CGAL/Mesh_criteria_3.h>
#include <CGAL/Mesh_triangulation_3.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Polyhedral_mesh_domain_with_features_3.h>
#include <CGAL/make_mesh_3.h>
#include <CGAL/refine_mesh_3.h>

#include <string>
#include <unordered_map>
#include <vector>

#include "cgal_steps.h"
#include "limber/core/error.h"

namespace limber::internal {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Polyhedron = CGAL::Mesh_polyhedron_3<Kernel>::type;
using Domain = CGAL::Polyhedral_mesh_domain_with_features_3<Kernel>;
using Triangulation = CGAL::Mesh_triangulation_3<Domain, CGAL::Default, CGAL::Sequential_tag>::type;
using Complex = CGAL::Mesh_complex_3_in_triangulation_3<Triangulation, Domain::Corner_index, Domain::Curve_index>;
using Criteria = CGAL::Mesh_criteria_3<Triangulation>;

}  // namespace
}  // namespace limber::internal

/// CGAL saves a mesh on which an invariant breaks, in the user's folder; the exception that follows says enough.
template <>
struct CGAL::Dump_c3t3<limber::internal::Complex, true> {
  void dump_c3t3(const limber::internal::Complex&, const std::string&) const {}
};

namespace limber::internal {
namespace {

namespace parameters = CGAL::parameters;

// An edge is sharp where the normals of its two triangles differ by more than this.
constexpr double kSharpDegrees = 60.0;
// Boundary triangles with a smaller angle are refined; refinement provably ends below 30°.
constexpr double kFacetDegrees = 25.0;
constexpr double kRadiusEdgeRatio = 2.0;
// Exudation tries to lift dihedral angles to here. No time limit: the mesh may not depend on the machine.
constexpr double kSliverDegrees = 20.0;
constexpr double kFarInDiagonals = 10.0;

Polyhedron to_polyhedron(const SurfaceMesh& surface) {
  std::vector<Kernel::Point_3> points;
  points.reserve(surface.vertices.size());
  for (const Vec3& v : surface.vertices) points.emplace_back(v.x(), v.y(), v.z());
  std::vector<std::array<std::size_t, 3>> triangles;
  triangles.reserve(surface.triangles.size());
  for (const Triangle& t : surface.triangles)
    triangles.push_back(
        {static_cast<std::size_t>(t[0]), static_cast<std::size_t>(t[1]), static_cast<std::size_t>(t[2])});
  Polyhedron polyhedron;
  CGAL::Polygon_mesh_processing::polygon_soup_to_polygon_mesh(points, triangles, polyhedron);
  return polyhedron;
}

/// The cell size as CGAL's criteria ask for it.
struct SizingField {
  using FT = Kernel::FT;
  using Point_3 = Kernel::Point_3;
  using Index = Domain::Index;
  FT operator()(const Point_3& p, int, const Index&) const { return factor * size({p.x(), p.y(), p.z()}); }

  const std::function<double(const Vec3&)>& size;
  double factor;
};

/// Corners of a box far around the surface. The exuder counts on every vertex having finite cells all around; without
/// them it reads past the end of a list where a small mesh has none.
void insert_far_corners(const SurfaceMesh& boundary, Complex& complex) {
  Eigen::AlignedBox3d box;
  for (const Vec3& v : boundary.vertices) box.extend(v);
  const double reach = kFarInDiagonals * box.diagonal().norm();
  for (int corner = 0; corner < 8; ++corner) {
    Vec3 p = box.center();
    for (int axis = 0; axis < 3; ++axis) p[axis] += (corner >> axis) % 2 == 0 ? -reach : reach;
    const auto vertex =
        complex.triangulation().insert(Triangulation::Weighted_point(Kernel::Point_3(p.x(), p.y(), p.z())));
    complex.set_dimension(vertex, 3);
    complex.set_index(vertex, Domain::Index(Domain::Subdomain_index(0)));
  }
}

/// Points on every shell to start from. CGAL's own, rays from the middle of the box, can miss a small shell altogether.
void insert_seeds(std::span<const Vec3> seeds, Complex& complex) {
  const Domain::Index on_surface(Domain::Surface_patch_index(1));  // Mesh_polyhedron_3's number where none is set
  for (const Vec3& p : seeds) {
    const auto vertex =
        complex.triangulation().insert(Triangulation::Weighted_point(Kernel::Point_3(p.x(), p.y(), p.z())));
    if (vertex == Triangulation::Vertex_handle()) continue;  // hidden by a protecting ball
    complex.set_dimension(vertex, 2);
    complex.set_index(vertex, on_surface);
  }
}

/// Refines until all criteria hold. @return why that came to nothing, or an empty text
std::string refine(const Domain& domain, bool has_curves, const SurfaceMesh& boundary, std::span<const Vec3> seeds,
                   const BodyMeshing& options, Complex& complex) {
  const SizingField cell_size{options.cell_size, 1.0}, facet_distance{options.cell_size, options.facet_distance};
  const Criteria criteria(parameters::edge_size = cell_size, parameters::facet_angle = kFacetDegrees,
                          parameters::facet_size = cell_size, parameters::facet_distance = facet_distance,
                          parameters::cell_radius_edge_ratio = kRadiusEdgeRatio, parameters::cell_size = cell_size);
  CGAL::Mesh_error_code error = CGAL::CGAL_MESH_3_NO_ERROR;
  if (has_curves)
    CGAL::Mesh_3::internal::init_c3t3_with_features(complex, domain, criteria, false, options.max_nodes, &error);
  insert_far_corners(boundary, complex);
  insert_seeds(seeds, complex);
  parameters::internal::Mesh_3_options limits;
  limits.maximal_number_of_vertices = options.max_nodes;
  limits.pointer_to_error_code = &error;
  // Not CGAL's manifold criterion: at a knife edge it need not end, with or without new nodes.
  // Exudation alone: CGAL's perturbation gives other meshes in other runs.
  if (error == CGAL::CGAL_MESH_3_NO_ERROR)
    CGAL::refine_mesh_3(complex, domain, criteria, parameters::no_perturb(),
                        parameters::exude(parameters::sliver_bound = kSliverDegrees), parameters::no_reset_c3t3(),
                        limits, parameters::non_manifold());
  return error == CGAL::CGAL_MESH_3_NO_ERROR ? "" : "more than " + std::to_string(options.max_nodes) + " nodes";
}

TetMesh to_tet_mesh(const Complex& complex) {
  TetMesh mesh;
  std::unordered_map<Complex::Vertex_handle, Index> index_of;
  for (auto cell = complex.cells_in_complex_begin(); cell != complex.cells_in_complex_end(); ++cell) {
    Tet tet;
    for (int a = 0; a < 4; ++a) {
      const auto vertex = cell->vertex(a);
      const auto [entry, fresh] = index_of.try_emplace(vertex, static_cast<Index>(mesh.nodes.size()));
      if (fresh) mesh.nodes.emplace_back(vertex->point().x(), vertex->point().y(), vertex->point().z());
      tet[a] = entry->second;
    }
    mesh.tets.push_back(tet);
  }
  return mesh;
}

}  // namespace

MeshedBody mesh_body(const SurfaceMesh& boundary, std::span<const SurfaceMesh> inner, std::span<const Vec3> seeds,
                     const BodyMeshing& options) {
  try {
    CGAL::get_default_random() = CGAL::Random(0);
    std::vector<Polyhedron> followed;
    for (const SurfaceMesh& surface : inner) followed.push_back(to_polyhedron(surface));
    std::vector<const Polyhedron*> pointers;
    for (const Polyhedron& p : followed) pointers.push_back(&p);
    Domain domain(pointers.begin(), pointers.end(), to_polyhedron(boundary));
    const bool has_curves = options.keep_sharp_edges || !inner.empty();
    if (options.keep_sharp_edges)
      domain.detect_features(kSharpDegrees);
    else if (!inner.empty())
      domain.detect_borders();
    Complex complex;
    const std::string failure = refine(domain, has_curves, boundary, seeds, options, complex);
    return {failure.empty() ? to_tet_mesh(complex) : TetMesh(), failure};
  } catch (const CGAL::Failure_exception& e) {
    return {{}, "CGAL: " + (e.message().empty() ? e.expression() : e.message())};
  }
}

}  // namespace limber::internal
