#include "limber/solvers/unsymmetric_factor.h"

#include <algorithm>
#include <cmath>

#include "dense_kernels.h"

namespace limber::internal {

bool UnsymmetricFactor::factor(std::span<const double> A, std::size_t n) {
  n_ = n;
  lu_.assign(A.begin(), A.end());
  inverse_pivot_.resize(n), swapped_with_.resize(n), end_.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    std::size_t end = n;
    while (end > 0 && lu_[i * n + end - 1] == 0.0) --end;
    end_[i] = end;
  }
  for (std::size_t k = 0; k < n; ++k) {
    std::size_t pivot = k;
    for (std::size_t i = k + 1; i < n; ++i)
      if (std::abs(lu_[i * n + k]) > std::abs(lu_[pivot * n + k])) pivot = i;
    swapped_with_[k] = pivot;
    double* row = lu_.data() + k * n;
    if (pivot != k) {
      std::swap_ranges(row, row + n, lu_.data() + pivot * n);
      std::swap(end_[k], end_[pivot]);
    }
    if (!(std::abs(row[k]) > 0.0) || !std::isfinite(row[k])) return false;
    inverse_pivot_[k] = 1.0 / row[k];
    for (std::size_t i = k + 1; i < n; ++i) {
      double* below = lu_.data() + i * n;
      const double factor = below[k] * inverse_pivot_[k];
      below[k] = factor;
      if (factor == 0.0) continue;
      for (std::size_t j = k + 1; j < end_[k]; ++j) below[j] -= factor * row[j];
      end_[i] = std::max(end_[i], end_[k]);
    }
  }
  return true;
}

void UnsymmetricFactor::solve(std::span<double> X, std::size_t columns) {
  const MatrixView x = right_.need(n_, columns);
  for (std::size_t i = 0; i < n_; ++i) std::copy_n(X.data() + i * columns, columns, x.row(i));
  for (std::size_t k = 0; k < n_; ++k)
    if (swapped_with_[k] != k) std::swap_ranges(x.row(k), x.row(k) + columns, x.row(swapped_with_[k]));
  const auto subtract = [&](std::size_t to, std::size_t begin, std::size_t end) {
    which_.clear(), factors_.clear();
    for (std::size_t k = begin; k < end; ++k) {
      if (lu_[to * n_ + k] == 0.0) continue;
      which_.push_back(static_cast<int>(k));
      factors_.push_back(-lu_[to * n_ + k]);
    }
    combine_rows(x.row(to), x.row(to), x, which_.data(), factors_.data(), which_.size(), columns);
  };
  for (std::size_t i = 1; i < n_; ++i) subtract(i, 0, i);
  for (std::size_t i = n_; i-- > 0;) {
    subtract(i, i + 1, std::max(i + 1, end_[i]));
    for (std::size_t j = 0; j < columns; ++j) x.row(i)[j] *= inverse_pivot_[i];
  }
  for (std::size_t i = 0; i < n_; ++i) std::copy_n(x.row(i), columns, X.data() + i * columns);
}

}  // namespace limber::internal
