/// @file
/// Numbers of the solvers module that choose a path, end an iteration or set a tolerance, all of them and each once.
/// [path] marks those that choose a path or cap one: scripts/count counts them. Sizes of blocks in registers, bounds of
/// round-off and the depth of memories stand where they are used.
#pragma once

namespace limber::internal {

/// ConvexContactSolver: Newton's method with a line search.
struct ConvexSolverTuning {
  /// Of the slope at the start, where a search along the direction ends: at the full step, and later. The full step is
  /// worth less of a search, as most are near enough. [path]
  double enough_of_full_step = 1e-2, enough = 1e-3;
  int most_searches = 30;     ///< of the line search. [path] Bounds the work
  double longest_jump = 4.0;  ///< a step of the search at most over that before it
};

/// RowEquilibrium: interior points.
struct EquilibriumTuning {
  double met = 1e-3;             ///< of tolerances
  int most_steps = 100;          ///< of Newton's method. [path] Bounds the work
  double least_centring = 0.1;   ///< of the mean product, what a step aims at: less leaves the middle of the sets
  double part_of_longest = 0.9;  ///< of the step to the nearest bound, what is taken
};

/// ContactQpSolver: active sets.
struct QpTuning {
  /// A row that differs from those of the free forces by a part σ has a pivot of σ², taken as zero below about 1e-14,
  /// and is pulled by at most σ. A larger pull is no rounding. [path]
  double nearly_dependent = 1e-6;
  double residual = 1e-11;              ///< ContactQpResult::residual of what is solved
  double infeasible_compliance = 1e-6;  ///< added to the diagonal, as a part of it, where there is no solution. [path]
  double more_compliance = 10.0;        ///< times that, each time that it is not enough
};

/// LeastSquaresSolver and EqualityElimination.
struct LeastSquaresTuning {
  double rank = 1e-11;            ///< of the largest pivot: (singular value ratio)². Less is zero. [path]
  double least_mobility = 1e-13;  ///< of the largest diagonal: rows that move less are not scaled up
};

struct SolversTuning {
  ConvexSolverTuning convex{};
  EquilibriumTuning equilibrium{};
  QpTuning qp{};
  LeastSquaresTuning least_squares{};
  double secant_ridge = 1e-12;  ///< of SecantIteration's normal equations, of their scaled diagonal: round-off needs it
};
inline constexpr SolversTuning kSolversTuning{};

}  // namespace limber::internal
