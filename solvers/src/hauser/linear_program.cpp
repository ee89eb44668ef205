#include "limber/solvers/hauser/linear_program.h"

#include <algorithm>
#include <cmath>
#include <limits>
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

}  // namespace

// The dual, one row per column j of A:  Σ_i A_ij y_i + s_j = c_j, y, s ≥ 0. Variables are numbered y_i: i, s_j: r + j.
// Row n of the tableau is the objective, d_i = −b_i at the start; while some d > 0 its variable enters. Column r holds
// the values of the basic variables. At the end f_j = −d of s_j and (A f + b)_i = −d of y_i.
struct LinearProgramSolver::Impl {
  std::size_t r = 0, n = 0;
  MatrixBuffer scaled_memory, tableau_memory;
  AlignedBuffer R_memory, C_memory, b_memory, c_memory, weight_memory, f_memory, w_memory, column_memory, values_memory;
  MatrixView A{};  // R A C, with R and C the powers of two that bring the rows, then the columns, to about 1
  double* R = nullptr;
  double* C = nullptr;
  double* b = nullptr;       // R b
  double* c = nullptr;       // C c
  double* weight = nullptr;  // of the nonbasic variables: about the square of what a unit of each moves (Devex)
  MatrixView T{};
  double* column = nullptr;          // the entering column, and
  double* values = nullptr;          // the values beside it
  std::vector<int> basic, nonbasic;  // the variable of each row and column
  std::vector<char> flipped;         // per y: the tableau holds bound − y instead
  double bound = kUnbounded;         // of every y: slack's price; ∞ until the program proves infeasible
  bool has_basis = false;
  std::vector<int> entering, rows;  // of restore_basis() and set_costs()
  std::vector<double> coefficients;
  LinearProgramOptions options;
  LinearProgramResult result;
  int idle = 0;  // pivots in a row that led nowhere

  bool is_y(int variable) const { return static_cast<std::size_t>(variable) < r; }
  bool is_bounded(int variable) const { return bound < kUnbounded && is_y(variable); }
  double& value(std::size_t row) const { return T.row(row)[r]; }
  double* costs() const { return T.row(n); }
  bool bland() const { return idle > 20 + static_cast<int>(r + n); }

  void take(const LinearProgram& program);
  void take_b(Numbers new_b);
  void fill_tableau();
  void start_cold();
  void set_costs();
  bool restore_basis();
  bool clean_values();
  LinearProgramResult run(std::span<double> f);
  void optimise(int limit);
  std::size_t choose_entering() const;
  void gather_column(std::size_t q);
  std::size_t choose_leaving(double largest) const;
  double ratio(std::size_t row, double allowed) const;
  bool lifts_y(std::size_t q, double least) const;
  void pivot(std::size_t p, std::size_t q);
  void flip_column(std::size_t q);
  void flip_row(std::size_t p);
  void price_slack();
  void extract(std::span<double> f) const;
  double violation(Numbers f);
};

void LinearProgramSolver::Impl::take(const LinearProgram& program) {
  r = static_cast<std::size_t>(program.rows), n = static_cast<std::size_t>(program.columns);
  A = scaled_memory.need(r, n);
  for (std::size_t i = 0; i < r; ++i) {
    std::copy_n(program.A.data() + i * n, n, A.row(i));
    std::fill(A.row(i) + n, A.row(i) + A.stride, 0.0);
  }
  R = R_memory.need(r), C = C_memory.need(n);
  equilibrate(A, r, n, R, C);
  c = c_memory.need(n);
  for (std::size_t j = 0; j < n; ++j) c[j] = C[j] * (program.c.empty() ? 1.0 : program.c[j]);
  take_b(program.b);
}

void LinearProgramSolver::Impl::take_b(Numbers new_b) {
  b = b_memory.need(r);
  for (std::size_t i = 0; i < r; ++i) b[i] = R[i] * new_b[i];
}

void LinearProgramSolver::Impl::fill_tableau() {
  T = tableau_memory.need(n + 1, r + 1);
  transpose(T, A, r, n);
  const double price = inverse_power_of_two(n == 0 ? 0.0 : *std::max_element(c, c + n));
  for (std::size_t j = 0; j < n; ++j) value(j) = c[j] * price;
  std::fill_n(costs(), T.stride, 0.0);
  for (std::size_t i = 0; i < r; ++i) costs()[i] = -b[i];
}

