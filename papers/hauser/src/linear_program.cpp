#include "limber/hauser/linear_program.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "argument_checks.h"
#include "dense_kernels.h"
#include "limber/core/types.h"
#include "limber/solvers/aligned_buffer.h"

namespace limber {
using namespace internal;  // kernels and checks

namespace {

using Numbers = std::span<const double>;

// An entry of the tableau this small beside the largest of its column is taken for rounding, not for a pivot.
constexpr double kPivotTolerance = 1e-11;
// What the ratio test lets the right-hand side, scaled to 1, fall below zero (Harris).
constexpr double kRatioTolerance = 1e-12;
// Reduced costs this small beside the largest are zero.
constexpr double kCostTolerance = 1e-12;
constexpr int kMaxRefactorizations = 3;
// Of A f + b ≥ 0, relative to |b| + |A||f| of the row.
constexpr double kRowTolerance = 1e-10;
// Of slack, in units of the largest c, rows scaled to 1.
constexpr double kSlackPrice = 1e6;

/// Brings the rows, then the columns, of M to entries of about 1: M ← R M C, with powers of two, which round nothing.
void equilibrate(MatrixView M, std::vector<double>& R, std::vector<double>& C) {
  const std::size_t rows = R.size(), n = C.size();
  for (std::size_t i = 0; i < rows; ++i) {
    double most = 0.0;
    for (std::size_t j = 0; j < n; ++j) most = std::max(most, std::abs(M.row(i)[j]));
    R[i] = inverse_power_of_two(most);
    for (std::size_t j = 0; j < n; ++j) C[j] = std::max(C[j], R[i] * std::abs(M.row(i)[j]));
  }
  for (std::size_t j = 0; j < n; ++j) C[j] = inverse_power_of_two(C[j]);
  for (std::size_t i = 0; i < rows; ++i)
    for (std::size_t j = 0; j < n; ++j) M.row(i)[j] *= R[i] * C[j];
}

/// The entry of d to enter next: the largest d_i²/weight_i among d_i > least; n if there is none.
std::size_t steepest(const double* d, const std::vector<double>& weight, double least) {
  const std::size_t n = weight.size();
  std::size_t best = n;
  double square = 0.0, over = 1.0;  // d²/w of the best as a fraction: no division in the loop
  for (std::size_t i = 0; i < n; ++i)
    if (d[i] > least && d[i] * d[i] * over > square * weight[i]) best = i, square = d[i] * d[i], over = weight[i];
  return best;
}

/// R A C with R and C the powers of two that bring rows, then columns, to about 1; b and c scaled alike.
struct ScaledProgram {
  MatrixBuffer memory;
  MatrixView A{};
  std::vector<double> R, C, b, c;

  void take(const LinearProgram& program);
};

void ScaledProgram::take(const LinearProgram& program) {
  const std::size_t r = static_cast<std::size_t>(program.rows), n = static_cast<std::size_t>(program.columns);
  A = memory.need(r, n);
  for (std::size_t i = 0; i < r; ++i) {
    std::copy_n(program.A.data() + i * n, n, A.row(i));
    std::fill(A.row(i) + n, A.row(i) + A.stride, 0.0);
  }
  R.resize(r), C.assign(n, 0.0);
  equilibrate(A, R, C);
  c.resize(n);
  for (std::size_t j = 0; j < n; ++j) c[j] = C[j] * (program.c.empty() ? 1.0 : program.c[j]);
  b.resize(r);
  for (std::size_t i = 0; i < r; ++i) b[i] = R[i] * program.b[i];
}

}  // namespace

// The dual, one row per column j of A:  Σ_i A_ij y_i + s_j = c_j, y, s ≥ 0. Variables are numbered y_i: i, s_j: r + j.
// Row n of the tableau is the objective, d_i = −b_i at the start; while some d > 0 its variable enters. Column r holds
// the values of the basic variables. At the end f_j = −d of s_j and (A f + b)_i = −d of y_i. Slack has columns of its
// own behind those of A, which no program needs that can do without.
struct LinearProgramSolver::Impl {
  std::size_t r = 0, n = 0;
  ScaledProgram scaled;
  MatrixBuffer tableau_memory;
  MatrixView T{};
  std::vector<double> weight;  // of the nonbasic variables: about the square of what a unit of each moves (Devex)
  std::vector<double> column, values;  // the entering column, and the values beside it
  std::vector<int> basic, nonbasic;    // the variable of each row and column
  std::size_t slacks = 0;              // r once the program proves infeasible: columns of A's rows behind the others
  std::vector<int> entering;           // of restore_basis()
  std::vector<char> leaves;            // of the same, by row: its slack is to leave
  LinearProgramResult result;
  int idle = 0;  // pivots in a row that led nowhere

