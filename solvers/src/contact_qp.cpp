#include "limber/solvers/contact_qp.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "argument_checks.h"
#include "dense_kernels.h"
#include "free_set_factor.h"
#include "limber/core/types.h"
#include "limber/solvers/aligned_buffer.h"

namespace limber {
using namespace internal;  // kernels and checks

namespace {

using Numbers = std::span<const double>;

// A row that differs from those of the free forces by a part σ has a pivot of σ², taken as zero below about 1e-14, and
// is pulled by at most σ. A larger pull is no rounding.
constexpr double kNearlyDependent = 1e-6;

std::size_t count_of(int n) { return static_cast<std::size_t>(n); }

double* copy_padded(AlignedBuffer& memory, Numbers from, std::size_t n, double otherwise = 0.0) {
  double* to = memory.need(n);
  std::fill_n(to, padded(n), 0.0);
  if (from.empty())
    std::fill_n(to, n, otherwise);
  else
    std::copy_n(from.begin(), n, to);
  return to;
}

MatrixView copy_padded(MatrixBuffer& memory, Numbers from, std::size_t rows, std::size_t columns) {
  const MatrixView to = memory.need(rows, columns);
  for (std::size_t i = 0; i < rows; ++i) {
    std::copy_n(from.data() + i * columns, columns, to.row(i));
    std::fill(to.row(i) + columns, to.row(i) + to.stride, 0.0);
  }
  return to;
}

// What the method asks of A, for A in full …
struct DenseOperator {
  MatrixView A;
  double diagonal(std::size_t j) const { return A.row(j)[j]; }
  // out = A_Pj
  void column(std::size_t j, const std::vector<int>& P, double* out) const {
    const double* row = A.row(j);  // A is symmetric
    for (std::size_t i = 0; i < P.size(); ++i) out[i] = row[P[i]];
  }
  // out = b + A f, f given by its nonzeros
  void apply(const double* b, const std::vector<int>& rows, const double* values, std::size_t m, double* out) const {
    combine_rows(out, b, A, rows.data(), values, rows.size(), m);
  }
};

// … and for A = G Gᵀ + diag(D).
struct FactoredOperator {
  MatrixView G, G_transposed;
  const double* D;
  const double* diagonal_of_A;
  double* u;           // Gᵀf
  const double* zero;  // d zeros
  std::size_t d;

  double diagonal(std::size_t j) const { return diagonal_of_A[j]; }
  void column(std::size_t j, const std::vector<int>& P, double* out) const {
    multiply_rows(out, G, P.data(), G.row(j), P.size(), d);
  }
  void apply(const double* b, const std::vector<int>& rows, const double* values, std::size_t m, double* out) const {
    combine_rows(u, zero, G, rows.data(), values, rows.size(), d);
    combine_rows(out, b, G_transposed, nullptr, u, d, m);
    for (std::size_t i = 0; i < rows.size(); ++i) out[rows[i]] += D[rows[i]] * values[i];
  }
};

struct Memory {
  MatrixBuffer A, G, G_transposed;
  AlignedBuffer b, lower, upper, D, diagonal, u, zero;
  AlignedBuffer f, w, scale, step, values;
  std::vector<int> free, wanted, nonzero;
  std::vector<char> is_free, is_left;
  FreeSetFactor factor;
};

// The problem's numbers, copied with padding.
struct Problem {
  std::size_t m;
  const double* b;
  const double* lower;
  const double* upper;
  ContactQpOptions options;
};

// One solve. A force is free (in the set P, solved for) or held where it is, most often at a bound.
template <class Operator>
class ActiveSet {
 public:
  ActiveSet(const Operator& A, const Problem& problem, Memory& memory)
      : A_(A), problem_(problem), m_(problem.m), memory_(memory), P_(memory.free) {}

  ContactQpResult run(std::span<double> f) {
    reserve();
    set_scales();
    start(f);
    const ContactQpOptions& options = problem_.options;
    limit_ = options.max_iterations > 0 ? options.max_iterations : 100 + 20 * static_cast<int>(m_);
    minimise_over_free();
    while (result_.iterations < limit_ && release_one()) minimise_over_free();
    finish(f);
    return result_;
  }

 private:
  void reserve() {
    f_ = memory_.f.need(m_);
    w_ = memory_.w.need(m_);
    scale_ = memory_.scale.need(m_);
    step_ = memory_.step.need(m_ + 1);
    values_ = memory_.values.need(m_);
    memory_.is_free.assign(m_, 0);
    memory_.is_left.assign(m_, 0);
    for (std::vector<int>* list : {&memory_.free, &memory_.wanted, &memory_.nonzero}) {
      list->clear();
      list->reserve(m_);
    }
  }

