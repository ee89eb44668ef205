// The x that makes |A x − b|² + damping² |x|² least (Levenberg 1944; Marquardt 1963), A square and of any rank: by
// reflections (Householder), which do not square the condition of A.
#pragma once

#include <span>
#include <vector>

namespace limber::internal {

/// Memory grows to the largest problem seen; after that nothing is allocated.
class DampedLeastSquares {
 public:
  /// @param A n × n, row-major. @param damping > 0. @param x b, n numbers; the answer on return
  void solve(std::span<const double> A, double damping, std::span<double> x);

 private:
  std::vector<double> columns_, right_;  // of (A; damping 1), 2 n numbers each, and of (b; 0)
};

}  // namespace limber::internal