  bool is_y(int variable) const { return static_cast<std::size_t>(variable) < r; }
  std::size_t columns() const { return n + slacks; }
  double& value(std::size_t row) const { return T.row(row)[r]; }
  double* costs() const { return T.row(columns()); }
  bool bland() const { return idle > 20 + static_cast<int>(r + columns()); }

  void start_cold();
  bool restore_basis();
  bool clean_values();
  LinearProgramResult run(std::span<double> f);
  void optimise(int limit);
  std::size_t choose_entering() const;
  void gather_column(std::size_t q);
  std::size_t choose_leaving() const;
  double ratio(std::size_t row, double allowed) const;
  void pivot(std::size_t p, std::size_t q);
  void extract(std::span<double> f) const;
  double violation(Numbers f);
};

void LinearProgramSolver::Impl::start_cold() {
  T = tableau_memory.need(columns() + 1, r + 1);
  transpose(T, scaled.A, r, n);
  for (std::size_t i = 0; i < slacks; ++i) {
    std::fill_n(T.row(n + i), T.stride, 0.0);
    T.row(n + i)[i] = 1.0, value(n + i) = kSlackPrice;
  }
  const double price = inverse_power_of_two(n == 0 ? 0.0 : *std::max_element(scaled.c.begin(), scaled.c.end()));
  for (std::size_t j = 0; j < n; ++j) value(j) = scaled.c[j] * price;
  std::fill_n(costs(), T.stride, 0.0);
  for (std::size_t i = 0; i < r; ++i) costs()[i] = -scaled.b[i];
  nonbasic.resize(r), basic.resize(columns());
  weight.assign(r, 1.0);
  column.resize(columns()), values.resize(columns());
  entering.reserve(columns()), leaves.reserve(columns());
  for (std::size_t i = 0; i < r; ++i) nonbasic[i] = static_cast<int>(i);
  for (std::size_t j = 0; j < columns(); ++j) basic[j] = static_cast<int>(r + j);
}

// Brings a new tableau to the basis that the old one had. False where that is singular or infeasible now.
bool LinearProgramSolver::Impl::restore_basis() {
  entering.clear();
  for (const int variable : basic)
    if (is_y(variable)) entering.push_back(variable);
  leaves.assign(columns(), 0);
  for (const int variable : nonbasic)
    if (!is_y(variable)) leaves[static_cast<std::size_t>(variable) - r] = 1;
  start_cold();
  for (const int y : entering) {
    const auto q = static_cast<std::size_t>(y);
    std::size_t best = columns();
    double largest = 1e-9;  // entries are about 1: less is a basis close to singular
    for (std::size_t p = 0; p < columns(); ++p)
      if (leaves[p] && std::abs(T.row(p)[q]) > largest) best = p, largest = std::abs(T.row(p)[q]);
    if (best == columns()) return false;
    leaves[best] = 0;
    pivot(best, q);
  }
  return clean_values();
}

// Sets what rounding left below zero on it; false if something is further off.
bool LinearProgramSolver::Impl::clean_values() {
  constexpr double kRounding = 1e-9;
  for (std::size_t p = 0; p < columns(); ++p) {
    if (value(p) < -kRounding) return false;
    value(p) = std::max(value(p), 0.0);
  }
  return true;
}

// The variable to enter: of the steepest descent, or the first one (Bland). r if the basis is optimal.
std::size_t LinearProgramSolver::Impl::choose_entering() const {
  const double* d = costs();
  double scale = 0.0;
  for (std::size_t q = 0; q < r; ++q) scale = std::max(scale, std::abs(d[q]));
  const double least = kCostTolerance * scale;
  if (!bland()) return steepest(d, weight, least);
  std::size_t best = r;
  for (std::size_t q = 0; q < r; ++q)
    if (d[q] > least && (best == r || nonbasic[q] < nonbasic[best])) best = q;
  return best;
}

// The entering column and the values beside each other: the ratio test passes over them three times.
void LinearProgramSolver::Impl::gather_column(std::size_t q) {
  for (std::size_t p = 0; p < columns(); ++p) column[p] = T.row(p)[q], values[p] = value(p);
}

// How far the entering variable can go until the basic one of a row meets zero; ∞ if it never does.
double LinearProgramSolver::Impl::ratio(std::size_t row, double allowed) const {
  return column[row] > 0.0 ? (values[row] + allowed) / column[row] : kUnbounded;
}

// The row to leave. Two passes: the shortest step with every value allowed a little below zero, then the largest entry
// among the rows that meet it. columns() if nothing stops the entering variable.
std::size_t LinearProgramSolver::Impl::choose_leaving() const {
  double largest = 0.0;
  for (std::size_t p = 0; p < columns(); ++p) largest = std::max(largest, std::abs(column[p]));
  const double least = kPivotTolerance * largest;
  const bool first_index = bland();
  double shortest = kUnbounded;
  for (std::size_t p = 0; p < columns(); ++p)
    if (std::abs(column[p]) > least) shortest = std::min(shortest, ratio(p, first_index ? 0.0 : kRatioTolerance));
  std::size_t best = columns();
  for (std::size_t p = 0; p < columns() && shortest < kUnbounded; ++p) {
    if (std::abs(column[p]) <= least || ratio(p, 0.0) > shortest) continue;
    const bool better =
        best == columns() || (first_index ? basic[p] < basic[best] : std::abs(column[p]) > std::abs(column[best]));
    if (better) best = p;
  }
  return best;
}

// One exchange of the tableau: T(i, ·) −= T(i, q)·T(p, ·)/T(p, q) for i ≠ p, row p over the pivot, column q over the
// negative pivot, the pivot inverted.
void LinearProgramSolver::Impl::pivot(std::size_t p, std::size_t q) {
  double* pivot_row = T.row(p);
  const double entering_weight = weight[q], entry = pivot_row[q], inverse = 1.0 / entry;
  for (std::size_t j = 0; j < T.stride; ++j) pivot_row[j] *= inverse;
  pivot_row[q] = inverse;
  for (std::size_t i = 0; i <= columns(); ++i) {
    if (i == p || T.row(i)[q] == 0.0) continue;
    const double factor = std::exchange(T.row(i)[q], 0.0);
    add_scaled(T.row(i), -factor, pivot_row, T.stride);
  }
  for (std::size_t j = 0; j < r; ++j)  // row p is over the pivot already
    weight[j] = std::max(weight[j], T.row(p)[j] * T.row(p)[j] * entering_weight);
  weight[q] = std::max(entering_weight / (entry * entry), 1.0);
  std::swap(basic[p], nonbasic[q]);
}

void LinearProgramSolver::Impl::optimise(int limit) {
  for (std::size_t q; (q = choose_entering()) < r;) {
    if (result.pivots >= limit) {
      result.status = SolveStatus::kIterationLimit;
      return;
    }
    gather_column(q);
    const std::size_t p = choose_leaving();
    if (p == columns()) {
      if (slacks > 0) {
        costs()[q] = 0.0;  // what would grow costs nothing: rounding
      } else {
        slacks = r;  // the dual is unbounded, so no f satisfies the rows
        start_cold();
      }
      continue;
    }
    ++result.pivots;
    idle = ratio(p, 0.0) > kRatioTolerance ? 0 : idle + 1;
    pivot(p, q);
    for (std::size_t row = 0; row < columns(); ++row) value(row) = std::max(value(row), 0.0);
  }
}

void LinearProgramSolver::Impl::extract(std::span<double> f) const {
  std::fill(f.begin(), f.end(), 0.0);
  for (std::size_t q = 0; q < r; ++q)
    if (const auto j = static_cast<std::size_t>(nonbasic[q]) - r; !is_y(nonbasic[q]) && j < n)
      f[j] = scaled.C[j] * std::max(0.0, -costs()[q]);
}

// How far the rows are violated, relative to their terms; and in the result in their own unit.
double LinearProgramSolver::Impl::violation(Numbers f) {
  double worst = 0.0;
  result.slack = 0.0;
  for (std::size_t i = 0; i < r; ++i) {
    double w = scaled.b[i], size = std::abs(scaled.b[i]);
    for (std::size_t j = 0; j < n; ++j) {
      const double term = scaled.A.row(i)[j] * f[j] / scaled.C[j];
      w += term, size += std::abs(term);
    }
    if (w >= 0.0) continue;
    worst = std::max(worst, -w / size);
    result.slack = std::max(result.slack, -w / scaled.R[i]);
  }
  return worst;
}

LinearProgramResult LinearProgramSolver::Impl::run(std::span<double> f) {
  const int limit = 100 + 20 * static_cast<int>(r + n);
  result = {};
  idle = 0;
  double violated = 0.0;
  for (;;) {
    optimise(limit);
    extract(f);
    violated = violation(f);
    if (violated <= kRowTolerance || slacks > 0 || result.status == SolveStatus::kIterationLimit ||
        result.refactorizations == kMaxRefactorizations)
      break;
    ++result.refactorizations;  // digits were lost: the same basis from the numbers as given
    if (!restore_basis()) start_cold();
  }
  if (violated > kRowTolerance && result.status == SolveStatus::kSolved) result.status = SolveStatus::kRelaxed;
  for (std::size_t j = 0; j < n; ++j) result.objective += scaled.c[j] / scaled.C[j] * f[j];
  return result;
}

namespace {

constexpr const char* kProgramSolver = "LinearProgramSolver";

void check(const LinearProgram& program, Numbers f) {
  check_option(kProgramSolver, "rows", program.rows >= 0, program.rows, "0 or more");
  check_option(kProgramSolver, "columns", program.columns >= 0, program.columns, "0 or more");
  const auto r = static_cast<std::size_t>(program.rows), n = static_cast<std::size_t>(program.columns);
  check_length(kProgramSolver, "A", program.A.size(), r * n);
  check_length(kProgramSolver, "b", program.b.size(), r);
  check_optional_length(kProgramSolver, "c", program.c.size(), n);
  check_length(kProgramSolver, "f", f.size(), n);
}

bool fit_to_solve(const LinearProgram& program) {
  return all_finite(program.A.data(), program.A.size()) && all_finite(program.b.data(), program.b.size()) &&
         std::all_of(program.c.begin(), program.c.end(), [](double x) { return x >= 0.0 && x < kUnbounded; });
}

}  // namespace

LinearProgramSolver::LinearProgramSolver() : impl_(std::make_unique<Impl>()) {}
LinearProgramSolver::~LinearProgramSolver() = default;
LinearProgramSolver::LinearProgramSolver(LinearProgramSolver&&) noexcept = default;
LinearProgramSolver& LinearProgramSolver::operator=(LinearProgramSolver&&) noexcept = default;

LinearProgramResult LinearProgramSolver::solve(const LinearProgram& program, std::span<double> f) {
  check(program, f);
  if (!fit_to_solve(program)) {
    std::fill(f.begin(), f.end(), 0.0);
    return {.status = SolveStatus::kInvalidInput};
  }
  impl_->r = static_cast<std::size_t>(program.rows), impl_->n = static_cast<std::size_t>(program.columns);
  impl_->scaled.take(program);
  impl_->slacks = 0;
  impl_->start_cold();
  return impl_->run(f);
}

}  // namespace limber
