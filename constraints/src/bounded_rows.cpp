#include "bounded_rows.h"

#include <algorithm>

namespace limber {
namespace {

constexpr ProximalSolver::Options kOptions{.max_newton_steps = 120, .max_sweeps = 0};
constexpr ProximalSolver::Options kOptionsBeforeSplitting{.max_newton_steps = 60, .max_sweeps = 0};
constexpr ProximalSolver::Options kOptionsOfShortSteps{.max_newton_steps = 120, .max_sweeps = 0, .first_rho = 1.0};
// A step of a thousand rows takes most of a millisecond.
constexpr ProximalSolver::Options kOptionsOfLarge{.max_newton_steps = 40, .max_sweeps = 0, .contradiction = 1e-5};
constexpr int kSplittings = 100;        // iterations, which cost as much as seven of Newton's steps
constexpr int kFewestNewtonSteps = 20;  // of an attempt, when all that were allowed are used up

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

SolveStatus BoundedRowSolver::solve_cones(const BoundedRows& rows, std::span<double> f) {
  full_.set(rows.A, f.size());
  return solve(rows, full_, f, ConeMethod::kSplitBetween);
}

/// With as many of Newton's steps as the island's step has left.
ProximalSolver::Result BoundedRowSolver::attempt(const BoundedRows& rows, RowCoupling& coupling, std::span<double> f,
                                                 ProximalSolver::Options options) {
  options.max_newton_steps =
      std::clamp(most_newton_steps_ - newton_steps_, kFewestNewtonSteps, options.max_newton_steps);
  const ProximalSolver::Result result = proximal_.solve(rows, coupling, f, options);
  newton_steps_ += result.newton_steps;
  return result;
}

/// Long proximal steps use up Newton's steps where bodies bend and loads have dented them, far from where they were,
/// and where the shifts of many contacts that slide and stick go round. Short ones come to the answer in a few then,
/// and from where splitting has brought the shifts.
SolveStatus BoundedRowSolver::solve(const BoundedRows& rows, RowCoupling& coupling, std::span<double> f,
                                    ConeMethod method) {
  if (method == ConeMethod::kOnce) {
    const ProximalSolver::Result result = proximal_.solve(rows, coupling, f, kOptionsOfLarge);
    newton_steps_ += result.newton_steps;
    return result.status;
  }
  const bool splits = method == ConeMethod::kSplitBetween;
  if (splits) splitting_.begin(rows, coupling);  // its memory, too, whether or not it comes to that
  other_.assign(f.begin(), f.end());
  const ProximalSolver::Result first = attempt(rows, coupling, f, splits ? kOptionsBeforeSplitting : kOptions);
  if (first.status == SolveStatus::kSolved) return first.status;
  if (splits) {
    std::copy(f.begin(), f.end(), other_.begin());
    if (!splitting_.advance(rows.b, kSplittings, other_)) return first.status;
  }
  const ProximalSolver::Result second = attempt(rows, coupling, other_, kOptionsOfShortSteps);
  if (!(second.residual < first.residual)) return first.status;
  std::copy(other_.begin(), other_.end(), f.begin());
  return second.status;
}

}  // namespace limber
