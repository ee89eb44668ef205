/// @file limber/solvers/hauser/linear_program.h
/// Small dense linear programs, [H03] section 3.4.2: the least total impulse that keeps every contact open.
///
///   min cᵀf   subject to   A f + b ≥ 0,  f ≥ 0        (c ≥ 0)
///
/// Solved by the primal simplex method on the dual, max −bᵀy with Aᵀy ≤ c, y ≥ 0, whose slack basis is feasible: there
/// is no first phase, and for a new b the last basis is still feasible. The tableau is condensed, (columns + 1) × (rows
/// + 1). Ratio test after Harris (Math. Programming 5, 1973); after a run of steps without progress, Bland's rule,
/// which cannot cycle (Math. Oper. Res. 2, 1977).
///
/// Where no f satisfies the rows, slack t ≥ 0 is bought at a price per unit, large beside c: min cᵀf + price·Σt with
/// A f + t + b ≥ 0. Where one does, no slack is bought, whatever the price.
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

struct LinearProgramOptions {
  double tolerance = 1e-10;  ///< of A f + b ≥ 0, relative to |b| + |A||f| of the row; > 0
  double slack_price = 1e6;  ///< of slack, in units of the largest c, rows scaled to 1; > 0. Infeasible programs only
  int max_pivots = 0;        ///< ≥ 0; 0: 100 + 20 (rows + columns)
};

struct LinearProgramResult {
  SolveStatus status = SolveStatus::kSolved;
  int pivots = 0;            ///< exchanges of the basis and of a variable's bound
  int refactorizations = 0;  ///< how often the tableau was made anew because it had lost digits
  double objective = 0.0;    ///< cᵀf
  double slack = 0.0;        ///< max_i −(A f + b)_i, or 0: how far the worst row is violated, in the row's unit
};

/// The solver and its memory, which grows to the largest problem seen; after that a solve allocates nothing. One thread
/// at a time. The same sequence of calls gives the same bits.
class LinearProgramSolver {
 public:
  LinearProgramSolver();
  ~LinearProgramSolver();
  LinearProgramSolver(LinearProgramSolver&&) noexcept;
  LinearProgramSolver& operator=(LinearProgramSolver&&) noexcept;

  /// @param f columns; the minimiser on return, all zero for kInvalidInput
  /// @throws InvalidArgument if a span's length does not fit rows and columns, or an option is out of range
  LinearProgramResult solve(const LinearProgram& program, std::span<double> f,
                            const LinearProgramOptions& options = {});

  /// Like solve(), but begins at the basis where the last call ended if the program has the same shape and the basis is
  /// feasible for the new A and c. For small changes of A.
  LinearProgramResult solve_warm(const LinearProgram& program, std::span<double> f,
                                 const LinearProgramOptions& options = {});

  /// The last program with another b: its tableau is taken as it is. @param b rows of the last program
  /// @throws InvalidArgument if no program was solved, or a span does not fit it
  LinearProgramResult solve_again(std::span<const double> b, std::span<double> f,
                                  const LinearProgramOptions& options = {});

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limber
