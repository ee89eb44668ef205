// The rows of an island whose impulses have bounds, in one iteration of Newton's method: w = A f + b with
// contacts in friction cones and rows with an interval each. The one place where a contact method is chosen.
#pragma once

#include <span>
#include <vector>

#include "limber/constraints/contact_qp.h"
#include "limber/constraints/friction_cone.h"

namespace limber {

/// Impulses f are whole ones, with what is held over the step. Rows of cones come first.
struct BoundedRows {
  int cones = 0;                     ///< the first 3 × cones rows: normal and two tangents each
  std::span<const double> A;         ///< n × n, symmetric positive semidefinite
  std::span<const double> b;         ///< n: gaps less offsets at the step's end without the impulses
  std::span<const double> friction;  ///< μ > 0 of each cone
  std::span<const double> lower;     ///< n; those of cones are not read
  std::span<const double> upper;     ///< n
};

/// The solver and its memory, which grows to the largest problem seen.
class BoundedRowSolver {
 public:
  /// @param f n; on entry a guess, on return within bounds and cones
  SolveStatus solve(const BoundedRows& rows, std::span<double> f);

 private:
  SolveStatus solve_boxes(const BoundedRows& rows, std::span<double> f);
  SolveStatus solve_in_turn(const BoundedRows& rows, std::span<double> f);

  std::vector<double> A_cones_, b_cones_, A_boxes_, b_boxes_, last_;
  ContactQpSolver qp_;
  FrictionSolver friction_;
};

}  // namespace limber
