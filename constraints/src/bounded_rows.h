// The rows of an island whose impulses have bounds, in one iteration of Newton's method: w = A f + b with
// contacts in friction cones and rows with an interval each. The one place where a contact method is chosen.
#pragma once

#include <span>
#include <vector>

#include "limber/constraints/contact_qp.h"
#include "proximal_solver.h"

namespace limber {

/// The solver and its memory, which grows to the largest problem seen.
class BoundedRowSolver {
 public:
  /// @param rows A f + b: gaps less offsets at the step's end. @param f n whole impulses, with what is held over the
  /// step; on entry a guess, on return within bounds and cones
  SolveStatus solve(const BoundedRows& rows, std::span<double> f);
  /// The same for an A in another form; rows.A is not read.
  SolveStatus solve(const BoundedRows& rows, RowCoupling& coupling, std::span<double> f);

 private:
  SolveStatus solve_cones(const BoundedRows& rows, std::span<double> f);

  ContactQpSolver qp_;         // without cones
  ProximalSolver proximal_;    // with
  std::vector<double> other_;  // impulses of a second attempt
};

}  // namespace limber
