/// @file limber/hauser/equality_elimination.h
/// Joints and handles beside contacts, for the linear program and the complementary problem of [H03].
#pragma once

#include <span>
#include <vector>

#include "limber/solvers/least_squares.h"

namespace limber {

/// Removes equality rows e from a problem with other rows c, so that a linear program or QP sees the latter alone:
///
///   [w_e]   [A_ee A_ec] [f_e]   [b_e]                    A' = A_cc − A_ce A_ee⁺ A_ec
///   [w_c] = [A_ce A_cc] [f_c] + [b_c],   w_e = 0:        b' = b_c − A_ce A_ee⁺ b_e,     f_e = −A_ee⁺ (b_e + A_ec f_c)
///
/// A_ee may have any rank (kinematic loops): w_e = 0 then holds in the least-squares sense, and f_e is the smallest,
/// both with the rows scaled to A_ii = 1, so that metres and radians mix. A is symmetric positive semidefinite, so A'
/// is too.
class EqualityElimination {
 public:
  /// @param A n × n, symmetric, the e = `equalities` rows first. @param b n
  /// @param A_reduced (n − e) × (n − e), row-major. @param b_reduced n − e
  /// @return kInvalidInput if a number is not finite: outputs are zero then
  /// @throws InvalidArgument if lengths do not fit
  LeastSquaresResult reduce(std::span<const double> A, std::span<const double> b, int equalities,
                            std::span<double> A_reduced, std::span<double> b_reduced);

  /// The equality forces that go with f_c. @param f_c n − e numbers. @param f_e e numbers
  void recover(std::span<const double> f_c, std::span<double> f_e);

 private:
  void take(std::span<const double> A, std::span<const double> b);
  internal::MatrixView solve_rows();

  std::size_t e_ = 0, c_ = 0;
  bool valid_ = false;
  internal::MatrixBuffer ee_memory_, ec_memory_, Y_memory_, gram_memory_;
  internal::MatrixView A_ee_{}, A_ec_{};  // scaled
  internal::PivotedCholesky factor_;
  std::vector<double> scale_, b_e_, coefficients_;
  internal::AlignedBuffer x_, rest_;
};

}  // namespace limber