  // √A_jj f_j and w_j/√A_jj have one unit, √J: what is compared between rows is in it. An empty row borrows the mean.
  void set_scales() {
    double sum = 0.0;
    for (std::size_t j = 0; j < m_; ++j) sum += A_.diagonal(j);
    mean_diagonal_ = sum > 0.0 ? sum / static_cast<double>(m_) : 1.0;
    for (std::size_t j = 0; j < m_; ++j) {
      const double a = A_.diagonal(j);
      scale_[j] = 1.0 / std::sqrt(a > 0.0 ? a : mean_diagonal_);
      largest_b_ = std::max(largest_b_, std::abs(problem_.b[j]) * scale_[j]);
    }
  }

  void start(Numbers guess) {
    for (std::size_t j = 0; j < m_; ++j) {
      f_[j] = std::clamp(std::isfinite(guess[j]) ? guess[j] : 0.0, problem_.lower[j], problem_.upper[j]);
      if (problem_.lower[j] < f_[j] && f_[j] < problem_.upper[j]) P_.push_back(static_cast<int>(j));
    }
    factor_free();
  }

  // Factors the block of the forces in P; one that depends on those before it is held where it is.
  void factor_free() {
    memory_.wanted.swap(P_);
    P_.clear();
    std::fill(memory_.is_free.begin(), memory_.is_free.end(), 0);
    memory_.factor.reset(m_ + 1);
    for (const int j : memory_.wanted) append(static_cast<std::size_t>(j));
    update_w();
  }

  // Frees force j unless its row depends on those of P; then step_ holds R⁻ᵀA_Pj.
  bool append(std::size_t j) {
    A_.column(j, P_, step_);
    if (!memory_.factor.append(step_, A_.diagonal(j) + compliance(j))) return false;
    memory_.is_free[j] = 1;
    P_.push_back(static_cast<int>(j));
    return true;
  }

  // w = A f + b, with the largest √A_jj f_j beside it.
  void update_w() {
    memory_.nonzero.clear();
    largest_f_ = 0.0;
    for (std::size_t j = 0; j < m_; ++j) {
      if (f_[j] == 0.0) continue;
      values_[memory_.nonzero.size()] = f_[j];
      memory_.nonzero.push_back(static_cast<int>(j));
      largest_f_ = std::max(largest_f_, std::abs(f_[j]) / scale_[j]);
    }
    A_.apply(problem_.b, memory_.nonzero, values_, m_, w_);
    if (added_compliance_ > 0.0)
      for (std::size_t j = 0; j < m_; ++j) w_[j] += compliance(j) * f_[j];
  }

  double compliance(std::size_t j) const { return added_compliance_ / (scale_[j] * scale_[j]); }
  double largest() const { return std::max(largest_b_, largest_f_); }
  double tolerated() const { return problem_.options.tolerance * largest(); }

  // By how much (2) is violated at a force that is not free, scaled; the sign is the way it wants to go.
  double pull(std::size_t j) const {
    const double w = w_[j];
    return (w < 0.0 && f_[j] < problem_.upper[j]) || (w > 0.0 && f_[j] > problem_.lower[j]) ? -w * scale_[j] : 0.0;
  }

  // The force to free next: the one pulled hardest; after a run of steps that led nowhere the first (Bland). m if none.
  std::size_t most_pulled() const {
    std::size_t best = m_;
    double most = tolerated();
    for (std::size_t j = 0; j < m_; ++j) {
      if (memory_.is_free[j] || memory_.is_left[j]) continue;
      const double p = std::abs(pull(j));
      if (p <= most) continue;
      best = j;
      most = p;
      if (idle_ > static_cast<int>(m_)) break;
    }
    return best;
  }

  // One force more to solve for. False at the solution.
  bool release_one() {
    const std::size_t j = most_pulled();
    if (j == m_) return false;
    ++result_.iterations;
    if (!append(j)) slide(j);
    return true;
  }

  // The largest step ≤ `step` that keeps f_j + step·change within its bounds.
  double clip(std::size_t j, double change, double step) const {
    if (change < 0.0) return std::min(step, (problem_.lower[j] - f_[j]) / change);
    if (change > 0.0) return std::min(step, (problem_.upper[j] - f_[j]) / change);
    return step;
  }

  // f_j += step·change; whether it arrived at the bound that clips it.
  bool advance(std::size_t j, double change, double step) {
    const bool at_bound = clip(j, change, kUnbounded) <= step;
    f_[j] = at_bound ? (change < 0.0 ? problem_.lower[j] : problem_.upper[j])
                     : std::clamp(f_[j] + step * change, problem_.lower[j], problem_.upper[j]);
    return at_bound;
  }

