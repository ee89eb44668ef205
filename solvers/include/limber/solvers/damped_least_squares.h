// The x that makes |A x − b|² + damping² |x|² least (Levenberg 1944; Marquardt 1963), A square and of any rank: by
// reflections (Householder), which do not square the condition of A.
#pragma once

#include <span>

#include "limber/solvers/aligned_buffer.h"

namespace limber::internal {

/// Memory grows to the largest problem seen; after that nothing is allocated.
class DampedLeastSquares {
 public:
  /// @param A n × n, row-major. @param damping > 0
  void factor(std::span<const double> A, std::size_t n, double damping);
  /// @param x b, n numbers; the answer on return
  void solve(std::span<double> x);

 private:
  std::size_t n_ = 0;
  MatrixBuffer columns_memory_, normals_memory_;
  MatrixView columns_{}, normals_{};  // of (A; damping 1), 2 n numbers each; and of the reflections, of length √2
  AlignedBuffer right_;
};

}  // namespace limber::internal
