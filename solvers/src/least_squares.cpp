#include "limber/solvers/least_squares.h"

#include <algorithm>
#include <cmath>

#include "argument_checks.h"
#include "dense_kernels.h"
#include "limber/solvers/aligned_buffer.h"
#include "limber/solvers/pivoted_cholesky.h"

namespace limber {
using namespace internal;  // kernels and checks

namespace {

using Numbers = std::span<const double>;

// Pivots below this part of the largest are taken as zero: (singular value ratio)².
constexpr double kRankTolerance = 1e-11;

double* zeros(AlignedBuffer& memory, std::size_t n) {
  double* to = memory.need(n);
  std::fill_n(to, padded(n), 0.0);
  return to;
}

}  // namespace

struct LeastSquaresSolver::Impl {
  std::size_t m = 0, d = 0;
  bool valid = false;
  MatrixBuffer B_memory, Bt_memory, S_memory;
  MatrixView B{};         // J D^½, m × d
  PivotedCholesky small;  // of S = B Bᵀ (m ≤ d) or N = BᵀB
  AlignedBuffer root_memory, rest_memory, force_memory, small_memory;

  void scale_rows(Numbers J, Numbers metric);
  void apply(double* r, double* f);
  void residual(const double* f, double* rest, double* u);
};

void LeastSquaresSolver::Impl::scale_rows(Numbers J, Numbers metric) {
  double* root = root_memory.need(d);
  for (std::size_t j = 0; j < d; ++j) root[j] = std::sqrt(metric[j]);
  B = B_memory.need(m, d);
  for (std::size_t i = 0; i < m; ++i) {
    double* row = B.row(i);
    const double* from = J.data() + i * d;
    for (std::size_t j = 0; j < d; ++j) row[j] = from[j] * root[j];
    std::fill(row + d, row + B.stride, 0.0);
  }
}

// f = (B Bᵀ)⁺ r, without refinement. r is overwritten.
void LeastSquaresSolver::Impl::apply(double* r, double* f) {
  if (m <= d) {
    small.apply_pseudoinverse(r);
    std::copy_n(r, padded(m), f);
    return;
  }
  double* u = small_memory.data();
  combine_rows(u, nullptr, B, nullptr, r, m, d);
  small.apply_pseudoinverse(u);
  small.apply_pseudoinverse(u);
  multiply_rows(f, B, nullptr, u, m, d);
}

// rest −= B Bᵀ f
void LeastSquaresSolver::Impl::residual(const double* f, double* rest, double* u) {
  combine_rows(u, nullptr, B, nullptr, f, m, d);
  double* Su = force_memory.data() + padded(m);
  multiply_rows(Su, B, nullptr, u, m, d);
  for (std::size_t i = 0; i < m; ++i) rest[i] -= Su[i];
}

LeastSquaresSolver::LeastSquaresSolver() : impl_(std::make_unique<Impl>()) {}
LeastSquaresSolver::~LeastSquaresSolver() = default;
LeastSquaresSolver::LeastSquaresSolver(LeastSquaresSolver&&) noexcept = default;
LeastSquaresSolver& LeastSquaresSolver::operator=(LeastSquaresSolver&&) noexcept = default;

LeastSquaresResult LeastSquaresSolver::factor(Numbers J, Numbers metric, int rows) {
  const char* name = "LeastSquaresSolver::factor";
  check_option(name, "rows", rows >= 0, rows, "0 or more");
  Impl& s = *impl_;
  s.m = static_cast<std::size_t>(rows), s.d = metric.size();
  check_length(name, "J", J.size(), s.m * s.d);
  s.valid = all_finite(J.data(), J.size()) && all_finite(metric.data(), metric.size()) &&
            std::all_of(metric.begin(), metric.end(), [](double x) { return x >= 0.0; });
  if (!s.valid) return {.status = SolveStatus::kInvalidInput};
  s.scale_rows(J, metric);
  zeros(s.small_memory, 2 * padded(s.d));
  zeros(s.rest_memory, 2 * padded(s.m)), zeros(s.force_memory, 2 * padded(s.m));
  const std::size_t n = std::min(s.m, s.d);
  const MatrixView S = s.S_memory.need(n, n);
  if (s.m <= s.d) {
    const MatrixView Bt = s.Bt_memory.need(s.d, s.m);
    transpose(Bt, s.B, s.m, s.d);
    gram(S, Bt, s.d, s.m);
  } else {
    gram(S, s.B, s.m, s.d);
  }
  s.small.factor(S, n, kRankTolerance);
  return {.status = SolveStatus::kSolved, .rank = static_cast<int>(s.small.rank())};
}

SolveStatus LeastSquaresSolver::solve(Numbers r, std::span<double> f) {
  Impl& s = *impl_;
  check_length("LeastSquaresSolver::solve", "r", r.size(), s.m);
  check_length("LeastSquaresSolver::solve", "f", f.size(), s.m);
  if (!s.valid || !all_finite(r.data(), r.size())) {
    std::fill(f.begin(), f.end(), 0.0);
    return SolveStatus::kInvalidInput;
  }
  double* rest = s.rest_memory.data();
  double* work = rest + padded(s.m);
  double* found = s.force_memory.data();
  std::copy_n(r.begin(), s.m, rest);
  std::copy_n(rest, s.m, work);
  s.apply(work, found);
  // One step of refinement: the factor squares the condition of B, the residual does not.
  std::copy_n(found, s.m, f.begin());
  s.residual(found, rest, s.small_memory.data() + padded(s.d));
  std::copy_n(rest, s.m, work);
  s.apply(work, found);
  for (std::size_t i = 0; i < s.m; ++i) f[i] += found[i];
  return SolveStatus::kSolved;
}

struct EqualityElimination::Impl {
  std::size_t e = 0, c = 0;
  bool valid = false;
  MatrixBuffer ee_memory, ec_memory, Y_memory, gram_memory;
  MatrixView A_ee{}, A_ec{};  // scaled
  PivotedCholesky factor;
  AlignedBuffer scale_memory, b_memory, x_memory, work_memory, coefficient_memory;

