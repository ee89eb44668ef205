// Cholesky factor of a symmetric positive semidefinite matrix with diagonal pivoting and a rank cut, and the
// pseudoinverse that follows from it.
#pragma once

#include <memory>
#include <vector>

#include "limber/solvers/aligned_buffer.h"

namespace limber::internal {

/// S ≈ L Lᵀ with L of rank() columns. The columns are kept as rows, in the order of the pivots; their entries are in
/// S's order.
class PivotedCholesky {
 public:
  /// Pivots of `tolerance` times the largest and less are taken as zero.
  void factor(MatrixView S, std::size_t n, double tolerance);

  std::size_t rank() const { return pivots_.size(); }
  /// Row j: column j of L. Its first j pivots' entries are zero.
  MatrixView columns() const { return Lt_; }
  std::size_t pivot(std::size_t j) const { return pivots_[j]; }

  /// x ← S⁺x, n numbers with finite padding. With all of the rank that is S⁻¹x, else L (LᵀL)⁻² Lᵀx.
  void apply_pseudoinverse(double* x) const;

 private:
  void solve_full(double* x) const;

  std::size_t n_ = 0;
  MatrixBuffer columns_memory_, rows_memory_, gram_memory_;
  AlignedBuffer diagonal_memory_, coefficient_memory_;
  MatrixView Lt_{};
  std::vector<std::size_t> pivots_;
  mutable AlignedBuffer scratch_memory_;
  std::unique_ptr<PivotedCholesky> gram_factor_;  // of LᵀL, where the rank is not full
};

}  // namespace limber::internal
