// Rows with bounds and contacts in friction cones, of any rank, redundancy and number, by the proximal point method.
//
// With C the product of all intervals and cones, the problem is  C ∋ f,  û(f) in the normal cone of −C at f, for
// w = A f + b and û = w + μ|w_t| e_n in cones (De Saxcé), û = w elsewhere. While the shift s = μ|w_t| is held, this is
//
//   min over f in C of  ½ fᵀA f + (b + s)ᵀf,                                                                        (1)
//
// convex, but with many solutions where rows are redundant. One proximal step from f_k adds |f − f_k|²/2ρ. Its dual has
// no constraints: with A = G Gᵀ and x = Gᵀy, it is the minimum of a strongly convex, continuously differentiable φ(x)
// with gradient x − Gᵀp,  p = P_C(f_k − ρ(A y + b + s)), by Newton steps with an exact line search, which converge from
// everywhere (Rockafellar, SIAM J. Control Optim. 14 (1976) 877; for friction Castro et al., IEEE Trans. Robotics 38
// (2022) 1301; Carpentier et al., RSS 2024). G never shows: everything is said in y and A y.
//
// The shift then follows the velocities, with secants. Where it is nearly right, Newton's method on the natural map
// y − P_C(y − û(y)) of a proximal step (û with (y − f_k)/ρ added) finds forces and shift together; the proximal term
// makes its matrix regular where rows are redundant. What settles in none of these ways goes through sweeps, row by
// row.
#pragma once

#include <memory>
#include <span>

#include "force_set.h"
#include "limber/constraints/solve_status.h"
#include "row_coupling.h"

namespace limber {

/// Rows of cones and balls come first.
struct BoundedRows {
  int cones = 0;                   ///< the first 3 × cones rows: normal and two tangents each, or a vector in a ball
  std::span<const double> A = {};  ///< n × n, symmetric positive semidefinite
  std::span<const double> b = {};  ///< n
  std::span<const double> friction = {};  ///< μ ≥ 0 of each cone, 0 of each ball
  std::span<const double> radius = {};    ///< of each ball, 0 of each cone. Empty: there are no balls
  std::span<const double> lower = {};     ///< n; those of cones are not read. Empty: there are cones alone
  std::span<const double> upper = {};     ///< n
  double noise = 0.0;  ///< ≥ 0: velocities below this, times √A_ii of their rows, are as good as zero
};

class ProximalSolver {
 public:
  struct Options {
    double tolerance = 1e-9;     ///< of the residual
    int max_newton_steps = 300;  ///< ≥ 0
    int max_sweeps = 500;        ///< over all rows, where Newton's method does not settle
    /// > 0: shorter steps where Newton's method does not come to its end; rows that contradict each other by no more
    /// than this, as part of the residual, are met half way, and the status is kRelaxed
    double contradiction = 0.0;
    /// > 0: of the first proximal terms, for rows scaled to A_ii = 1; grows where steps are slow. Larger: fewer
    /// proximal steps, and more digits lost in each.
    double first_rho = 1e4;
  };
  struct Result {
    SolveStatus status = SolveStatus::kSolved;
    int newton_steps = 0, sweeps = 0;
    double residual = 0.0;  ///< as in FrictionResult, intervals likewise
  };

  ProximalSolver();
  ~ProximalSolver();
  ProximalSolver(ProximalSolver&&) noexcept;
  ProximalSolver& operator=(ProximalSolver&&) noexcept;

  /// @pre all numbers of the rows finite but for bounds, lower ≤ upper, lengths as said
  /// @param f n; on entry a guess, on return within bounds and cones, whatever the status
  Result solve(const BoundedRows& rows, std::span<double> f, const Options& options);
  /// The same for an A that is given otherwise, cones first; rows.A is not read.
  Result solve(const BoundedRows& rows, RowCoupling& coupling, std::span<double> f, const Options& options);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limber
