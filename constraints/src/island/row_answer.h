// Impulses with which rows meet their laws where gaps follow them linearly: gaps = open + A Δ.
#pragma once

#include <span>
#include <vector>

#include "limber/solvers/damped_least_squares.h"
#include "mean_problem.h"

namespace limber::internal {

/// Rows strictly within their bounds by equality, in the sense of least squares with rows scaled alike; the others at
/// their bounds.
class RowAnswer {
 public:
  /// Chooses the rows that take part: those without bounds, those within theirs, and those that leave theirs.
  void begin(const IslandStep& step, std::span<const double> impulses, const MeanProblem& problem);
  /// Finds Δ, and which rows are within their bounds.
  void solve(const IslandStep& step, std::span<const double> impulses, MeanProblem& problem, const MeanMotion& motion);
  /// Finds Δ by the matrices of the last solve(). @return whether the same rows are within their bounds
  bool solve_again(const IslandStep& step, std::span<const double> impulses, const MeanProblem& problem,
                   const MeanMotion& motion);
  /// Δ by row that takes part.
  const RowVector& change() const { return change_; }
  /// Rows take part, too, that leave their bounds by what the others do. @return whether there are any
  bool extend(const IslandStep& step, std::span<const double> impulses, const MeanProblem& problem);
  /// In ascending order of when they came to take part.
  std::span<const Index> rows() const { return rows_; }
  /// By row of the island: whether it is within its bounds.
  std::span<const char> within() const { return within_; }

 private:
  bool within(Eigen::Index i) const {
    return within_[static_cast<std::size_t>(rows_[static_cast<std::size_t>(i)])] != 0;
  }
  void find_damping(const IslandStep& step);
  bool find_within(const IslandStep& step, std::span<const double> impulses, bool one);
  void factor(const IslandStep& step, double yields);
  void meet();

  std::vector<Index> rows_;
  std::vector<char> within_, takes_part_;  // by row of the island
  RowMatrix A_, reduced_;
  RowVector open_, scale_, then_, change_, right_;
  double damping_ = 0.0;
  DampedLeastSquares least_squares_;
};

}  // namespace limber::internal
