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
  /// Of what an impulse moves its own row by, what a row without bounds yields to a change of it in a step: far above
  /// round-off of redundant rows.
  double yield = 1e-8;
  double digits = 1e-10;  ///< tolerance of rows with an interval each, of the largest gap
};

/// LeastSquaresSolver.
struct LeastSquaresTuning {
  double rank = 1e-11;  ///< of the largest pivot: (singular value ratio)². Less is zero. [path]
};

struct SolversTuning {
  ConvexSolverTuning convex{};
  EquilibriumTuning equilibrium{};
  LeastSquaresTuning least_squares{};
  double secant_ridge = 1e-12;  ///< of SecantIteration's normal equations, of their scaled diagonal: round-off needs it
};
inline constexpr SolversTuning kSolversTuning{};

}  // namespace limber::internal
