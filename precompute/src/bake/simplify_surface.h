/// @file simplify_surface.h
/// Fewer triangles on some of the same vertices.
#pragma once

#include <vector>

#include "limber/mesh/surface_mesh.h"

namespace limber::internal {

struct SimplifiedSurface {
  SurfaceMesh surface;
  std::vector<Index> vertex_of;  ///< the vertex that each one was
  double error = 0.0;            ///< estimate of the largest distance between the two surfaces, m
};

/// Edge collapse by quadric error (meshoptimizer), which keeps the surface's topology and so may stop above the number
/// asked for.
SimplifiedSurface simplify_surface(const SurfaceMesh& surface, std::size_t triangles);

}  // namespace limber::internal
