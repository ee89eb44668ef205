#include "dense_coupling.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace limber {

bool DenseLu::factor(MatrixView M, std::size_t n) {
  M_ = M, n_ = n;
  pivots_.resize(n);
  for (std::size_t k = 0; k < n; ++k) {
    std::size_t p = k;
    for (std::size_t i = k + 1; i < n; ++i)
      if (std::abs(M.row(i)[k]) > std::abs(M.row(p)[k])) p = i;
    if (!(std::abs(M.row(p)[k]) > 0.0)) return false;
    pivots_[k] = p;
    if (p != k) std::swap_ranges(M.row(p), M.row(p) + n, M.row(k));
    const std::size_t first = k / kPad * kPad;  // kernels take aligned rows; what is left of k is put back
    double kept[kPad];
    for (std::size_t i = k + 1; i < n; ++i) {
      double* row = M.row(i);
      const double part = row[k] / M.row(k)[k];
      if (part == 0.0) continue;
      std::copy_n(row + first, k - first, kept);
      add_scaled(row + first, -part, M.row(k) + first, n - first);
      std::copy_n(kept, k - first, row + first);
      row[k] = part;
    }
  }
  return true;
}

void DenseLu::solve(double* x) const {
  for (std::size_t k = 0; k < n_; ++k) std::swap(x[k], x[pivots_[k]]);
  for (std::size_t i = 1; i < n_; ++i)
    for (std::size_t j = 0; j < i; ++j) x[i] -= M_.row(i)[j] * x[j];
  for (std::size_t i = n_; i-- > 0;) {
    for (std::size_t j = i + 1; j < n_; ++j) x[i] -= M_.row(i)[j] * x[j];
    x[i] /= M_.row(i)[i];
  }
}

Mat3 DenseCoupling::own_block(std::size_t first, std::size_t count) const {
  Mat3 block = Mat3::Zero();
  for (std::size_t r = 0; r < count; ++r)
    for (std::size_t c = 0; c < count; ++c)
      block(static_cast<int>(r), static_cast<int>(c)) = given_[(first + r) * n_ + first + c];
  return block;
}

void DenseCoupling::scale(std::span<const double> s) {
  A_ = A_memory_.need(n_, n_);
  for (std::size_t i = 0; i < n_; ++i) {
    for (std::size_t j = 0; j < n_; ++j) A_.row(i)[j] = given_[i * n_ + j] / (s[i] * s[j]);
    std::fill(A_.row(i) + n_, A_.row(i) + A_.stride, 0.0);
  }
  std::fill_n(zero_memory_.need(n_), padded(n_), 0.0);
  // All that a step of any kind may take, so that a problem of this size allocates nothing whichever way it goes.
  newton_memory_.need(n_, n_);
  for (AlignedBuffer* memory : {&coefficients_memory_, &row_memory_, &product_memory_, &answer_memory_})
    memory->need(n_);
  active_.reserve(n_), columns_.reserve(n_), lu_.reserve(n_);
  shifted_.reset(n_);
}

/// dy = −d + ρ S (1 + ρ SᵀA S)⁻¹ SᵀA d
bool DenseCoupling::convex_step(std::span<const ProjectionDerivative> P, double rho, const double* d, double* dy) {
  columns_.clear();
  for (const ProjectionDerivative& of : P)
    for (std::size_t c = 0; c < of.columns; ++c) columns_.push_back({of.first, of.rows, of.s[c]});
  const std::size_t a = columns_.size();
  const MatrixView M = newton_memory_.need(a, a);
  double *x = coefficients_memory_.need(a), *row = row_memory_.need(n_), *Ad = product_memory_.need(n_);
  multiply(Ad, d);
  for (std::size_t i = 0; i < a; ++i) {
    const Column& at = columns_[i];
    int rows[3];
    for (std::size_t r = 0; r < at.rows; ++r) rows[r] = static_cast<int>(at.first + r);
    combine_rows(row, zero_memory_.data(), A_, rows, at.s.data(), at.rows, n_);  // of A S
    for (std::size_t j = 0; j < a; ++j) {
      const Column& to = columns_[j];
      double sum = 0.0;
      for (std::size_t r = 0; r < to.rows; ++r) sum += to.s[static_cast<int>(r)] * row[to.first + r];
      M.row(i)[j] = rho * sum + (i == j ? 1.0 : 0.0);
    }
    std::fill(M.row(i) + a, M.row(i) + M.stride, 0.0);
    x[i] = 0.0;
    for (std::size_t r = 0; r < at.rows; ++r) x[i] += rho * at.s[static_cast<int>(r)] * Ad[at.first + r];
  }
  if (!lu_.factor(M, a)) return false;
  lu_.solve(x);
  for (std::size_t i = 0; i < n_; ++i) dy[i] = -d[i];
  for (std::size_t i = 0; i < a; ++i)
    for (std::size_t r = 0; r < columns_[i].rows; ++r)
      dy[columns_[i].first + r] += columns_[i].s[static_cast<int>(r)] * x[i];
  return true;
}

