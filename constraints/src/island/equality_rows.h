// Rows without bounds alone: (J D Jᵀ + compliance) ΔF = r, in the sense of least squares.
#pragma once

#include <span>
#include <vector>

#include "island_step.h"
#include "limber/solvers/least_squares.h"

namespace limber::internal {

class EqualityRows {
 public:
  /// @param J rows × degrees of freedom. @param metric D. @param compliance by row
  void factor(std::span<const double> J, std::span<const double> metric, std::span<const double> compliance);
  /// @param r by row; the impulses on return
  SolveStatus solve(std::span<double> r) { return least_squares_.solve(r, r); }

 private:
  std::vector<double> wide_J_, wide_metric_;  // with a degree of freedom for each compliance
  LeastSquaresSolver least_squares_;
};

}  // namespace limber::internal
