// Newton's method with a Jacobian by differences, for rows with an interval each: where bodies turn or bend so far
// within a step that the Jacobian of its start is no guide. One evaluation per row and iteration, so it is the last
// resort.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "limber/solvers/least_squares.h"

namespace limber::internal {

/// w(f) with  w = 0 where lower < f < upper,  w ≥ 0 at the lower bound,  w ≤ 0 at the upper one.
struct IntervalRows {
  std::span<const double> slope;      ///< ≥ 0: about ∂w_i/∂f_i; 0: nothing moves the row, its f stays
  std::span<const double> tolerance;  ///< of w, > 0; lengths at hand are some 1e10 times as large
  std::span<const double> lower, upper;
};

/// The method and its memory, which grows to the largest problem seen.
class DifferenceNewton {
 public:
  using Evaluate = std::function<void(std::span<const double> f, std::span<double> w)>;

  /// @param f a guess; on return the best found, at which w was evaluated last
  /// @return the largest residual there, in tolerances: solved if at most 1
  double solve(const IntervalRows& rows, const Evaluate& evaluate, std::span<double> f);

 private:
  double residual(const IntervalRows& rows, std::span<const double> f);
  void differentiate(const IntervalRows& rows, const Evaluate& evaluate, std::span<double> f);
  void find_step();

  std::vector<double> w_, w_there_, F_, J_, metric_, step_, multipliers_, from_;
  LeastSquaresSolver least_squares_;
};

}  // namespace limber::internal
