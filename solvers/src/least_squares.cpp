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

double* zeros(AlignedBuffer& memory, std::size_t n) {
  double* to = memory.need(n);
  std::fill_n(to, padded(n), 0.0);
  return to;
}

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
  zeros(motion_, d_);
  for (AlignedBuffer* vector : {&rest_, &work_, &found_, &product_}) zeros(*vector, m_);
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

// A_ee with rows and columns, A_ec and b_e with rows, scaled to a unit diagonal: joints mix metres and radians, and the
// rank cut compares pivots. Rows that nothing moves are left small.
void EqualityElimination::take(Numbers A, Numbers b) {
  const std::size_t n = e_ + c_;
  double largest = 0.0;
  for (std::size_t i = 0; i < e_; ++i) largest = std::max(largest, A[i * n + i]);
  scale_.resize(e_), b_e_.resize(e_);
  for (std::size_t i = 0; i < e_; ++i)
    scale_[i] = largest > 0.0
                    ? 1.0 / std::sqrt(std::max(A[i * n + i], kSolversTuning.least_squares.least_mobility * largest))
                    : 1.0;
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
  factor_.factor(A_ee_, e_, kSolversTuning.least_squares.rank);

  const MatrixView YtY = gram_memory_.need(c_, c_);
  gram(YtY, solve_rows(), factor_.rank(), c_);
  for (std::size_t i = 0; i < c_; ++i)
    for (std::size_t j = 0; j < c_; ++j) A_reduced[i * c_ + j] = A[(e_ + i) * n + e_ + j] - YtY.row(i)[j];

  double *x = zeros(x_, e_), *rest = zeros(rest_, c_);
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
  double *x = zeros(x_, e_), *f = zeros(rest_, c_);
  std::ranges::copy(f_c, f);
  multiply_rows(x, A_ec_, nullptr, f, e_, c_);
  for (std::size_t i = 0; i < e_; ++i) x[i] += b_e_[i];
  factor_.apply_pseudoinverse(x);
  for (std::size_t i = 0; i < e_; ++i) f_e[i] = -scale_[i] * x[i];
}

}  // namespace limber
