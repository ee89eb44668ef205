/// @file tet_fields.h
/// Scalar fields and gradients on linear tetrahedra: what the handles of a modal skin are found with.
#pragma once

#include <Eigen/Sparse>
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "eigen/cholesky_solver.h"
#include "limber/mesh/tet_mesh.h"

namespace limber::internal {

/// Gradients of the four shape functions of each tet (1/m) and its volume (m³).
struct TetFields {
  std::vector<std::array<Vec3, 4>> gradient;
  std::vector<double> volume;
  Eigen::VectorXd node_volume;  ///< a quarter of each tet's at its nodes

  explicit TetFields(const TetMesh& mesh);
};

/// L_ab = Σ V ∇φ_a·∇φ_b, m.
Eigen::SparseMatrix<double> laplacian(const TetMesh& mesh, const TetFields& fields);

/// A x = b with some entries of x given. @pre A is symmetric and positive definite on the other entries
class HeldSolver {
 public:
  HeldSolver(const Eigen::SparseMatrix<double>& A, std::span<const Index> held);
  /// @param B right-hand sides. @param given the values of held entries; other rows are not looked at
  Eigen::MatrixXd solve(const Eigen::MatrixXd& B, const Eigen::MatrixXd& given);

 private:
  std::vector<Index> held_, free_;
  Eigen::SparseMatrix<double> free_by_held_;
  std::optional<CholeskySolver> solver_;  // none: nothing is free
};

}  // namespace limber::internal
