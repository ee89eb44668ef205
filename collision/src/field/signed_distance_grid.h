// The signed distance of a closed surface at rest on a regular grid, and which triangle is nearest to each node.
#pragma once

#include <cstdint>
#include <vector>

#include "field/field_kernels.h"
#include "limber/collision/collision_surface.h"
#include "limber/mesh/surface_locator.h"

namespace limber::internal {

/// The nodes of a grid over a box.
class RegularGrid {
 public:
  RegularGrid() = default;
  /// Cells are cubes of `longest side / cells`, but for axes along which fewer than `least_cells` of them would lie:
  /// these have as many, shorter ones.
  RegularGrid(const Aabb& box, int cells, int least_cells);

  GridView view() const;
  std::size_t nodes() const {
    return static_cast<std::size_t>(count_[0]) * static_cast<std::size_t>(count_[1]) *
           static_cast<std::size_t>(count_[2]);
  }
  const std::array<Index, 3>& count() const { return count_; }
  const Vec3& cell() const { return cell_; }  ///< sides, m
  std::size_t number(const std::array<Index, 3>& node) const {
    return static_cast<std::size_t>((node[0] * count_[1] + node[1]) * count_[2] + node[2]);
  }
  Vec3 position(const std::array<Index, 3>& node) const {
    return origin_ + cell_.cwiseProduct(Vec3(node[0], node[1], node[2]));
  }
  /// Of a point, clamped to the grid.
  std::array<Index, 3> nearest_node(const Vec3f& p) const;
  /// The lowest node of the cell that holds a point, or is nearest to it.
  std::array<Index, 3> cell_of(const Vec3f& p) const;

 private:
  Vec3 origin_ = Vec3::Zero(), cell_ = Vec3::Ones();
  std::array<Index, 3> count_{1, 1, 1};
};

/// Distances are exact at the nodes, to half a 32,767th of the largest, and trilinear between: off by up to about a
/// fifth of a cell next to edges. Inside is told by angle-weighted pseudonormals (Bærentzen and Aanæs, IEEE TVCG 11(3),
/// 2005). The grid is FieldTuning::cells long and goes two cells beyond the surface.
class SignedDistanceGrid {
 public:
  /// @pre surface.closed()
  explicit SignedDistanceGrid(const CollisionSurface& surface);

  DistanceView view() const;
  double cell() const { return grid_.cell().x(); }  ///< m
  /// Of the node nearest to a point.
  Index nearest_triangle(const Vec3f& rest) const { return nearest_[grid_.number(grid_.nearest_node(rest))]; }
  /// Of the corners of the cell that a point is in, or is nearest to.
  std::array<Index, 8> triangles_about(const Vec3f& rest) const;
  std::size_t bytes() const { return nodes_.size() * sizeof(nodes_[0]) + nearest_.size() * sizeof(nearest_[0]); }

 private:
  RegularGrid grid_;
  float unit_ = 1.0f;
  std::vector<std::int32_t> nodes_;  ///< see DistanceView
  std::vector<Index> nearest_;
};

/// The part of a closed surface's area behind which the body is at least two cells thick: from where the distance,
/// within four cells straight inwards, comes to a cell or more.
double resolved_area(const CollisionSurface& surface, double cell);

SurfaceLocator locator_of(const CollisionSurface& surface);

}  // namespace limber::internal
