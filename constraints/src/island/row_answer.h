// Impulses with which rows meet their laws where gaps follow them linearly: gaps = open + A Δ.
#pragma once

#include <span>
#include <vector>

#include "limber/solvers/damped_least_squares.h"
#include "limber/solvers/row_equilibrium.h"
#include "midpoint_problem.h"

namespace limber::internal {

/// Rows without bounds are met in the sense of least squares with rows scaled alike, and eliminated; what is left is
/// between contacts and rows with bounds (RowEquilibrium).
class RowAnswer {
 public:
  /// Chooses the rows that take part: those without bounds, those that exert something, and those that are to.
  void begin(const IslandStep& step, std::span<const double> impulses, const MidpointProblem& problem);
  /// Finds Δ, and which rows are within their bounds.
  void solve(const IslandStep& step, std::span<const double> impulses, MidpointProblem& problem,
             const MidpointMotion& motion);
  /// Finds Δ by the matrices of the last solve(). @return whether the same rows are within their bounds
  bool solve_again(const IslandStep& step, std::span<const double> impulses, const MidpointProblem& problem,
                   const MidpointMotion& motion);
  /// Δ by row that takes part.
  const RowVector& change() const { return change_; }
  /// Rows take part, too, that leave their bounds by what the others do. @return whether there are any
  bool extend(const IslandStep& step, std::span<const double> impulses, const MidpointProblem& problem);
  /// In ascending order of when they came to take part.
  std::span<const Index> rows() const { return rows_; }
  /// By row of the island: whether it is within its bounds.
  std::span<const char> within() const { return within_; }

 private:
  void add(std::size_t first, std::size_t count);
  bool find_within(const IslandStep& step);
  void factor(const IslandStep& step);
  void find_equilibrium(const IslandStep& step, const MidpointProblem& problem);
  void meet(std::span<const double> impulses);
  std::span<double> solve_equalities(std::span<double> rows);

  std::vector<Index> rows_;                // equalities first
  std::size_t equalities_ = 0;             // of these
  std::vector<char> within_, takes_part_;  // by row of the island
  RowMatrix A_, factored_;
  RowMatrix answers_;  // of the equalities to the others: row by row of the others
  RowVector open_, scale_, change_;
  std::vector<double> W_, bounded_, apart_;  // bounded_: impulses, and gaps without them
  DampedLeastSquares least_squares_;
  RowEquilibrium equilibrium_;
};

}  // namespace limber::internal
