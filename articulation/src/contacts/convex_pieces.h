/// @file convex_pieces.h
/// A surface cut into nearly convex pieces, as [X09] 3.1 does before it intersects hulls. Private to the articulation
/// module.
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "limber/mesh/surface_mesh.h"

namespace limber::internal {

/// Cut in halves across the box of its triangles until no corner of a piece stands out from one of its triangles by
/// more than a tolerance, after the approximate convex decomposition of Lien and Amato (2006). Triangles stay whole.
class ConvexPieces {
 public:
  /// @param concavity length, > 0
  ConvexPieces(const SurfaceMesh& surface, double concavity);

  /// True if the point lies within `growth` (> 0) of some piece's convex hull.
  bool hold(const Vec3& p, double growth) const;

  std::size_t count() const { return pieces_.size(); }

 private:
  struct Piece {
    std::vector<Vec3> corners;
    Eigen::AlignedBox3d box;
  };
  std::vector<Piece> pieces_;
};

}  // namespace limber::internal
