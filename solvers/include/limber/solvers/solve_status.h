/// @file limber/solvers/solve_status.h
/// How a dense solve ended. No solver of this module throws for what a scene can bring about in a step. The step of an
/// island may take several solves: limber/constraints/island_status.h tells how it ended, kRelaxed as a limit.
#pragma once

namespace limber {

enum class SolveStatus {
  kSolved,          ///< to the tolerance that was asked for
  kRelaxed,         ///< no exact solution exists; the priced slack or the added compliance is reported
  kIterationLimit,  ///< the best point so far; its residual is reported
  kInvalidInput,    ///< a number is not finite or a bound is upside down: the unknowns are zero
};

}  // namespace limber
