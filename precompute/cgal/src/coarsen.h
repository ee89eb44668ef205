// Longer cells than the body is thick: Delaunay refinement makes none, as a ball around a point on one side of a plate
// that holds no node of that side would hold nodes of the other.
#pragma once

#include <functional>

#include "limber/mesh/tet_mesh.h"

namespace limber::internal {

struct Coarsening {
  std::function<double(const Vec3&)> shortest;   ///< shorter edges go, m
  std::function<double(const Vec3&)> longest;    ///< no edge becomes longer, m
  std::function<double(const Vec3&)> deviation;  ///< bound on how far the boundary moves there, m
  double least_shape = 0.0;  ///< no tet becomes flatter than this (see shape()) unless it was already
};

/// Collapses edges that are too short, shortest first, until none can go: a node moves onto a neighbour and the tets
/// between them vanish. The link condition keeps the mesh a manifold as it was (Dey, Edelsbrunner, Guha, Nekhayev
/// 1999); a node of the boundary goes only where the root mean square of the distances from its new place to the planes
/// of all triangles that it stands for stays within the bound (Garland and Heckbert's quadrics, 1997): flat sides,
/// sharp edges and corners stay as they are. Nodes that are left over go.
void coarsen(TetMesh& mesh, const Coarsening& options);

}  // namespace limber::internal
