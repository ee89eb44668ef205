#include "bounded_rows.h"

namespace limber {
namespace {

constexpr ProximalSolver::Options kOptions{.max_newton_steps = 120, .max_sweeps = 30};
// A step of a thousand rows takes most of a millisecond.
constexpr ProximalSolver::Options kOptionsOfLarge{.max_newton_steps = 40, .max_sweeps = 0, .contradiction = 1e-5};

}  // namespace

SolveStatus BoundedRowSolver::solve(const BoundedRows& rows, std::span<double> f) {
  if (rows.cones > 0) return proximal_.solve(rows, f, kOptions).status;
  return qp_
      .solve(
          ContactQp{
              .size = static_cast<int>(f.size()), .A = rows.A, .b = rows.b, .lower = rows.lower, .upper = rows.upper},
          f)
      .status;
}

SolveStatus BoundedRowSolver::solve(const BoundedRows& rows, RowCoupling& coupling, std::span<double> f) {
  return proximal_.solve(rows, coupling, f, kOptionsOfLarge).status;
}

}  // namespace limber
