#include "free_set_factor.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dense_kernels.h"

namespace limber::internal {

void FreeSetFactor::reset(std::size_t capacity) {
  size_ = 0;
  R_ = memory_.need(capacity, capacity);
  diagonal_.resize(capacity), inverse_.resize(capacity);
}

bool FreeSetFactor::append(double* column, double diagonal) {
  const std::size_t k = size_;
  std::fill(column + k, column + padded(k + 1), 0.0);  // also what the padding held
  solve_lower(column, 0);
  const double pivot = diagonal - (k == 0 ? 0.0 : dot(column, column, k));
  // The difference is of this size by rounding alone when the rows are dependent.
  const double rounding =
      std::numeric_limits<double>::epsilon() * static_cast<double>(std::max<std::size_t>(64, 2 * k));
  if (!(pivot > rounding * diagonal)) return false;
  std::fill_n(R_.row(k), R_.stride, 0.0);
  for (std::size_t i = 0; i < k; ++i) R_.row(i)[k] = column[i];
  diagonal_[k] = std::sqrt(pivot);
  inverse_[k] = 1.0 / diagonal_[k];
  ++size_;
  return true;
}

void FreeSetFactor::remove(std::size_t position) {
  const std::size_t last = --size_;
  for (std::size_t i = 0; i <= last; ++i) {  // the column goes
    double* row = R_.row(i);
    std::copy(row + position + 1, row + last + 1, row + position);
    row[last] = 0.0;
  }
  // Row i + 1 now has its old diagonal left of the new one: turn it away.
  for (std::size_t i = position; i < last; ++i) {
    double* row = R_.row(i);
    const double h = row[i], below = diagonal_[i + 1];
    const double r = std::sqrt(h * h + below * below);
    row[i] = 0.0;
    diagonal_[i] = r;
    inverse_[i] = 1.0 / r;
    const std::size_t from = i / kPad * kPad;
    rotate(row + from, R_.row(i + 1) + from, h / r, below / r, last - from);
  }
}

void FreeSetFactor::solve(double* x, std::size_t first) const {
  solve_lower(x, first);
  solve_upper(x);
}

/// Whole blocks are subtracted: what is at and before the diagonal is zero, so nothing known changes.
void FreeSetFactor::solve_lower(double* x, std::size_t first) const {
  for (std::size_t i = first; i < size_; ++i) {
    x[i] *= inverse_[i];
    const std::size_t from = i / kPad * kPad;
    add_scaled(x + from, -x[i], R_.row(i) + from, size_ - from);
  }
}

void FreeSetFactor::solve_upper(double* x) const {
  for (std::size_t i = size_; i-- > 0;) {
    const std::size_t from = i / kPad * kPad;
    x[i] = (x[i] - dot(R_.row(i) + from, x + from, size_ - from)) * inverse_[i];
  }
}

}  // namespace limber::internal
