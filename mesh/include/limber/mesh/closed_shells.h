/// @file limber/mesh/closed_shells.h
/// The shells of a surface, which holds which, and which way the triangles of closed ones run.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "limber/mesh/surface_mesh.h"

namespace limber {

/// A part of a surface, with vertices of its own.
struct SurfaceShell {
  SurfaceMesh surface;           ///< triangles in the whole's order, vertices in the order in which these name them
  std::vector<Index> triangles;  ///< their numbers in the whole
  Eigen::AlignedBox3d box;       ///< of the vertices, m
  double volume = 0.0;           ///< enclosed_volume(), m³; < 0 where the triangles run the wrong way round
};

/// @param label per triangle of a valid surface the number of its shell, 0 … n − 1, as DisjointSets::labels() gives
/// @return n shells @throws InvalidArgument if there are not as many labels as triangles, or one is negative
std::vector<SurfaceShell> split_into_shells(const SurfaceMesh& surface, std::span<const Index> label);

/// Whether a closed shell holds another that it does not cross, whichever way its triangles run.
/// @pre the inner one has a vertex
bool holds(const SurfaceShell& outer, const SurfaceShell& inner);

/// The surface's boundary: edges that triangles run more often one way than the other, from and to a vertex that way,
/// each as many times as more often. None: every ray that enters the surface leaves it, shells may touch along edges.
/// @pre the surface is valid (see validate())
std::vector<std::array<Index, 2>> boundary_of(const SurfaceMesh& surface);

/// Turns the closed shells whose triangles run the wrong way round. A shell is what hangs together by edges; vertices
/// at equal coordinates count as one. Shells bound solids by the even-odd rule: one that lies in no other runs
/// counter-clockwise seen from outside, one inside it is a cavity and runs the other way. Shells that are open,
/// non-manifold or of mixed orientation stay, and hold nothing. @return how many shells were turned
/// @pre the surface is valid (see validate())
Index turn_shells_outward(SurfaceMesh& surface);

}  // namespace limber
