/// @file smooth_surface.h
/// A component's surface as the smooth shape it stands for: normals that turn with it. Private to the articulation
/// module.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "limber/mesh/surface_mesh.h"
#include "parts/triangle_tree.h"

namespace limber::internal {

/// Per corner, the angle-weighted mean of the normals of all triangles at the vertex that bend by less than the crease
/// angle from the corner's own. Facets alone leave a rotation of a cylinder of N sides a slippage of (π/N)²/3.
class SmoothSurface {
 public:
  /// The surface must outlive this. @param caps see TriangleTree
  SmoothSurface(const SurfaceMesh& surface, double crease_angle, std::span<const Triangle> caps = {});

  const SurfaceMesh& mesh() const { return mesh_; }
  const TriangleTree& tree() const { return tree_; }
  Vec3 point(Index triangle, const Vec3& barycentric) const;
  Vec3 normal(Index triangle, const Vec3& barycentric) const;  ///< unit
  double area(Index triangle) const;
  /// How far the triangle's edges run from the arcs through their ends, at most.
  double chord_error(Index triangle) const;

 private:
  const SurfaceMesh& mesh_;
  TriangleTree tree_;
  std::vector<std::array<Vec3, 3>> corner_normals_;
};

}  // namespace limber::internal
