/// @file limber/precompute/tetrahedralise.h
/// A tetrahedral mesh from a surface: a clean closed surface is meshed as it is, anything else (holes, crossing or
/// non-manifold pieces, several shells, flipped faces) is wrapped first.
#pragma once

#include "limber/mesh/surface_mesh.h"
#include "limber/mesh/tet_mesh.h"

namespace limber {

struct TetrahedralisationOptions {
  double cell_size = 0.0;  ///< largest tet circumradius, m; 0: 1/40 of the bounding box's diagonal
  double alpha = 0.0;      ///< smallest hole or gap that the wrap enters, m; 0: 1/50 of the diagonal
  void validate() const;   ///< @throws InvalidArgument naming the field
};

struct Tetrahedralisation {
  TetMesh mesh;                ///< one region named "*"
  bool wrapped = false;        ///< the surface was not clean, so a wrap of it was meshed
  std::string why_wrapped;     ///< "12 boundary edges, 3 self-intersections", empty if not wrapped
  double volume_before = 0.0;  ///< enclosed by the surface as given, m³ (for a soup: of its wrap)
  double volume_after = 0.0;   ///< of the tets, m³
  double seconds_wrap = 0.0, seconds_mesh = 0.0;
};

/// Deterministic. @throws ComputationError if no tet comes out (surface too thin for the cell size, say), with what to try
Tetrahedralisation tetrahedralise(const SurfaceMesh& surface, const TetrahedralisationOptions& options, Warnings& warnings);

}  // namespace limber
