// The steps that need CGAL, one source file each, so that they compile side by side and no CGAL header spreads.
#pragma once

#include <functional>
#include <span>
#include <string>

#include "limber/mesh/surface_mesh.h"
#include "limber/mesh/tet_mesh.h"

namespace limber::internal {

/// Pairs of triangles that cross or touch other than at the vertices and edges they share, and vertices at which the
/// surface is not one fan. @pre every edge has two triangles that run through it in opposite directions
struct Crossings {
  Index triangle_pairs = 0;
  Index pinched_vertices = 0;
};
Crossings find_crossings(const SurfaceMesh& surface);

/// Leaves of a surface what lies strictly inside a body, cut where it crosses the boundary. The cuts become edges of
/// both.
/// @param surface closed, manifold, without self-intersections; either orientation
/// @param boundary of the body: clean, outward
/// @return whether both are manifold after that; if not, they are as they were
bool clip_to_body(SurfaceMesh& surface, SurfaceMesh& boundary);

/// A closed, oriented, manifold surface around any triangles, `offset` away from them; enters no gap narrower than
/// `alpha`.
SurfaceMesh wrap(const SurfaceMesh& soup, double alpha, double offset);

struct BodyMeshing {
  std::function<double(const Vec3&)> cell_size;  ///< bound on the circumradius of tets and of boundary triangles'
                                                 ///< surface balls there, m; Lipschitz
  double facet_distance = 0.0;    ///< bound on the distance between a boundary triangle and the surface, in cells
  bool keep_sharp_edges = false;  ///< sharp edges of the surface become edges of the mesh
  std::size_t max_nodes = 0;      ///< more are not made
};

struct MeshedBody {
  TetMesh mesh;         ///< nodes and tets only
  std::string failure;  ///< what went wrong, empty if nothing did; the mesh is then worth nothing
};

/// Tets inside one body. @param boundary clean; its shells bound the body by the even-odd rule
/// @param inner surfaces inside, which faces of tets follow; their open edges are edges of the boundary
/// @param seeds points on all of these, a few of each shell, where the refinement starts
MeshedBody mesh_body(const SurfaceMesh& boundary, std::span<const SurfaceMesh> inner, std::span<const Vec3> seeds,
                     const BodyMeshing& options);

}  // namespace limber::internal
