#include "limber/solvers/damped_least_squares.h"

#include <algorithm>
#include <cmath>

#include "dense_kernels.h"

namespace limber::internal {
namespace {

/// y ← y − v (v·y), |v|² = 2, where v is not zero.
void reflect(const double* v, double* y, std::size_t begin, std::size_t end) {
  const std::size_t aligned = begin / kPad * kPad;
  add_scaled(y + aligned, -dot(v + aligned, y + aligned, end - aligned), v + aligned, end - aligned);
}

}  // namespace

void DampedLeastSquares::factor(std::span<const double> A, std::size_t n, double damping) {
  n_ = n;
  columns_ = columns_memory_.need(n, 2 * n), normals_ = normals_memory_.need(n, 2 * n);
  for (std::size_t j = 0; j < n; ++j) {
    double* column = columns_.row(j);
    std::fill_n(column, columns_.stride, 0.0);
    for (std::size_t i = 0; i < n; ++i) column[i] = A[i * n + j];
    column[n + j] = damping;
  }
  // Column j reaches down to its own row of the damping: what has been reflected fills the rows above alone.
  for (std::size_t j = 0; j < n; ++j) {
    double *column = columns_.row(j), *v = normals_.row(j);
    const std::size_t end = n + j + 1, aligned = j / kPad * kPad;
    std::fill_n(v, normals_.stride, 0.0);
    std::copy(column + j, column + end, v + j);
    const double square = dot(v + aligned, v + aligned, end - aligned);
    const double diagonal = v[j] > 0.0 ? -std::sqrt(square) : std::sqrt(square);
    const double unit = 1.0 / std::sqrt(square - v[j] * diagonal);  // 1/√(½|v|²)
    v[j] -= diagonal;
    for (std::size_t i = j; i < end; ++i) v[i] *= unit;
    column[j] = diagonal;
    for (std::size_t k = j + 1; k < n; ++k) reflect(v, columns_.row(k), j, end);
  }
}

void DampedLeastSquares::solve(std::span<double> x) {
  double* right = right_.need(2 * n_);
  std::fill_n(right, padded(2 * n_), 0.0);
  std::copy(x.begin(), x.end(), right);
  for (std::size_t j = 0; j < n_; ++j) reflect(normals_.row(j), right, j, n_ + j + 1);
  for (std::size_t j = n_; j-- > 0;) {
    x[j] = right[j] / columns_.row(j)[j];
    for (std::size_t i = 0; i < j; ++i) right[i] -= columns_.row(j)[i] * x[j];
  }
}

}  // namespace limber::internal
