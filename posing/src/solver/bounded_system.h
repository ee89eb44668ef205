// The small dense problem that rows make: equations, springs, and limits that only push.
#pragma once

#include <vector>

#include "solver/elastic_system.h"

namespace limber::internal {

/// min ½ λᵀ A λ − bᵀ λ with λ_i ≥ 0 where `pushes[i]`; A symmetric, positive semidefinite. Then A λ = b in rows that do
/// not push, and in those that do A λ ≥ b with equality where λ > 0. Rows that repeat others (a closed chain's) share:
/// A is solved with 1e-12 of its diagonal added.
/// @param lambda in: where to begin, such as the solution of a similar problem; negative entries count as 0. Out: the
/// solution. The active set grows by one row at a time and shrinks as far as it must (Lawson and Hanson, *Solving Least
/// Squares Problems*, 1974, chapter 23), so it ends.
void solve_bounded(const MatrixX& A, const VectorX& b, const std::vector<bool>& pushes, VectorX& lambda);

}  // namespace limber::internal
