// Decomposition of a square matrix that need not be symmetric: elimination with row pivoting.
#pragma once

#include <span>
#include <vector>

namespace limber::internal {

/// Memory grows to the largest matrix seen; after that nothing is allocated.
class UnsymmetricFactor {
 public:
  /// @param A n × n, row-major. @return whether it has an inverse
  bool factor(std::span<const double> A, std::size_t n);
  /// X ← A⁻¹ X. @param X n × columns, row-major
  void solve(std::span<double> X, std::size_t columns) const;

 private:
  std::vector<double> lu_, inverse_pivot_;
  std::vector<std::size_t> swapped_with_;
  std::size_t n_ = 0;
};

}  // namespace limber::internal
