// The energies of [X09 4]: cells as affine maps x ↦ A (x − c) + p of 12 unknowns each; rigidity, joints and limits as
// squares with weights.
//
// Where the printed forms do not do what their text says, these do: a cylindrical joint measures distances from the
// axis, not from a point of it, which would forbid its sliding; distances are not squared, as a square has no slope at
// 0; axes are made unit, as A is not exactly a rotation. Reflections cost no rigidity energy, as in the paper.
#pragma once

#include <Eigen/SparseCore>
#include <vector>

#include "limber/posing_penalty/penalty_poses.h"
#include "pose_problem.h"

namespace limber::internal {

/// c_i·c_i − 1 and c_i·c_j of the columns: zero for rotations (and reflections). Scaled by s, their squares add up to
/// 3 (s² − 1)²; sheared by γ, to γ² + γ⁴.
Eigen::Matrix<double, 6, 1> rigidity_residuals(const Mat3& A);

/// A value and its derivative in the 24 unknowns of two bodies: columns of A, then p, of a and of b.
struct PairResidual {
  double value = 0.0;
  Eigen::Matrix<double, 1, 24> derivative = Eigen::Matrix<double, 1, 24>::Zero();
};

/// What a joint's energy is the squares of. @param corners of a cell of b, at rest. Limits come last: 0 within.
std::vector<PairResidual> joint_residuals(const PoseStructure& structure, const BodyJoint& joint, const BodyMap& a,
                                          const BodyMap& b, const std::array<Vec3, 8>& corners, double turn);

/// E = Σ r², over bodies that are not pinned.
class PenaltyEnergy {
 public:
  PenaltyEnergy(const PoseStructure& structure, const PenaltyWeights& weights, std::vector<HandleTerm> handles);

  using Jacobian = Eigen::SparseMatrix<double>;

  /// Where a body's twelve unknowns begin; −1: pinned.
  Index dof(Index body) const { return dof_[static_cast<std::size_t>(body)]; }
  Index dofs() const { return dofs_; }
  void set_targets(const std::vector<Vec3>& targets);

  /// @param J null: values only. Its pattern is the same at every pose.
  Eigen::VectorXd residuals(const std::vector<BodyMap>& maps, const std::vector<double>& turns, Jacobian* J) const;

 private:
  class Writer;
  std::array<Vec3, 8> corners_at(const BodyJoint& joint) const;

  const PoseStructure* structure_;
  PenaltyWeights weights_;
  std::vector<HandleTerm> handles_;
  std::vector<Index> dof_;
  std::vector<std::array<Vec3, 8>> corners_;  // per joint
  Index dofs_ = 0;
};

/// Gauss–Newton with Levenberg's damping; the matrix is analysed once. @param maps in: where to begin; out: no worse
PoseResult solve_penalty(PenaltyEnergy& energy, const PoseStructure& structure, const PosingOptions& options,
                         std::vector<BodyMap>& maps, std::vector<double>& turns);

}  // namespace limber::internal
