/// @file limber/precompute/tetrahedralise.h
/// A tetrahedral mesh from a surface: a clean closed surface is meshed as it is. Another is mended where that moves no
/// vertex (see mend_surface()); what is not clean then (holes, crossing or non-manifold pieces) is wrapped.
/// docs/tetrahedralisation.md tells how and what was measured.
///
/// Clean means: closed, manifold, oriented, no flat triangles, no self-intersections; vertices at equal coordinates
/// count as one. Its shells bound bodies by the even-odd rule: a shell inside another is a cavity, a shell inside that
/// is a body again, whichever way their triangles run; disjoint shells are several bodies, and all are kept. Sharp
/// edges (normals that differ by more than 60°) become edges of the mesh. A wrap is the outside of the soup: what lies
/// inside it, cavities too, is filled, and so are holes, whatever their size.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "limber/mesh/mend_surface.h"
#include "limber/mesh/surface_mesh.h"
#include "limber/mesh/tet_mesh.h"

namespace limber {

struct TetrahedralisationOptions {
  /// Largest tet circumradius, m, which the last step (exudation of slivers) may exceed by a few per cent; 0: 1/40 of
  /// the bounding box's diagonal. A body less than eight cells across gets smaller ones, and so do parts and gaps that
  /// are thinner than a cell (see max_nodes).
  double cell_size = 0.0;
  double alpha = 0.0;  ///< narrowest gap that the wrap enters, m; 0: 1/50 of the diagonal. Clean surfaces ignore it.
  /// Nodes that may be spent on parts and gaps thinner than the cell size, whose cells are made as small as they are
  /// thin; a mesh of cells of one size is made whatever it takes. ≥ 1
  int max_nodes = 60'000;
  /// For ten-node tets, which bend where four-node ones are too stiff: cells are 1/16 of the diagonal by default, and
  /// where parts are thin 2.5 times as wide as they are thick. Smaller ones go by edge collapse, which keeps flat sides
  /// and sharp edges. max_nodes is then of the mesh before, and about as many as the ten-node tets have.
  bool quadratic = false;
  /// Closed surfaces, such as shells around another material, which faces of tets follow inside the bodies: no tet lies
  /// on both sides of one. They may cut the boundary, and parts of them may lie in it or outside. They do not cross
  /// each other. One that crosses itself or does not close is not followed. A body that they enter gets no wide cells:
  /// its `quadratic` ones are as wide as it is thin.
  std::vector<SurfaceMesh> inner_surfaces{};
  /// Told each stage as it begins, in the thread that calls.
  std::function<void(const std::string&)> progress{};
  void validate() const;  ///< @throws InvalidArgument naming the field
};

struct Tetrahedralisation {
  TetMesh mesh;                   ///< one region named "*"; every node used
  SurfaceMending mending;         ///< what was mended of a surface that was not clean
  bool wrapped = false;           ///< the surface could not be mended, so a wrap of it was meshed
  std::string why_wrapped;        ///< "12 boundary edges, 3 pairs of crossing triangles", empty if not wrapped
  double wrap_adds = 0.0;         ///< estimate of the volume that the wrap's offset adds, m³
  double volume_before = 0.0;     ///< enclosed by the surface as meshed, m³ (if wrapped: by the wrap)
  double volume_after = 0.0;      ///< of the tets, m³
  double smallest_cell = 0.0;     ///< bound on cells where parts are thin or close, m; may exceed the cell size
  bool sharp_edges_kept = false;  ///< edges sharper than 60° are edges of the mesh
  std::vector<bool> followed;     ///< which of inner_surfaces faces of tets follow
  int tries = 0;                  ///< meshes made, of all bodies
  double seconds_wrap = 0.0, seconds_thickness = 0.0, seconds_mesh = 0.0;
};

/// Deterministic: fixed seeds, one thread, no time limits.
/// @throws InvalidArgument for wrong options, InputError if the surface is not valid (see validate()) or lies in one
/// plane, ComputationError if no mesh comes out (too thin for the budget of nodes, say) or one of more than 20 million
/// tets would, with what to try
Tetrahedralisation tetrahedralise(const SurfaceMesh& surface, const TetrahedralisationOptions& options,
                                  Warnings& warnings);

/// Pairs of triangles, one of each of two closed surfaces, that cross or touch (CGAL's exact test).
/// @pre both are closed and manifold, and neither crosses itself
Index crossing_triangles(const SurfaceMesh& a, const SurfaceMesh& b);

}  // namespace limber