void LinearProgramSolver::Impl::start_cold() {
  fill_tableau();
  bound = kUnbounded;
  flipped.assign(r, 0);
  nonbasic.resize(r), basic.resize(n);
  weight = weight_memory.need(r);
  std::fill_n(weight, padded(r), 1.0);
  column = column_memory.need(n), values = values_memory.need(n);
  entering.reserve(n), rows.reserve(n), coefficients.reserve(n);
  for (std::size_t i = 0; i < r; ++i) nonbasic[i] = static_cast<int>(i);
  for (std::size_t j = 0; j < n; ++j) basic[j] = static_cast<int>(r + j);
}

// The objective's row for another b in the basis as it is: d = −b of the nonbasic less what the basic y cost.
void LinearProgramSolver::Impl::set_costs() {
  std::fill_n(costs(), T.stride, 0.0);
  for (std::size_t q = 0; q < r; ++q)
    if (const auto y = static_cast<std::size_t>(nonbasic[q]); y < r) costs()[q] = -b[y];
  rows.clear(), coefficients.clear();
  for (std::size_t p = 0; p < n; ++p)
    if (const auto y = static_cast<std::size_t>(basic[p]); y < r) {
      rows.push_back(static_cast<int>(p));
      coefficients.push_back(b[y]);
    }
  combine_rows(costs(), costs(), T, rows.data(), coefficients.data(), rows.size(), r + 1);
}

// Brings a new tableau to the basis that the old one had. False where that is singular or infeasible now.
bool LinearProgramSolver::Impl::restore_basis() {
  entering.clear();
  for (const int variable : basic)
    if (is_y(variable)) entering.push_back(variable);
  rows.assign(n, 0);  // 1: the slack of this row is to leave
  for (const int variable : nonbasic)
    if (!is_y(variable)) rows[static_cast<std::size_t>(variable) - r] = 1;
  start_cold();
  for (const int y : entering) {
    const auto q = static_cast<std::size_t>(y);
    std::size_t best = n;
    double largest = 1e-9;  // entries are about 1: less is a basis close to singular
    for (std::size_t p = 0; p < n; ++p)
      if (rows[p] && std::abs(T.row(p)[q]) > largest) best = p, largest = std::abs(T.row(p)[q]);
    if (best == n) return false;
    rows[best] = 0;
    pivot(best, q);
  }
  return clean_values();
}

// Sets what rounding left below zero, or above the bound, on it; false if something is further off.
bool LinearProgramSolver::Impl::clean_values() {
  constexpr double kRounding = 1e-9;
  for (std::size_t p = 0; p < n; ++p) {
    if (value(p) < -kRounding) return false;
    value(p) = std::max(value(p), 0.0);
    if (is_bounded(basic[p])) value(p) = std::min(value(p), bound);
  }
  return true;
}

// The variable to enter: of the steepest descent, or the first one (Bland). r if the basis is optimal.
std::size_t LinearProgramSolver::Impl::choose_entering() const {
  const double* d = costs();
  double scale = 0.0;
  for (std::size_t q = 0; q < r; ++q) scale = std::max(scale, std::abs(d[q]));
  const double least = kCostTolerance * scale;
  if (!bland()) return steepest(d, weight, least, r);
  std::size_t best = r;
  for (std::size_t q = 0; q < r; ++q)
    if (d[q] > least && (best == r || nonbasic[q] < nonbasic[best])) best = q;
  return best;
}

// The entering column and the values beside each other: the ratio test passes over them three times.
void LinearProgramSolver::Impl::gather_column(std::size_t q) {
  for (std::size_t p = 0; p < n; ++p) column[p] = T.row(p)[q], values[p] = value(p);
}

// How far the entering variable can go until the basic one of a row meets zero, or its bound; ∞ if it never does.
double LinearProgramSolver::Impl::ratio(std::size_t row, double allowed) const {
  if (column[row] > 0.0) return (values[row] + allowed) / column[row];
  if (column[row] < 0.0 && is_bounded(basic[row])) return (bound - values[row] + allowed * bound) / -column[row];
  return kUnbounded;
}

// The row to leave. Two passes: the shortest step with every value allowed a little below zero, then the largest entry
// among the rows that meet it. n if nothing stops the entering variable.
std::size_t LinearProgramSolver::Impl::choose_leaving(double largest) const {
  const double least = kPivotTolerance * largest;
  const bool first_index = bland();
  double shortest = kUnbounded;
  for (std::size_t p = 0; p < n; ++p)
    if (std::abs(column[p]) > least) shortest = std::min(shortest, ratio(p, first_index ? 0.0 : kRatioTolerance));
  if (shortest == kUnbounded) return n;
  std::size_t best = n;
  for (std::size_t p = 0; p < n; ++p) {
    if (std::abs(column[p]) <= least || ratio(p, 0.0) > shortest) continue;
    const bool better =
        best == n || (first_index ? basic[p] < basic[best] : std::abs(column[p]) > std::abs(column[best]));
    if (better) best = p;
  }
  return best;
}