bool DenseCoupling::map_step(std::span<const ProjectionDerivative> P, double rho, const double* d, double* dy) {
  active_.clear();
  for (const ProjectionDerivative& of : P)
    for (std::size_t i = of.first; i < of.first + of.rows; ++i) {
      dy[i] = of.columns > 0 ? 0.0 : -d[i];
      if (of.columns > 0) active_.push_back(i);
    }
  const std::size_t a = active_.size();
  const MatrixView M = newton_memory_.need(a, a);
  double *x = coefficients_memory_.need(a), *row = row_memory_.need(n_), *left = product_memory_.need(n_);
  multiply(left, dy);  // by what has left
  std::size_t k = 0;
  for (const ProjectionDerivative& of : P) {
    if (of.columns == 0) continue;
    Mat3 own = Mat3::Zero();
    for (std::size_t c = 0; c < of.columns; ++c) own += of.s[c] * of.s[c].transpose();
    const Mat3 PC = own + own.col(0) * of.shift.transpose();
    int from[3];
    for (std::size_t c = 0; c < of.rows; ++c) from[c] = static_cast<int>(of.first + c);
    for (std::size_t r = 0; r < of.rows; ++r) {
      const Vec3 weight = PC.row(static_cast<int>(r));
      combine_rows(row, zero_memory_.data(), A_, from, weight.data(), of.rows, n_);
      double* to = M.row(k + r);
      for (std::size_t j = 0; j < a; ++j) to[j] = row[active_[j]];
      std::fill(to + a, to + M.stride, 0.0);
      x[k + r] = -d[of.first + r];
      for (std::size_t c = 0; c < of.rows; ++c) {
        const double part = own(static_cast<int>(r), static_cast<int>(c));
        to[k + c] += (r == c ? 1.0 : 0.0) - part + part / rho;
        x[k + r] -= weight[static_cast<int>(c)] * left[of.first + c];
      }
    }
    k += of.rows;
  }
  if (!lu_.factor(M, a)) return false;
  lu_.solve(x);
  for (std::size_t i = 0; i < a; ++i) dy[active_[i]] = x[i];
  return true;
}

bool DenseCoupling::factor_shifted(double shift) {
  shifted_.reset(n_);
  double* column = row_memory_.need(n_);
  for (std::size_t i = 0; i < n_; ++i) {
    std::copy_n(A_.row(i), i, column);
    if (!shifted_.append(column, A_.row(i)[i] + shift)) return false;
  }
  return true;
}

void DenseCoupling::solve_shifted(double* x) { shifted_.solve(x); }

void DenseCoupling::begin_sweeps(const double* f) { multiply(answer_memory_.need(n_), f); }

Vec3 DenseCoupling::answer(std::size_t first, std::size_t count) const {
  Vec3 own = Vec3::Zero();
  std::copy_n(answer_memory_.data() + first, count, own.data());
  return own;
}

void DenseCoupling::move(std::size_t first, std::size_t count, const Vec3& change) {
  int rows[3];
  for (std::size_t c = 0; c < count; ++c) rows[c] = static_cast<int>(first + c);
  double* answer = answer_memory_.data();
  combine_rows(answer, answer, A_, rows, change.data(), count, n_);
}

}  // namespace limber
