// Which shells of a clean surface bound which body.
#pragma once

#include <vector>

#include "limber/mesh/surface_mesh.h"

namespace limber::internal {

/// One body: an outer shell and the cavities directly inside it.
struct Body {
  SurfaceMesh boundary;  ///< outer shell outward, cavities inward
  std::vector<SurfaceMesh>
      inner;                ///< surfaces inside that faces of tets follow, seen from inside; open at the boundary
  std::vector<Vec3> seeds;  ///< a few well-spread vertices of each shell and inner surface
  double volume = 0.0;      ///< m³; > 0
  double diagonal = 0.0;    ///< of its bounding box, m
};

struct Bodies {
  std::vector<Body> bodies;  ///< in the order of their outer shells in the input
  Index cavities = 0;
  Index turned = 0;  ///< shells whose triangles ran the wrong way round
};

/// Splits a closed, oriented, manifold surface without self-intersections by the even-odd rule: a shell inside a shell
/// is a cavity, a shell inside a cavity is a body again, whichever way their triangles run.
Bodies split_into_bodies(const SurfaceMesh& surface);

/// Adds the triangles of one surface to another.
void append(const SurfaceMesh& part, SurfaceMesh& whole);

/// Gives to each body the parts of a clean closed surface that lie in it. @return whether all bodies could be cut by
/// it; if not, none has it
bool add_inner_surface(const SurfaceMesh& surface, Bodies& bodies);

}  // namespace limber::internal