// Whether some y grows with the variable of column q.
bool LinearProgramSolver::Impl::lifts_y(std::size_t q, double least) const {
  if (is_y(nonbasic[q])) return true;
  for (std::size_t p = 0; p < n; ++p)
    if (is_y(basic[p]) && column[p] < -least) return true;
  return false;
}

void LinearProgramSolver::Impl::pivot(std::size_t p, std::size_t q) {
  const double entering_weight = weight[q], entry = T.row(p)[q];
  exchange(T, n + 1, p, q);
  for (std::size_t j = 0; j < r; ++j)  // row p is over the pivot already
    weight[j] = std::max(weight[j], T.row(p)[j] * T.row(p)[j] * entering_weight);
  weight[q] = std::max(entering_weight / (entry * entry), 1.0);
  std::swap(basic[p], nonbasic[q]);
}

// Writes bound − y for the nonbasic y of column q: the tableau then has it at zero again.
void LinearProgramSolver::Impl::flip_column(std::size_t q) {
  for (std::size_t p = 0; p <= n; ++p) {
    double* row = T.row(p);
    row[r] -= row[q] * bound;
    row[q] = -row[q];
  }
  flipped[static_cast<std::size_t>(nonbasic[q])] ^= 1;
}

// The same for the basic y of row p.
void LinearProgramSolver::Impl::flip_row(std::size_t p) {
  double* row = T.row(p);
  for (std::size_t q = 0; q < r; ++q) row[q] = -row[q];
  row[r] = bound - row[r];
  flipped[static_cast<std::size_t>(basic[p])] ^= 1;
}

// The dual is unbounded, so no f satisfies the rows. A price on their slack bounds y; all its values now are below.
void LinearProgramSolver::Impl::price_slack() {
  double largest = 0.0;
  for (std::size_t p = 0; p < n; ++p) largest = std::max(largest, value(p));
  bound = std::max(options.slack_price, 2.0 * largest);
}

void LinearProgramSolver::Impl::optimise(int limit) {
  for (std::size_t q; (q = choose_entering()) < r;) {
    if (result.pivots >= limit) {
      result.status = SolveStatus::kIterationLimit;
      return;
    }
    gather_column(q);
    double largest = 0.0;
    for (std::size_t p = 0; p < n; ++p) largest = std::max(largest, std::abs(column[p]));
    const std::size_t p = choose_leaving(largest);
    const double step = p == n ? kUnbounded : std::max(0.0, ratio(p, 0.0));
    if (p == n && !is_bounded(nonbasic[q])) {
      if (bound == kUnbounded && lifts_y(q, kPivotTolerance * largest))
        price_slack();
      else
        costs()[q] = 0.0;  // only slacks would grow, which cost nothing: rounding
      continue;
    }
    ++result.pivots;
    idle = step > kRatioTolerance ? 0 : idle + 1;
    if (is_bounded(nonbasic[q]) && bound <= step) {
      flip_column(q);
      continue;
    }
    if (column[p] < 0.0) flip_row(p);  // it leaves at its bound
    pivot(p, q);
    for (std::size_t row = 0; row < n; ++row) value(row) = std::max(value(row), 0.0);
  }
}

void LinearProgramSolver::Impl::extract(std::span<double> f) const {
  std::fill(f.begin(), f.end(), 0.0);
  for (std::size_t q = 0; q < r; ++q)
    if (!is_y(nonbasic[q])) {
      const std::size_t j = static_cast<std::size_t>(nonbasic[q]) - r;
      f[j] = C[j] * std::max(0.0, -costs()[q]);
    }
}

// How far the rows are violated, relative to their terms; and in the result in their own unit.
double LinearProgramSolver::Impl::violation(Numbers f) {
  double* scaled = f_memory.need(n);
  for (std::size_t j = 0; j < n; ++j) scaled[j] = f[j] / C[j];
  std::fill(scaled + n, scaled + padded(n), 0.0);
  double* w = w_memory.need(r);
  multiply_rows(w, A, nullptr, scaled, r, n);
  double worst = 0.0;
  result.slack = 0.0;
  for (std::size_t i = 0; i < r; ++i) {
    w[i] += b[i];
    if (w[i] >= 0.0) continue;
    double size = std::abs(b[i]);
    for (std::size_t j = 0; j < n; ++j) size += std::abs(A.row(i)[j]) * scaled[j];
    worst = std::max(worst, -w[i] / size);
    result.slack = std::max(result.slack, -w[i] / R[i]);
  }
  return worst;
}

