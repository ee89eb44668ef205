/// @file limber/hauser/linear_program.h
/// Small dense linear programs, [H03] section 3.4.2: the least total impulse that keeps every contact open.
///
///   min cᵀf   subject to   A f + b ≥ 0,  f ≥ 0        (c ≥ 0)
///
/// Solved by the primal simplex method on the dual, max −bᵀy with Aᵀy ≤ c, y ≥ 0, whose slack basis is feasible: there
/// is no first phase. The tableau is condensed, (columns + 1) × (rows + 1). Ratio test after Harris (Math. Programming
/// 5, 1973); after a run of steps without progress, Bland's rule, which cannot cycle (Math. Oper. Res. 2, 1977).
///
/// Rows are met to 1e-10 of |b| + |A||f|. Where no f satisfies them, slack t ≥ 0 is bought at a price per unit, 1e6
/// times the largest c where rows are scaled to 1: min cᵀf + price·Σt with A f + t + b ≥ 0. Where one does, no slack is
/// bought, whatever the price.
///
/// The minimum is not complementary in general and can add energy: see energy_guard.h.
#pragma once

#include <memory>
#include <span>

#include "limber/solvers/solve_status.h"

namespace limber {

/// Rows are the contacts' gaps or speeds, columns the impulses. Units are the caller's.
struct LinearProgram {
  int rows = 0, columns = 0;       ///< ≥ 0
  std::span<const double> A = {};  ///< rows × columns, row-major
  std::span<const double> b = {};  ///< rows
  std::span<const double> c = {};  ///< columns, each ≥ 0; empty: all 1
};

struct LinearProgramResult {
  SolveStatus status = SolveStatus::kSolved;
  int pivots = 0;            ///< exchanges of the basis and of a variable's bound
  int refactorizations = 0;  ///< how often the tableau was made anew because it had lost digits
  double objective = 0.0;    ///< cᵀf
  double slack = 0.0;        ///< max_i −(A f + b)_i, or 0: how far the worst row is violated, in the row's unit
};

/// The solver and its memory, which grows to the largest problem seen; after that a solve allocates nothing. One thread
/// at a time. The same call gives the same bits: nothing is remembered between calls.
class LinearProgramSolver {
 public:
  LinearProgramSolver();
  ~LinearProgramSolver();
  LinearProgramSolver(LinearProgramSolver&&) noexcept;
  LinearProgramSolver& operator=(LinearProgramSolver&&) noexcept;

  /// @param f columns; the minimiser on return, all zero for kInvalidInput
  /// @throws InvalidArgument if a span's length does not fit rows and columns
  LinearProgramResult solve(const LinearProgram& program, std::span<double> f);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limber