  void take(Numbers A, Numbers b);
  MatrixView solve_rows();
};

// A_ee with rows and columns, A_ec and b_e with rows, scaled to a unit diagonal: joints mix metres and radians, and the
// rank cut compares pivots. Rows that nothing moves are left small.
void EqualityElimination::Impl::take(Numbers A, Numbers b) {
  const std::size_t n = e + c;
  double* scale = zeros(scale_memory, e);
  double largest = 0.0;
  for (std::size_t i = 0; i < e; ++i) largest = std::max(largest, A[i * n + i]);
  constexpr double kLeastMobility = 1e-13;
  for (std::size_t i = 0; i < e; ++i)
    scale[i] = largest > 0.0 ? 1.0 / std::sqrt(std::max(A[i * n + i], kLeastMobility * largest)) : 1.0;
  A_ee = ee_memory.need(e, e);
  A_ec = ec_memory.need(e, c);
  double* b_e = zeros(b_memory, e);
  for (std::size_t i = 0; i < e; ++i) {
    for (std::size_t j = 0; j < e; ++j) A_ee.row(i)[j] = scale[i] * scale[j] * A[i * n + j];
    std::fill(A_ee.row(i) + e, A_ee.row(i) + A_ee.stride, 0.0);
    for (std::size_t j = 0; j < c; ++j) A_ec.row(i)[j] = scale[i] * A[i * n + e + j];
    std::fill(A_ec.row(i) + c, A_ec.row(i) + A_ec.stride, 0.0);
    b_e[i] = scale[i] * b[i];
  }
}

// Y with YᵀY = A_ce A_ee⁺ A_ec, by substitution on the independent rows: Y = L₁₁⁻¹ A_ec.
MatrixView EqualityElimination::Impl::solve_rows() {
  const MatrixView Y = Y_memory.need(e, c);
  double* coefficients = coefficient_memory.need(e);
  const MatrixView L = factor.columns();
  for (std::size_t j = 0; j < factor.rank(); ++j) {
    const std::size_t p = factor.pivot(j);
    for (std::size_t i = 0; i < j; ++i) coefficients[i] = -L.row(i)[p];
    combine_rows(Y.row(j), A_ec.row(p), Y, nullptr, coefficients, j, c);
    for (std::size_t i = 0; i < c; ++i) Y.row(j)[i] /= L.row(j)[p];
  }
  return Y;
}

EqualityElimination::EqualityElimination() : impl_(std::make_unique<Impl>()) {}
EqualityElimination::~EqualityElimination() = default;
EqualityElimination::EqualityElimination(EqualityElimination&&) noexcept = default;
EqualityElimination& EqualityElimination::operator=(EqualityElimination&&) noexcept = default;

LeastSquaresResult EqualityElimination::reduce(Numbers A, Numbers b, int equalities, std::span<double> A_reduced,
                                               std::span<double> b_reduced) {
  const char* name = "EqualityElimination::reduce";
  const std::size_t n = b.size();
  check_option(name, "equalities", equalities >= 0 && static_cast<std::size_t>(equalities) <= n, equalities,
               "0 to the number of rows");
  Impl& s = *impl_;
  s.e = static_cast<std::size_t>(equalities), s.c = n - s.e;
  check_length(name, "A", A.size(), n * n);
  check_length(name, "A_reduced", A_reduced.size(), s.c * s.c);
  check_length(name, "b_reduced", b_reduced.size(), s.c);
  s.valid = all_finite(A.data(), A.size()) && all_finite(b.data(), b.size());
  if (!s.valid) {
    std::fill(A_reduced.begin(), A_reduced.end(), 0.0);
    std::fill(b_reduced.begin(), b_reduced.end(), 0.0);
    return {.status = SolveStatus::kInvalidInput};
  }
  s.take(A, b);
  s.factor.factor(s.A_ee, s.e, kRankTolerance);

  const MatrixView Y = s.solve_rows();
  const MatrixView YtY = s.gram_memory.need(s.c, s.c);
  gram(YtY, Y, s.factor.rank(), s.c);
  for (std::size_t i = 0; i < s.c; ++i)
    for (std::size_t j = 0; j < s.c; ++j) A_reduced[i * s.c + j] = A[(s.e + i) * n + s.e + j] - YtY.row(i)[j];

  double* x = zeros(s.x_memory, s.e);
  std::copy_n(s.b_memory.data(), s.e, x);
  s.factor.apply_pseudoinverse(x);
  for (std::size_t i = 0; i < s.e; ++i) x[i] = -x[i];
  double* reduced = zeros(s.work_memory, std::max(s.c, s.e));
  std::copy_n(b.begin() + static_cast<std::ptrdiff_t>(s.e), s.c, reduced);
  combine_rows(reduced, reduced, s.A_ec, nullptr, x, s.e, s.c);
  std::copy_n(reduced, s.c, b_reduced.begin());
  return {.status = SolveStatus::kSolved, .rank = static_cast<int>(s.factor.rank())};
}

void EqualityElimination::recover(Numbers f_c, std::span<double> f_e) const {
  Impl& s = *impl_;
  check_length("EqualityElimination::recover", "f_c", f_c.size(), s.c);
  check_length("EqualityElimination::recover", "f_e", f_e.size(), s.e);
  if (!s.valid) return std::fill(f_e.begin(), f_e.end(), 0.0);
  double* f = zeros(s.work_memory, std::max(s.c, s.e));
  std::copy_n(f_c.begin(), s.c, f);
  double* x = zeros(s.x_memory, s.e);
  multiply_rows(x, s.A_ec, nullptr, f, s.e, s.c);
  for (std::size_t i = 0; i < s.e; ++i) x[i] += s.b_memory.data()[i];
  s.factor.apply_pseudoinverse(x);
  for (std::size_t i = 0; i < s.e; ++i) f_e[i] = -s.scale_memory.data()[i] * x[i];
}

}  // namespace limber
