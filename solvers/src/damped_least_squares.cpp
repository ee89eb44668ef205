#include "limber/solvers/damped_least_squares.h"

#include <algorithm>
#include <cmath>

namespace limber::internal {
namespace {

/// y ← y − 2 v (v·y)/|v|² between two places.
void reflect(const double* v, double square, double* y, std::size_t begin, std::size_t end) {
  double product = 0.0;
  for (std::size_t i = begin; i < end; ++i) product += v[i] * y[i];
  const double factor = 2.0 * product / square;
  for (std::size_t i = begin; i < end; ++i) y[i] -= factor * v[i];
}

}  // namespace

void DampedLeastSquares::solve(std::span<const double> A, double damping, std::span<double> x) {
  const std::size_t n = x.size(), tall = 2 * n;
  columns_.assign(n * tall, 0.0), right_.assign(tall, 0.0);
  for (std::size_t j = 0; j < n; ++j) {
    for (std::size_t i = 0; i < n; ++i) columns_[j * tall + i] = A[i * n + j];
    columns_[j * tall + n + j] = damping;
    right_[j] = x[j];
  }
  // Column j reaches down to its own row of the damping: what has been reflected fills the rows above alone.
  for (std::size_t j = 0; j < n; ++j) {
    double* v = columns_.data() + j * tall;
    const std::size_t end = n + j + 1;
    double square = 0.0;
    for (std::size_t i = j; i < end; ++i) square += v[i] * v[i];
    const double diagonal = v[j] > 0.0 ? -std::sqrt(square) : std::sqrt(square);
    const double length = 2.0 * (square - v[j] * diagonal);
    v[j] -= diagonal;
    for (std::size_t k = j + 1; k < n; ++k) reflect(v, length, columns_.data() + k * tall, j, end);
    reflect(v, length, right_.data(), j, end);
    v[j] = diagonal;
  }
  for (std::size_t j = n; j-- > 0;) {
    double sum = right_[j];
    for (std::size_t k = j + 1; k < n; ++k) sum -= columns_[k * tall + j] * x[k];
    x[j] = sum / columns_[j * tall + j];
  }
}

}  // namespace limber::internal
