#include "bounded_rows.h"

#include <algorithm>

namespace limber {
namespace {

constexpr ProximalSolver::Options kOptions{.max_newton_steps = 120, .max_sweeps = 30};
constexpr ProximalSolver::Options kOptionsOfShortSteps{.max_newton_steps = 120, .max_sweeps = 30, .first_rho = 1.0};
// A step of a thousand rows takes most of a millisecond.
constexpr ProximalSolver::Options kOptionsOfLarge{.max_newton_steps = 40, .max_sweeps = 0, .contradiction = 1e-5};

}  // namespace

SolveStatus BoundedRowSolver::solve(const BoundedRows& rows, std::span<double> f) {
  if (rows.cones > 0) return solve_cones(rows, f);
  return qp_
      .solve(
          ContactQp{
              .size = static_cast<int>(f.size()), .A = rows.A, .b = rows.b, .lower = rows.lower, .upper = rows.upper},
          f)
      .status;
}

/// Contacts of bodies that bend, which loads have dented and bent, may be far from where they were: long proximal steps
/// then use up Newton's steps, where short ones come to the answer in a few.
SolveStatus BoundedRowSolver::solve_cones(const BoundedRows& rows, std::span<double> f) {
  other_.assign(f.begin(), f.end());
  const ProximalSolver::Result first = proximal_.solve(rows, f, kOptions);
  if (first.status == SolveStatus::kSolved) return first.status;
  const ProximalSolver::Result second = proximal_.solve(rows, other_, kOptionsOfShortSteps);
  if (!(second.residual < first.residual)) return first.status;
  std::copy(other_.begin(), other_.end(), f.begin());
  return second.status;
}

SolveStatus BoundedRowSolver::solve(const BoundedRows& rows, RowCoupling& coupling, std::span<double> f) {
  return proximal_.solve(rows, coupling, f, kOptionsOfLarge).status;
}

}  // namespace limber