  void remove_at(std::size_t position) {
    memory_.factor.remove(position);
    std::fill(memory_.is_left.begin(), memory_.is_left.end(), 0);
    memory_.is_free[static_cast<std::size_t>(P_[position])] = 0;
    P_.erase(P_.begin() + static_cast<std::ptrdiff_t>(position));
    ++result_.iterations;
  }

  // Exact minimisation over the free forces, holding each that meets a bound on the way.
  void minimise_over_free() {
    int refined = 0;  // a whole step leaves only rounding, which the next one removes
    while (!P_.empty() && result_.iterations <= limit_ && refined < 3) {
      const std::size_t k = P_.size();
      std::fill(step_ + k, step_ + padded(k), 0.0);
      double most = 0.0;
      std::size_t first = 0;
      for (std::size_t i = 0; i < k; ++i) {
        const auto j = static_cast<std::size_t>(P_[i]);
        step_[i] = -w_[j];
        const double size = std::abs(w_[j]) * scale_[j];
        if (size > 0.01 * tolerated() && most == 0.0) first = i, most = size;
      }
      if (most == 0.0) return;
      std::fill_n(step_, first, 0.0);
      memory_.factor.solve(step_, first);
      if (!move_free()) ++refined;
    }
  }

  // Moves the free forces along step_; true if one met a bound before the whole step was done.
  bool move_free() {
    double step = 1.0;
    for (std::size_t i = 0; i < P_.size(); ++i) step = clip(static_cast<std::size_t>(P_[i]), step_[i], step);
    for (std::size_t i = P_.size(); i-- > 0;)
      if (advance(static_cast<std::size_t>(P_[i]), step_[i], step)) remove_at(i);
    idle_ = step > 0.0 ? 0 : idle_ + 1;
    update_w();
    return step < 1.0;
  }

  // Force j depends on the free ones to rounding: A e = 0 along e = (−A_PP⁻¹A_Pj, 1), so the energy falls evenly along
  // e until a bound is met. Where none is, (2) has no solution; or, if the pull is small, the row is not quite
  // dependent and rounding hides what would meet it: then it is left as it is.
  void slide(std::size_t j) {
    const std::size_t k = P_.size();
    memory_.factor.solve_upper(step_);
    const double way = pull(j) > 0.0 ? 1.0 : -1.0;
    for (std::size_t i = 0; i < k; ++i) step_[i] *= -way;
    double step = clip(j, way, kUnbounded);
    for (std::size_t i = 0; i < k; ++i) step = clip(static_cast<std::size_t>(P_[i]), step_[i], step);
    if (step == kUnbounded) {
      if (std::abs(pull(j)) > kNearlyDependent * largest())
        add_compliance();
      else
        memory_.is_left[j] = 1;
      return;
    }
    advance(j, way, step);
    for (std::size_t i = k; i-- > 0;)
      if (advance(static_cast<std::size_t>(P_[i]), step_[i], step)) remove_at(i);
    idle_ = step > 0.0 ? 0 : idle_ + 1;
    update_w();
  }

  void add_compliance() {
    added_compliance_ = std::max(10.0 * added_compliance_, problem_.options.infeasible_compliance);
    factor_free();
  }

  // The residual of the problem as it was posed, without the compliance that was added.
  void finish(std::span<double> f) {
    const bool left = std::find(memory_.is_left.begin(), memory_.is_left.end(), 1) != memory_.is_left.end();
    if (left || added_compliance_ > 0.0) result_.status = SolveStatus::kRelaxed;
    added_compliance_ = 0.0;
    update_w();
    double worst = 0.0;
    for (std::size_t j = 0; j < m_; ++j) {
      const double target = std::clamp(f_[j] - w_[j] * scale_[j] * scale_[j], problem_.lower[j], problem_.upper[j]);
      worst = std::max(worst, std::abs(f_[j] - target) / scale_[j]);
      if (result_.status == SolveStatus::kRelaxed)
        result_.slack = std::max(result_.slack, std::abs(pull(j)) / scale_[j]);
    }
    result_.residual = largest() > 0.0 ? worst / largest() : 0.0;
    result_.free = static_cast<int>(P_.size());
    if (result_.iterations >= limit_) result_.status = SolveStatus::kIterationLimit;
    std::copy_n(f_, m_, f.begin());
  }

