#include "limber/solvers/pivoted_cholesky.h"

#include <algorithm>
#include <cmath>

#include "dense_kernels.h"

namespace limber::internal {

void PivotedCholesky::factor(MatrixView S, std::size_t n, double tolerance) {
  n_ = n;
  Lt_ = columns_memory_.need(n, n);
  double* remaining = diagonal_memory_.need(n);  // of the diagonal
  double* coefficients = coefficient_memory_.need(n);
  pivots_.clear();
  pivots_.reserve(n);
  for (std::size_t i = 0; i < n; ++i) remaining[i] = S.row(i)[i];
  const double least = n == 0 ? 0.0 : tolerance * *std::max_element(remaining, remaining + n);
  while (pivots_.size() < n) {
    const std::size_t k = pivots_.size();
    const auto p = static_cast<std::size_t>(std::max_element(remaining, remaining + n) - remaining);
    if (!(remaining[p] > least)) break;
    for (std::size_t j = 0; j < k; ++j) coefficients[j] = -Lt_.row(j)[p];
    double* column = Lt_.row(k);
    combine_rows(column, S.row(p), Lt_, nullptr, coefficients, k, n);
    if (!(column[p] > least)) {  // what was subtracted from the diagonal step by step has rounded away
      remaining[p] = 0.0;
      continue;
    }
    const double inverse = 1.0 / std::sqrt(column[p]);
    for (std::size_t i = 0; i < n; ++i) column[i] *= inverse;
    for (const std::size_t earlier : pivots_) column[earlier] = 0.0;
    std::fill(column + n, column + Lt_.stride, 0.0);
    for (std::size_t i = 0; i < n; ++i) remaining[i] -= column[i] * column[i];
    remaining[p] = 0.0;
    for (const std::size_t earlier : pivots_) remaining[earlier] = 0.0;
    pivots_.push_back(p);
  }
  scratch_memory_.need(2 * padded(n));
  if (rank() == n || rank() == 0) return;
  // LᵀL, of full rank
  const MatrixView L = rows_memory_.need(n, rank());
  transpose(L, Lt_, rank(), n);
  const MatrixView gram_matrix = gram_memory_.need(rank(), rank());
  gram(gram_matrix, L, n, rank());
  if (!gram_factor_) gram_factor_ = std::make_unique<PivotedCholesky>();
  gram_factor_->factor(gram_matrix, rank(), 0.0);
}

void PivotedCholesky::solve_full(double* x) const {
  double* y = scratch_memory_.data();
  for (std::size_t j = 0; j < n_; ++j) {
    const std::size_t p = pivots_[j];
    y[j] = x[p] / Lt_.row(j)[p];
    add_scaled(x, -y[j], Lt_.row(j), n_);
  }
  std::fill_n(x, padded(n_), 0.0);
  for (std::size_t j = n_; j-- > 0;) {  // entries not found yet are zero, so the product holds the known ones
    const std::size_t p = pivots_[j];
    x[p] = (y[j] - dot(Lt_.row(j), x, n_)) / Lt_.row(j)[p];
  }
}

void PivotedCholesky::apply_pseudoinverse(double* x) const {
  if (rank() == n_) return solve_full(x);
  if (rank() == 0) {
    std::fill_n(x, padded(n_), 0.0);
    return;
  }
  double* t = scratch_memory_.data();
  std::fill(x + n_, x + padded(n_), 0.0);
  std::fill_n(t, padded(rank()), 0.0);
  multiply_rows(t, Lt_, nullptr, x, rank(), n_);
  gram_factor_->apply_pseudoinverse(t);
  gram_factor_->apply_pseudoinverse(t);
  combine_rows(x, nullptr, Lt_, nullptr, t, rank(), n_);
}

}  // namespace limber::internal
