#include "limber/solvers/least_squares.h"

#include <algorithm>
#include <cmath>

#include "argument_checks.h"
#include "dense_kernels.h"
#include "tuning.h"

namespace limber {
using namespace internal;  // kernels and checks

namespace {

using Numbers = std::span<const double>;

}  // namespace

void LeastSquaresSolver::scale_rows(Numbers J, Numbers metric) {
  root_.resize(d_);
  for (std::size_t j = 0; j < d_; ++j) root_[j] = std::sqrt(metric[j]);
  B_ = B_memory_.need(m_, d_);
  for (std::size_t i = 0; i < m_; ++i) {
    double* row = B_.row(i);
    const double* from = J.data() + i * d_;
    for (std::size_t j = 0; j < d_; ++j) row[j] = from[j] * root_[j];
    std::fill(row + d_, row + B_.stride, 0.0);
  }
}

// f = (B Bᵀ)⁺ r, without refinement. r is overwritten.
void LeastSquaresSolver::apply(double* r, double* f) {
  if (m_ <= d_) {
    small_.apply_pseudoinverse(r);
    std::copy_n(r, padded(m_), f);
    return;
  }
  double* u = motion_.data();
  combine_rows(u, nullptr, B_, nullptr, r, m_, d_);
  small_.apply_pseudoinverse(u);
  small_.apply_pseudoinverse(u);
  multiply_rows(f, B_, nullptr, u, m_, d_);
}

// rest −= B Bᵀ f
void LeastSquaresSolver::subtract_product(const double* f, double* rest) {
  combine_rows(motion_.data(), nullptr, B_, nullptr, f, m_, d_);
  multiply_rows(product_.data(), B_, nullptr, motion_.data(), m_, d_);
  for (std::size_t i = 0; i < m_; ++i) rest[i] -= product_.data()[i];
}

LeastSquaresResult LeastSquaresSolver::factor(Numbers J, Numbers metric, int rows) {
  const char* name = "LeastSquaresSolver::factor";
  check_option(name, "rows", rows >= 0, rows, "0 or more");
  m_ = static_cast<std::size_t>(rows), d_ = metric.size();
  check_length(name, "J", J.size(), m_ * d_);
  valid_ = all_finite(J.data(), J.size()) && all_finite(metric.data(), metric.size()) &&
           std::ranges::all_of(metric, [](double x) { return x >= 0.0; });
  if (!valid_) return {.status = SolveStatus::kInvalidInput};
  scale_rows(J, metric);
  motion_.zeros(d_);
  for (AlignedBuffer* vector : {&rest_, &work_, &found_, &product_}) vector->zeros(m_);
  const std::size_t n = std::min(m_, d_);
  const MatrixView S = S_memory_.need(n, n);
  if (m_ <= d_) {
    const MatrixView Bt = Bt_memory_.need(d_, m_);
    transpose(Bt, B_, m_, d_);
    gram(S, Bt, d_, m_);
  } else {
    gram(S, B_, m_, d_);
  }
  small_.factor(S, n, kSolversTuning.least_squares.rank);
  return {.status = SolveStatus::kSolved, .rank = static_cast<int>(small_.rank())};
}

SolveStatus LeastSquaresSolver::solve(Numbers r, std::span<double> f) {
  check_length("LeastSquaresSolver::solve", "r", r.size(), m_);
  check_length("LeastSquaresSolver::solve", "f", f.size(), m_);
  if (!valid_ || !all_finite(r.data(), r.size())) {
    std::ranges::fill(f, 0.0);
    return SolveStatus::kInvalidInput;
  }
  double *rest = rest_.data(), *work = work_.data(), *found = found_.data();
  std::ranges::copy(r, rest);
  std::ranges::copy(r, work);
  apply(work, found);
  // One step of refinement: the factor squares the condition of B, the residual does not.
  std::copy_n(found, m_, f.begin());
  subtract_product(found, rest);
  std::copy_n(rest, m_, work);
  apply(work, found);
  for (std::size_t i = 0; i < m_; ++i) f[i] += found[i];
  return SolveStatus::kSolved;
}

}  // namespace limber
