// How a body's modes displace the space about its surface: U at the nodes of a coarse grid, trilinear between them.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "field/signed_distance_grid.h"

namespace limber::internal {

/// The displacements of the nodes that least squares fit to those of the vertices:
///
///   min_X ‖A X − U‖² + 1e-3 ‖D₂ X‖² + 1e-6 ‖D₁ X‖²
///
/// A the trilinear weights of the vertices, D₁ and D₂ first and second differences along the axes. Nodes next to the
/// surface have values of their own; the others have that of the nearest such node.
class DisplacementLattice {
 public:
  /// @pre surface.modes() > 0
  explicit DisplacementLattice(const CollisionSurface& surface);

  GridView grid() const { return grid_.view(); }
  Index nodes() const { return nodes_; }  ///< that have values of their own
  /// Per node of the grid the one that it has its value of.
  const std::vector<std::int32_t>& place() const { return place_; }
  /// 3 · nodes() × modes, in kg^−½: rows are x, y, z of node 0, 1, …
  const Eigen::MatrixXf& rows() const { return rows_; }
  /// The largest |A X − U| of any vertex and mode, in parts of the mode's largest |u|.
  double largest_error() const { return largest_error_; }

 private:
  void choose_nodes(const CollisionSurface& surface);
  void fit(const CollisionSurface& surface);

  RegularGrid grid_;
  Index nodes_ = 0;
  std::vector<std::int32_t> place_;
  std::vector<bool> own_;  ///< of nodes of the grid
  Eigen::MatrixXf rows_;
  double largest_error_ = 0.0;
};

}  // namespace limber::internal
