/// @file limber/solvers/least_squares.h
/// Equality rows of any rank: manipulation ([H03] section 3.4.1) and joints.
///
///   f = (J D Jᵀ)⁺ r                                                                                        (1)
///
/// the least-norm least-squares forces of m rows over d degrees of freedom with a diagonal metric D ≥ 0 (1/mass; H/Δt
/// for modes under a held force). Conflicting rows are met in the least-squares sense, redundant ones share the force.
/// Worked in the smaller of m and d with B = J D^½: S = B Bᵀ for m ≤ d, N = BᵀB for m > d, either factored by Cholesky
/// with diagonal pivoting and a rank cut at 1e-11 of the largest pivot, P ᵀ S P ≈ L Lᵀ with L of r columns:
///   S⁺ = L (LᵀL)⁻² Lᵀ  (m ≤ d),      (B Bᵀ)⁺ = B (N⁺)² Bᵀ,  N⁺ = L (LᵀL)⁻² Lᵀ  (m > d)
/// One step of iterative refinement follows. Cost O(m d min(m, d) + min³) to factor, O(m d) per right-hand side.
#pragma once

#include <span>
#include <vector>

#include "limber/solvers/pivoted_cholesky.h"
#include "limber/solvers/solve_status.h"

namespace limber {

struct LeastSquaresResult {
  SolveStatus status = SolveStatus::kSolved;
  int rank = 0;
};

/// Factors once, solves for any number of right-hand sides. Memory grows to the largest problem seen; after that
/// nothing is allocated. One thread at a time. The same calls give the same bits.
class LeastSquaresSolver {
 public:
  /// @param J m × d, row-major. @param metric D, d numbers ≥ 0
  /// @return kInvalidInput if a number is not finite or D has a negative: solve() then gives zero
  /// @throws InvalidArgument if lengths do not fit
  LeastSquaresResult factor(std::span<const double> J, std::span<const double> metric, int rows);

  /// f = (J D Jᵀ)⁺ r for the factored J and D. @param r, f m numbers each; may be the same memory
  /// @throws InvalidArgument if lengths do not fit
  SolveStatus solve(std::span<const double> r, std::span<double> f);

 private:
  void scale_rows(std::span<const double> J, std::span<const double> metric);
  void apply(double* r, double* f);
  void subtract_product(const double* f, double* rest);

  std::size_t m_ = 0, d_ = 0;
  bool valid_ = false;
  internal::MatrixBuffer B_memory_, Bt_memory_, S_memory_;
  internal::MatrixView B_{};         // J D^½, m × d
  internal::PivotedCholesky small_;  // of S or N
  std::vector<double> root_;         // D^½
  internal::AlignedBuffer rest_, work_, found_, product_, motion_;
};

}  // namespace limber
