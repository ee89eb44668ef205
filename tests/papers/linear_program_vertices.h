/// @file linear_program_vertices.h
/// Small linear programs by all their vertices: a second route to what the simplex finds.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <bit>
#include <limits>

namespace limber::testing {

/// The least Σf over A f + b ≥ 0, f ≥ 0: among all places where n of the 2n inequalities are met with equality. n ≤ 6
inline double least_sum_of_all_vertices(const Eigen::MatrixXd& A, const Eigen::VectorXd& b) {
  constexpr double kFeasible = 1e-9;
  const int n = static_cast<int>(b.size());
  double least = std::numeric_limits<double>::infinity();
  for (unsigned chosen = 0; chosen < 1u << (2 * n); ++chosen) {
    if (std::popcount(chosen) != n) continue;
    Eigen::MatrixXd tight = Eigen::MatrixXd::Zero(n, n);
    Eigen::VectorXd at = Eigen::VectorXd::Zero(n);
    for (int i = 0, row = 0; i < 2 * n; ++i) {
      if ((chosen >> i & 1u) == 0) continue;
      if (i < n) {
        tight.row(row) = A.row(i);
        at[row] = -b[i];
      } else {
        tight(row, i - n) = 1.0;
      }
      ++row;
    }
    const Eigen::FullPivLU<Eigen::MatrixXd> lu(tight);
    if (lu.rank() < n) continue;
    const Eigen::VectorXd f = lu.solve(at);
    if (f.minCoeff() > -kFeasible && (A * f + b).minCoeff() > -kFeasible) least = std::min(least, f.sum());
  }
  return least;
}

}  // namespace limber::testing
