// Decomposition of a square matrix that need not be symmetric: elimination with row pivoting. What is zero left and
// right of a row's numbers is skipped, so that bodies along a chain cost as many times as much as there are.
#pragma once

#include <span>
#include <vector>

#include "limber/solvers/aligned_buffer.h"

namespace limber::internal {

/// Memory grows to the largest matrix seen; after that nothing is allocated.
class UnsymmetricFactor {
 public:
  /// @param A n × n, row-major. @return whether it has an inverse
  bool factor(std::span<const double> A, std::size_t n);
  /// X ← A⁻¹ X. @param X n × columns, row-major
  void solve(std::span<double> X, std::size_t columns);

 private:
  std::vector<double> lu_, inverse_pivot_;
  std::vector<std::size_t> swapped_with_, end_;  // by row: past its last number
  std::size_t n_ = 0;
  MatrixBuffer right_;
  std::vector<int> which_;  // numbers of a row that are not zero, and these
  std::vector<double> factors_;
};

}  // namespace limber::internal
