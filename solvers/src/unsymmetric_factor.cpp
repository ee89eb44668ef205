#include "limber/solvers/unsymmetric_factor.h"

#include <algorithm>
#include <cmath>

namespace limber::internal {

bool UnsymmetricFactor::factor(std::span<const double> A, std::size_t n) {
  n_ = n;
  lu_.assign(A.begin(), A.end());
  inverse_pivot_.resize(n), swapped_with_.resize(n);
  for (std::size_t k = 0; k < n; ++k) {
    std::size_t pivot = k;
    for (std::size_t i = k + 1; i < n; ++i)
      if (std::abs(lu_[i * n + k]) > std::abs(lu_[pivot * n + k])) pivot = i;
    swapped_with_[k] = pivot;
    double* row = lu_.data() + k * n;
    if (pivot != k) std::swap_ranges(row, row + n, lu_.data() + pivot * n);
    if (!(std::abs(row[k]) > 0.0) || !std::isfinite(row[k])) return false;
    inverse_pivot_[k] = 1.0 / row[k];
    for (std::size_t i = k + 1; i < n; ++i) {
      double* below = lu_.data() + i * n;
      const double factor = below[k] * inverse_pivot_[k];
      below[k] = factor;
      if (factor == 0.0) continue;
      for (std::size_t j = k + 1; j < n; ++j) below[j] -= factor * row[j];
    }
  }
  return true;
}

void UnsymmetricFactor::solve(std::span<double> X, std::size_t columns) const {
  const auto row = [&](std::size_t i) { return X.data() + i * columns; };
  for (std::size_t k = 0; k < n_; ++k)
    if (swapped_with_[k] != k) std::swap_ranges(row(k), row(k) + columns, row(swapped_with_[k]));
  const auto subtract = [&](std::size_t to, double factor, std::size_t from) {
    if (factor == 0.0) return;
    double* x = row(to);
    const double* y = row(from);
    for (std::size_t j = 0; j < columns; ++j) x[j] -= factor * y[j];
  };
  for (std::size_t i = 1; i < n_; ++i)
    for (std::size_t k = 0; k < i; ++k) subtract(i, lu_[i * n_ + k], k);
  for (std::size_t i = n_; i-- > 0;) {
    for (std::size_t k = i + 1; k < n_; ++k) subtract(i, lu_[i * n_ + k], k);
    for (std::size_t j = 0; j < columns; ++j) row(i)[j] *= inverse_pivot_[i];
  }
}

}  // namespace limber::internal