  const Operator& A_;
  Problem problem_;
  std::size_t m_;
  Memory& memory_;
  std::vector<int>& P_;  // in the factor's order
  double* f_ = nullptr;
  double* w_ = nullptr;
  double* scale_ = nullptr;
  double* step_ = nullptr;
  double* values_ = nullptr;
  double mean_diagonal_ = 1.0, largest_b_ = 0.0, largest_f_ = 0.0, added_compliance_ = 0.0;
  int limit_ = 0;
  int idle_ = 0;  // steps of length zero in a row
  ContactQpResult result_;
};

// What both forms of the problem have in common.
template <class P>
void check(const P& problem, Numbers f, const ContactQpOptions& options) {
  const char* name = "ContactQpSolver::solve";
  check_option(name, "size", problem.size >= 0, problem.size, "0 or more");
  const std::size_t m = count_of(problem.size);
  check_length(name, "b", problem.b.size(), m);
  check_optional_length(name, "lower", problem.lower.size(), m);
  check_optional_length(name, "upper", problem.upper.size(), m);
  check_length(name, "f", f.size(), m);
  check_option(name, "tolerance", options.tolerance > 0.0, options.tolerance, "> 0");
  check_option(name, "infeasible_compliance", options.infeasible_compliance > 0.0, options.infeasible_compliance,
               "> 0");
  check_option(name, "max_iterations", options.max_iterations >= 0, options.max_iterations, "0 or more");
}

// Copies b and the bounds; false if a number is not fit to be solved with.
template <class P>
bool take(const P& problem, const ContactQpOptions& options, Memory& memory, Problem& taken) {
  const std::size_t m = count_of(problem.size);
  taken = {.m = m,
           .b = copy_padded(memory.b, problem.b, m),
           .lower = copy_padded(memory.lower, problem.lower, m, 0.0),
           .upper = copy_padded(memory.upper, problem.upper, m, kUnbounded),
           .options = options};
  if (!all_finite(taken.b, m)) return false;
  for (std::size_t j = 0; j < m; ++j)
    if (!(taken.lower[j] <= taken.upper[j]) || taken.lower[j] == kUnbounded || taken.upper[j] == -kUnbounded)
      return false;
  return true;
}

ContactQpResult refuse(std::span<double> f) {
  std::fill(f.begin(), f.end(), 0.0);
  return {.status = SolveStatus::kInvalidInput};
}

}  // namespace

struct ContactQpSolver::Impl {
  Memory memory;
};

ContactQpSolver::ContactQpSolver() : impl_(std::make_unique<Impl>()) {}
ContactQpSolver::~ContactQpSolver() = default;
ContactQpSolver::ContactQpSolver(ContactQpSolver&&) noexcept = default;
ContactQpSolver& ContactQpSolver::operator=(ContactQpSolver&&) noexcept = default;

ContactQpResult ContactQpSolver::solve(const ContactQp& problem, std::span<double> f, const ContactQpOptions& options) {
  check(problem, f, options);
  Memory& memory = impl_->memory;
  const std::size_t m = count_of(problem.size);
  check_length("ContactQpSolver::solve", "A", problem.A.size(), m * m);
  Problem taken;
  if (!take(problem, options, memory, taken) || !all_finite(problem.A.data(), m * m)) return refuse(f);
  const DenseOperator A{copy_padded(memory.A, problem.A, m, m)};
  return ActiveSet(A, taken, memory).run(f);
}

ContactQpResult ContactQpSolver::solve(const FactoredContactQp& problem, std::span<double> f,
                                       const ContactQpOptions& options) {
  check(problem, f, options);
  check_option("ContactQpSolver::solve", "dimension", problem.dimension >= 0, problem.dimension, "0 or more");
  Memory& memory = impl_->memory;
  const std::size_t m = count_of(problem.size), d = count_of(problem.dimension);
  check_length("ContactQpSolver::solve", "G", problem.G.size(), m * d);
  check_optional_length("ContactQpSolver::solve", "D", problem.D.size(), m);
  Problem taken;
  if (!take(problem, options, memory, taken) || !all_finite(problem.G.data(), m * d)) return refuse(f);
  double* D = copy_padded(memory.D, problem.D, m);
  if (!std::all_of(D, D + m, [](double x) { return x >= 0.0 && std::isfinite(x); })) return refuse(f);
  const MatrixView G = copy_padded(memory.G, problem.G, m, d);
  const MatrixView G_transposed = memory.G_transposed.need(d, m);
  transpose(G_transposed, G, m, d);
  double* diagonal = memory.diagonal.need(m);
  for (std::size_t j = 0; j < m; ++j) diagonal[j] = dot(G.row(j), G.row(j), d) + D[j];
  const FactoredOperator A{.G = G,
                           .G_transposed = G_transposed,
                           .D = D,
                           .diagonal_of_A = diagonal,
                           .u = copy_padded(memory.u, {}, d),
                           .zero = copy_padded(memory.zero, {}, d),
                           .d = d};
  return ActiveSet(A, taken, memory).run(f);
}

}  // namespace limber
