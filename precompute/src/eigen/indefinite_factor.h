/// @file indefinite_factor.h
/// L D Lᵀ of symmetric indefinite matrices of one pattern, with pivoting (MUMPS).
#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>

#include "limber/precompute/sparse_matrix.h"

namespace limber::internal {

/// One symbolic factorisation serves all matrices of the pattern.
class IndefiniteFactor {
 public:
  enum class Keeps { kPivotSigns, kFactor };  ///< solve() needs the factor; counting needs signs alone, at less memory

  /// @param A 3n × 3n, symmetric: its pattern. @param node_order order of elimination of the n nodes
  /// @throws ComputationError if MUMPS cannot analyse the matrix
  IndefiniteFactor(const SparseMatrix& A, std::span<const Index> node_order, Keeps keeps);
  ~IndefiniteFactor();
  IndefiniteFactor(const IndefiniteFactor&) = delete;
  IndefiniteFactor& operator=(const IndefiniteFactor&) = delete;

  /// @param A of the pattern. @return negative pivots: how many eigenvalues are negative
  /// @throws ComputationError if memory does not suffice or A is singular
  int factor(const SparseMatrix& A);
  /// A⁻¹ B. @pre factor(), Keeps::kFactor
  Eigen::MatrixXd solve(const Eigen::Ref<const Eigen::MatrixXd>& B);

 private:
  struct Mumps;
  std::unique_ptr<Mumps> mumps_;
};

}  // namespace limber::internal
