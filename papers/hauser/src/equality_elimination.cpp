#include "limber/hauser/equality_elimination.h"

#include <algorithm>
#include <cmath>

#include "argument_checks.h"
#include "dense_kernels.h"

namespace limber {
using namespace internal;  // kernels and checks

namespace {

constexpr double kRank = 1e-11;           // of the largest pivot, below which a pivot is zero
constexpr double kLeastMobility = 1e-13;  // of the largest diagonal: rows that move less are not scaled up

using Numbers = std::span<const double>;

}  // namespace

// A_ee with rows and columns, A_ec and b_e with rows, scaled to a unit diagonal: joints mix metres and radians, and the
// rank cut compares pivots. Rows that nothing moves are left small.
void EqualityElimination::take(Numbers A, Numbers b) {
  const std::size_t n = e_ + c_;
  double largest = 0.0;
  for (std::size_t i = 0; i < e_; ++i) largest = std::max(largest, A[i * n + i]);
  scale_.resize(e_), b_e_.resize(e_);
  for (std::size_t i = 0; i < e_; ++i)
    scale_[i] = largest > 0.0 ? 1.0 / std::sqrt(std::max(A[i * n + i], kLeastMobility * largest)) : 1.0;
  A_ee_ = ee_memory_.need(e_, e_);
  A_ec_ = ec_memory_.need(e_, c_);
  for (std::size_t i = 0; i < e_; ++i) {
    for (std::size_t j = 0; j < e_; ++j) A_ee_.row(i)[j] = scale_[i] * scale_[j] * A[i * n + j];
    std::fill(A_ee_.row(i) + e_, A_ee_.row(i) + A_ee_.stride, 0.0);
    for (std::size_t j = 0; j < c_; ++j) A_ec_.row(i)[j] = scale_[i] * A[i * n + e_ + j];
    std::fill(A_ec_.row(i) + c_, A_ec_.row(i) + A_ec_.stride, 0.0);
    b_e_[i] = scale_[i] * b[i];
  }
}

// Y with YᵀY = A_ce A_ee⁺ A_ec, by substitution on the independent rows: Y = L₁₁⁻¹ A_ec.
MatrixView EqualityElimination::solve_rows() {
  const MatrixView Y = Y_memory_.need(e_, c_), L = factor_.columns();
  coefficients_.resize(e_);
  for (std::size_t j = 0; j < factor_.rank(); ++j) {
    const std::size_t p = factor_.pivot(j);
    for (std::size_t i = 0; i < j; ++i) coefficients_[i] = -L.row(i)[p];
    combine_rows(Y.row(j), A_ec_.row(p), Y, nullptr, coefficients_.data(), j, c_);
    for (std::size_t i = 0; i < c_; ++i) Y.row(j)[i] /= L.row(j)[p];
  }
  return Y;
}

LeastSquaresResult EqualityElimination::reduce(Numbers A, Numbers b, int equalities, std::span<double> A_reduced,
                                               std::span<double> b_reduced) {
  const char* name = "EqualityElimination::reduce";
  const std::size_t n = b.size();
  check_option(name, "equalities", equalities >= 0 && static_cast<std::size_t>(equalities) <= n, equalities,
               "0 to the number of rows");
  e_ = static_cast<std::size_t>(equalities), c_ = n - e_;
  check_length(name, "A", A.size(), n * n);
  check_length(name, "A_reduced", A_reduced.size(), c_ * c_);
  check_length(name, "b_reduced", b_reduced.size(), c_);
  valid_ = all_finite(A.data(), A.size()) && all_finite(b.data(), b.size());
  if (!valid_) {
    std::ranges::fill(A_reduced, 0.0);
    std::ranges::fill(b_reduced, 0.0);
    return {.status = SolveStatus::kInvalidInput};
  }
  take(A, b);
  factor_.factor(A_ee_, e_, kRank);

  const MatrixView YtY = gram_memory_.need(c_, c_);
  gram(YtY, solve_rows(), factor_.rank(), c_);
  for (std::size_t i = 0; i < c_; ++i)
    for (std::size_t j = 0; j < c_; ++j) A_reduced[i * c_ + j] = A[(e_ + i) * n + e_ + j] - YtY.row(i)[j];

  double *x = x_.zeros(e_), *rest = rest_.zeros(c_);
  std::ranges::copy(b_e_, x);
  factor_.apply_pseudoinverse(x);
  for (std::size_t i = 0; i < e_; ++i) x[i] = -x[i];
  std::ranges::copy(b.subspan(e_), rest);
  combine_rows(rest, rest, A_ec_, nullptr, x, e_, c_);
  std::copy_n(rest, c_, b_reduced.begin());
  return {.status = SolveStatus::kSolved, .rank = static_cast<int>(factor_.rank())};
}

void EqualityElimination::recover(Numbers f_c, std::span<double> f_e) {
  check_length("EqualityElimination::recover", "f_c", f_c.size(), c_);
  check_length("EqualityElimination::recover", "f_e", f_e.size(), e_);
  if (!valid_) return std::fill(f_e.begin(), f_e.end(), 0.0);
  double *x = x_.zeros(e_), *f = rest_.zeros(c_);
  std::ranges::copy(f_c, f);
  multiply_rows(x, A_ec_, nullptr, f, e_, c_);
  for (std::size_t i = 0; i < e_; ++i) x[i] += b_e_[i];
  factor_.apply_pseudoinverse(x);
  for (std::size_t i = 0; i < e_; ++i) f_e[i] = -scale_[i] * x[i];
}

}  // namespace limber
