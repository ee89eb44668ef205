#include "bounded_rows.h"

#include <algorithm>

namespace limber {
namespace {

constexpr ProximalSolver::Options kOptions{.max_newton_steps = 120, .max_sweeps = 30};
constexpr ProximalSolver::Options kOptionsOfShortSteps{.max_newton_steps = 120, .max_sweeps = 30, .first_rho = 1.0};
// A step of a thousand rows takes most of a millisecond.
constexpr ProximalSolver::Options kOptionsOfLarge{.max_newton_steps = 40, .max_sweeps = 0, .contradiction = 1e-5};
constexpr int kFewestNewtonSteps = 10;  // of a problem, when all that were allowed are used up

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
template <class Solve>
SolveStatus BoundedRowSolver::solve_twice(const Solve& solve, std::span<double> f) {
  other_.assign(f.begin(), f.end());
  const ProximalSolver::Result first = solve(f, kOptions);
  if (first.status == SolveStatus::kSolved) return first.status;
  const ProximalSolver::Result second = solve(std::span(other_), kOptionsOfShortSteps);
  if (!(second.residual < first.residual)) return first.status;
  std::copy(other_.begin(), other_.end(), f.begin());
  return second.status;
}

SolveStatus BoundedRowSolver::solve_cones(const BoundedRows& rows, std::span<double> f) {
  return solve_twice([&](std::span<double> g, const ProximalSolver::Options& o) { return proximal_.solve(rows, g, o); },
                     f);
}

SolveStatus BoundedRowSolver::solve(const BoundedRows& rows, RowCoupling& coupling, std::span<double> f, bool patient) {
  if (!patient) return proximal_.solve(rows, coupling, f, kOptionsOfLarge).status;
  const auto solve_some = [&](std::span<double> guess, ProximalSolver::Options options) {
    options.max_newton_steps = std::clamp(newton_steps_left_, kFewestNewtonSteps, options.max_newton_steps);
    options.max_sweeps = 0;
    const ProximalSolver::Result result = proximal_.solve(rows, coupling, guess, options);
    newton_steps_left_ -= result.newton_steps;
    return result;
  };
  return solve_twice(solve_some, f);
}

}  // namespace limber
