#include "bounded_rows.h"

namespace limber {

SolveStatus BoundedRowSolver::solve(const BoundedRows& rows, std::span<double> f) {
  if (rows.cones > 0) return proximal_.solve(rows, f, {.max_newton_steps = 120, .max_sweeps = 30}).status;
  return qp_
      .solve(
          ContactQp{
              .size = static_cast<int>(f.size()), .A = rows.A, .b = rows.b, .lower = rows.lower, .upper = rows.upper},
          f)
      .status;
}

}  // namespace limber
