/// @file stress_recovery.h
/// Smoother stresses than those of the elements: Zienkiewicz and Zhu's superconvergent patch recovery, with the
/// traction that is known on free faces.
///
/// Around every corner a polynomial of the elements' degree is fitted, in the sense of least squares, to the stresses
/// at the points of the adjacent tets where they are most accurate, and to σ n = 0 on free faces at the corner. The
/// values of these polynomials at the nodes (in the middle of an edge the mean of those of its ends) are the recovered
/// stress, interpolated by the shape functions of the displacements. Stresses jump where materials change, so each
/// region has fits of its own; regions of one name are one, whose material varies.
///
/// Zienkiewicz, Zhu: The superconvergent patch recovery and a posteriori error estimates, International Journal for
/// Numerical Methods in Engineering 33, 1992. Equations of the boundary: Wiberg, Abdulwahab, Ziukas, ibid. 37, 1994.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

#include "limber/mesh/ten_node_tet.h"

namespace limber::internal {

/// Stresses of several modes: a row per point, in it xx of all modes, then yy, zz, yz, zx and xy.
using StressRows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

class StressRecovery {
 public:
  /// Keeps a reference to the mesh. @param fixed_nodes faces whose nodes are all among these are not free
  StressRecovery(const TetMesh& mesh, std::span<const Index> fixed_nodes);

  /// Points per tet where stresses are sampled: the centroid of four-node tets, four points of ten-node ones. The
  /// samples of tet t are the rows samples·t, … of what recover() takes.
  std::size_t samples() const { return points_.size(); }
  const std::vector<Barycentric>& points() const { return points_; }

  /// Rows for value_of().
  StressRows recover(const StressRows& at_samples) const;
  Index value_of(std::size_t tet, std::size_t node) const { return values_[tet][node]; }

 private:
  struct FreeFace {
    std::array<Vec3, 3> corners;
    Vec3 normal;
  };
  struct Fit;

  void number_values();
  void find_free_faces(std::span<const Index> fixed_nodes);
  Index terms() const { return points_.size() == 1 ? 4 : 10; }
  Eigen::RowVectorXd monomials(const Vec3& x) const;
  std::vector<Index> patch_around(Index corner) const;
  std::vector<Index> middles_around(Index corner) const;
  Eigen::MatrixXd coefficients(const Fit& fit, const StressRows& at_samples) const;
  Fit fit_around(Index corner) const;

  const TetMesh& mesh_;
  const std::vector<Barycentric>& points_;
  std::vector<std::array<Index, 10>> values_;  // per tet and node: one value for each node and name of a region
  std::vector<Vec3> places_;                   // of values
  std::vector<std::vector<Index>> tets_of_;    // of corners' values
  std::vector<std::vector<FreeFace>> faces_of_;
};

}  // namespace limber::internal