LinearProgramResult LinearProgramSolver::Impl::run(std::span<double> f) {
  const int limit = options.max_pivots > 0 ? options.max_pivots : 100 + 20 * static_cast<int>(r + n);
  result = {};
  idle = 0;
  has_basis = true;
  double violated = 0.0;
  for (;;) {
    optimise(limit);
    extract(f);
    violated = violation(f);
    const bool infeasible = bound < kUnbounded;
    if (violated <= options.tolerance || infeasible || result.status == SolveStatus::kIterationLimit ||
        result.refactorizations == kMaxRefactorizations)
      break;
    ++result.refactorizations;  // digits were lost: the same basis from the numbers as given
    if (!restore_basis()) start_cold();
  }
  if (violated > options.tolerance && result.status == SolveStatus::kSolved) result.status = SolveStatus::kRelaxed;
  for (std::size_t j = 0; j < n; ++j) result.objective += c[j] / C[j] * f[j];
  return result;
}

namespace {

constexpr const char* kName = "LinearProgramSolver";

void check(const LinearProgramOptions& options) {
  check_option(kName, "tolerance", options.tolerance > 0.0, options.tolerance, "> 0");
  check_option(kName, "slack_price", options.slack_price > 0.0, options.slack_price, "> 0");
  check_option(kName, "max_pivots", options.max_pivots >= 0, options.max_pivots, "0 or more");
}

void check(const LinearProgram& program, Numbers f, const LinearProgramOptions& options) {
  check_option(kName, "rows", program.rows >= 0, program.rows, "0 or more");
  check_option(kName, "columns", program.columns >= 0, program.columns, "0 or more");
  const auto r = static_cast<std::size_t>(program.rows), n = static_cast<std::size_t>(program.columns);
  check_length(kName, "A", program.A.size(), r * n);
  check_length(kName, "b", program.b.size(), r);
  check_optional_length(kName, "c", program.c.size(), n);
  check_length(kName, "f", f.size(), n);
  check(options);
}

bool fit_to_solve(const LinearProgram& program) {
  return all_finite(program.A.data(), program.A.size()) && all_finite(program.b.data(), program.b.size()) &&
         std::all_of(program.c.begin(), program.c.end(), [](double x) { return x >= 0.0 && x < kUnbounded; });
}

LinearProgramResult refuse_program(std::span<double> f) {
  std::fill(f.begin(), f.end(), 0.0);
  return {.status = SolveStatus::kInvalidInput};
}

}  // namespace

LinearProgramSolver::LinearProgramSolver() : impl_(std::make_unique<Impl>()) {}
LinearProgramSolver::~LinearProgramSolver() = default;
LinearProgramSolver::LinearProgramSolver(LinearProgramSolver&&) noexcept = default;
LinearProgramSolver& LinearProgramSolver::operator=(LinearProgramSolver&&) noexcept = default;

LinearProgramResult LinearProgramSolver::solve(const LinearProgram& program, std::span<double> f,
                                               const LinearProgramOptions& options) {
  check(program, f, options);
  impl_->has_basis = false;
  if (!fit_to_solve(program)) return refuse_program(f);
  impl_->options = options;
  impl_->take(program);
  impl_->start_cold();
  return impl_->run(f);
}

LinearProgramResult LinearProgramSolver::solve_warm(const LinearProgram& program, std::span<double> f,
                                                    const LinearProgramOptions& options) {
  check(program, f, options);
  const bool same_shape = impl_->r == program.b.size() && impl_->n == f.size();
  if (!impl_->has_basis || !same_shape || impl_->bound < kUnbounded || !fit_to_solve(program))
    return solve(program, f, options);
  impl_->options = options;
  impl_->take(program);
  if (!impl_->restore_basis()) impl_->start_cold();
  return impl_->run(f);
}

LinearProgramResult LinearProgramSolver::solve_again(Numbers b, std::span<double> f,
                                                     const LinearProgramOptions& options) {
  if (!impl_->has_basis)
    throw InvalidArgument("LinearProgramSolver::solve_again: no program was solved before, expected solve() first");
  check_length(kName, "b", b.size(), impl_->r);
  check_length(kName, "f", f.size(), impl_->n);
  check(options);
  if (!all_finite(b.data(), b.size())) return refuse_program(f);
  impl_->options = options;
  impl_->take_b(b);
  if (impl_->bound < kUnbounded)
    impl_->start_cold();
  else
    impl_->set_costs();
  return impl_->run(f);
}

}  // namespace limber
