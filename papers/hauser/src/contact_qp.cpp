#include "limber/hauser/contact_qp.h"

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

/// Active sets.
struct QpTuning {
  /// A row that differs from those of the free forces by a part σ has a pivot of σ², taken as zero below about 1e-14,
  /// and is pulled by at most σ. A larger pull is no rounding.
  double nearly_dependent = 1e-6;
  double residual = 1e-11;              ///< ContactQpResult::residual of what is solved
  double infeasible_compliance = 1e-6;  ///< added to the diagonal, as a part of it, where there is no solution
  double more_compliance = 10.0;        ///< times that, each time that it is not enough
};
constexpr QpTuning kTuning;

using Numbers = std::span<const double>;

constexpr const char* kQpSolver = "ContactQpSolver::solve";

std::size_t count_of(int n) { return static_cast<std::size_t>(n); }

double* copy_padded(AlignedBuffer& memory, Numbers from, std::size_t n) {
  double* to = memory.need(n);
  std::fill_n(to, padded(n), 0.0);
  std::copy_n(from.begin(), from.size(), to);
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

// What the method asks of A, be it given in full or as A = G Gᵀ + diag(D).
class Operator {
 public:
  // Both copy the problem's A; false if one is not fit to be solved with.
  bool take(const ContactQp& problem) {
    m_ = count_of(problem.size);
    check_length(kQpSolver, "A", problem.A.size(), m_ * m_);
    if (!all_finite(problem.A.data(), m_ * m_)) return false;
    A_ = copy_padded(A_memory_, problem.A, m_, m_);
    diagonal_.resize(m_);
    for (std::size_t j = 0; j < m_; ++j) diagonal_[j] = A_.row(j)[j];
    factored_ = false;
    return true;
  }
  bool take(const FactoredContactQp& problem) {
    check_option(kQpSolver, "dimension", problem.dimension >= 0, problem.dimension, "0 or more");
    m_ = count_of(problem.size), d_ = count_of(problem.dimension);
    check_length(kQpSolver, "G", problem.G.size(), m_ * d_);
    check_optional_length(kQpSolver, "D", problem.D.size(), m_);
    if (!all_finite(problem.G.data(), m_ * d_)) return false;
    D_.assign(m_, 0.0);
    std::copy(problem.D.begin(), problem.D.end(), D_.begin());
    if (!std::ranges::all_of(D_, [](double x) { return x >= 0.0 && std::isfinite(x); })) return false;
    A_ = copy_padded(A_memory_, problem.G, m_, d_);
    transposed_ = transposed_memory_.need(d_, m_);
    transpose(transposed_, A_, m_, d_);
    diagonal_.resize(m_);
    for (std::size_t j = 0; j < m_; ++j) diagonal_[j] = dot(A_.row(j), A_.row(j), d_) + D_[j];
    u_ = u_memory_.need(d_);
    factored_ = true;
    return true;
  }

  double diagonal(std::size_t j) const { return diagonal_[j]; }
  // out = A_Pj
  void column(std::size_t j, const std::vector<int>& P, double* out) const {
    const double* row = A_.row(j);  // of A, which is symmetric, or of G
    if (factored_) return multiply_rows(out, A_, P.data(), row, P.size(), d_);
    for (std::size_t i = 0; i < P.size(); ++i) out[i] = row[P[i]];
  }
  // out = b + A f, f given by its nonzeros
  void apply(const double* b, const std::vector<int>& rows, const std::vector<double>& values, double* out) const {
    if (!factored_) return combine_rows(out, b, A_, rows.data(), values.data(), rows.size(), m_);
    combine_rows(u_, nullptr, A_, rows.data(), values.data(), rows.size(), d_);
    combine_rows(out, b, transposed_, nullptr, u_, d_, m_);
    for (std::size_t i = 0; i < rows.size(); ++i) out[rows[i]] += D_[count_of(rows[i])] * values[i];
  }

 private:
  std::size_t m_ = 0, d_ = 0;
  bool factored_ = false;
  MatrixBuffer A_memory_, transposed_memory_;
  MatrixView A_{}, transposed_{};  // A, or G and Gᵀ
  std::vector<double> diagonal_, D_;
  AlignedBuffer u_memory_;
  double* u_ = nullptr;  // Gᵀf
};

// The problem's numbers, copied, and what they are measured by.
struct BoxProblem {
  std::size_t m = 0;
  Operator A;
  AlignedBuffer b_memory;
  double* b = nullptr;
  std::vector<double> lower, upper, scale;  // scale: 1/√A_jj
  double largest_b = 0.0;

  // What both forms of the problem have in common.
  template <class Given>
  void check(const Given& given, Numbers forces) {
    check_option(kQpSolver, "size", given.size >= 0, given.size, "0 or more");
    m = count_of(given.size);
    check_length(kQpSolver, "b", given.b.size(), m);
    check_optional_length(kQpSolver, "lower", given.lower.size(), m);
    check_optional_length(kQpSolver, "upper", given.upper.size(), m);
    check_length(kQpSolver, "f", forces.size(), m);
  }

  // Copies the numbers; false if one is not fit to be solved with.
  template <class Given>
  bool take(const Given& given) {
    if (!A.take(given) || !all_finite(given.b.data(), m)) return false;
    b = copy_padded(b_memory, given.b, m);
    lower.assign(m, 0.0), upper.assign(m, kUnbounded);
    std::ranges::copy(given.lower, lower.begin());
    std::ranges::copy(given.upper, upper.begin());
    for (std::size_t j = 0; j < m; ++j)
      if (!(lower[j] <= upper[j]) || lower[j] == kUnbounded || upper[j] == -kUnbounded) return false;
    set_scales();
    return true;
  }

  // √A_jj f_j and w_j/√A_jj have one unit, √J: what is compared between rows is in it. An empty row borrows the mean.
  void set_scales() {
    double sum = 0.0;
    scale.resize(m);
    largest_b = 0.0;
    for (std::size_t j = 0; j < m; ++j) sum += A.diagonal(j);
    const double mean_diagonal = sum > 0.0 ? sum / static_cast<double>(m) : 1.0;
    for (std::size_t j = 0; j < m; ++j) {
      const double a = A.diagonal(j);
      scale[j] = 1.0 / std::sqrt(a > 0.0 ? a : mean_diagonal);
      largest_b = std::max(largest_b, std::abs(b[j]) * scale[j]);
    }
  }
};

}  // namespace

// A force is free (in the set P, solved for) or held where it is, most often at a bound.
struct ContactQpSolver::Impl {
  enum class State : char { kHeld, kFree, kLeft };

  BoxProblem problem;
  AlignedBuffer w_memory, direction_memory;
  double* w = nullptr;
  double* direction = nullptr;  // of the free forces
  std::vector<double> f;
  std::vector<State> state;
  std::vector<int> P, wanted, nonzero;  // P in the factor's order; nonzero: forces that are not 0, and
  std::vector<double> values;           // these
  FreeSetFactor factor;
  double largest_f = 0.0, added_compliance = 0.0;
  int idle = 0;  // steps of length zero in a row
  ContactQpResult result;

  template <class Given>
  ContactQpResult solve(const Given& given, std::span<double> forces) {
    problem.check(given, forces);
    if (problem.take(given)) return run(forces);
    std::fill(forces.begin(), forces.end(), 0.0);
    return {.status = SolveStatus::kInvalidInput};
  }

  ContactQpResult run(std::span<double> forces) {
    reserve();
    start(forces);
    minimise_over_free();
    while (result.iterations < limit() && release_one()) minimise_over_free();
    finish(forces);
    return result;
  }

  int limit() const { return 100 + 20 * static_cast<int>(problem.m); }

  void reserve() {
    w = w_memory.need(problem.m), direction = direction_memory.need(problem.m + 1);
    f.resize(problem.m), values.reserve(problem.m);
    state.assign(problem.m, State::kHeld);
    for (std::vector<int>* list : {&P, &wanted, &nonzero}) {
      list->clear();
      list->reserve(problem.m);
    }
    added_compliance = 0.0;
    idle = 0;
    result = {};
  }

  void start(Numbers guess) {
    for (std::size_t j = 0; j < problem.m; ++j) {
      f[j] = std::clamp(std::isfinite(guess[j]) ? guess[j] : 0.0, problem.lower[j], problem.upper[j]);
      if (problem.lower[j] < f[j] && f[j] < problem.upper[j]) P.push_back(static_cast<int>(j));
    }
    factor_free();
  }

  // Factors the block of the forces in P; one that depends on those before it is held where it is.
  void factor_free() {
    wanted.swap(P);
    P.clear();
    std::replace(state.begin(), state.end(), State::kFree, State::kHeld);
    factor.reset(problem.m + 1);
    for (const int j : wanted) append(static_cast<std::size_t>(j));
    update_w();
  }

  // Frees force j unless its row depends on those of P; then direction holds R⁻ᵀA_Pj.
  bool append(std::size_t j) {
    problem.A.column(j, P, direction);
    if (!factor.append(direction, problem.A.diagonal(j) + compliance(j))) return false;
    state[j] = State::kFree;
    P.push_back(static_cast<int>(j));
    return true;
  }

  // w = A f + b, with the largest √A_jj f_j beside it.
  void update_w() {
    nonzero.clear(), values.clear();
    largest_f = 0.0;
    for (std::size_t j = 0; j < problem.m; ++j) {
      if (f[j] == 0.0) continue;
      values.push_back(f[j]);
      nonzero.push_back(static_cast<int>(j));
      largest_f = std::max(largest_f, std::abs(f[j]) / problem.scale[j]);
    }
    problem.A.apply(problem.b, nonzero, values, w);
    if (added_compliance > 0.0)
      for (std::size_t j = 0; j < problem.m; ++j) w[j] += compliance(j) * f[j];
  }

  double compliance(std::size_t j) const { return added_compliance / (problem.scale[j] * problem.scale[j]); }
  double largest() const { return std::max(problem.largest_b, largest_f); }
  double tolerated() const { return kTuning.residual * largest(); }

  // By how much (2) is violated at a force that is not free, scaled; the sign is the way it wants to go.
  double pull(std::size_t j) const {
    const double w_j = w[j];
    return (w_j < 0.0 && f[j] < problem.upper[j]) || (w_j > 0.0 && f[j] > problem.lower[j]) ? -w_j * problem.scale[j]
                                                                                            : 0.0;
  }

  // The force to free next: the one pulled hardest; after a run of steps that led nowhere the first (Bland). m if none.
  std::size_t most_pulled() const {
    std::size_t best = problem.m;
    double most = tolerated();
    for (std::size_t j = 0; j < problem.m; ++j) {
      if (state[j] != State::kHeld) continue;
      const double p = std::abs(pull(j));
      if (p <= most) continue;
      best = j;
      most = p;
      if (idle > static_cast<int>(problem.m)) break;
    }
    return best;
  }

  // One force more to solve for. False at the solution.
  bool release_one() {
    const std::size_t j = most_pulled();
    if (j == problem.m) return false;
    ++result.iterations;
    if (!append(j)) slide(j);
    return true;
  }

  // The largest step ≤ `step` that keeps f_j + step·change within its bounds.
  double clip(std::size_t j, double change, double step) const {
    if (change < 0.0) return std::min(step, (problem.lower[j] - f[j]) / change);
    if (change > 0.0) return std::min(step, (problem.upper[j] - f[j]) / change);
    return step;
  }

  // f_j += step·change; whether it arrived at the bound that clips it.
  bool advance(std::size_t j, double change, double step) {
    const bool at_bound = clip(j, change, kUnbounded) <= step;
    f[j] = at_bound ? (change < 0.0 ? problem.lower[j] : problem.upper[j])
                    : std::clamp(f[j] + step * change, problem.lower[j], problem.upper[j]);
    return at_bound;
  }

  void remove_at(std::size_t position) {
    factor.remove(position);
    std::replace(state.begin(), state.end(), State::kLeft, State::kHeld);
    state[static_cast<std::size_t>(P[position])] = State::kHeld;
    P.erase(P.begin() + static_cast<std::ptrdiff_t>(position));
    ++result.iterations;
  }

  // Exact minimisation over the free forces, holding each that meets a bound on the way.
  void minimise_over_free() {
    int refined = 0;  // a whole step leaves only rounding, which the next one removes
    while (!P.empty() && result.iterations <= limit() && refined < 3) {
      const std::size_t k = P.size();
      std::fill(direction + k, direction + padded(k), 0.0);
      double most = 0.0;
      std::size_t first = 0;
      for (std::size_t i = 0; i < k; ++i) {
        const auto j = static_cast<std::size_t>(P[i]);
        direction[i] = -w[j];
        const double size = std::abs(w[j]) * problem.scale[j];
        if (size > 0.01 * tolerated() && most == 0.0) first = i, most = size;
      }
      if (most == 0.0) return;
      std::fill_n(direction, first, 0.0);
      factor.solve(direction, first);
      if (!move_free()) ++refined;
    }
  }

  // Moves the free forces along `direction`; true if one met a bound before the whole step was done.
  bool move_free() {
    double step = 1.0;
    for (std::size_t i = 0; i < P.size(); ++i) step = clip(static_cast<std::size_t>(P[i]), direction[i], step);
    for (std::size_t i = P.size(); i-- > 0;)
      if (advance(static_cast<std::size_t>(P[i]), direction[i], step)) remove_at(i);
    idle = step > 0.0 ? 0 : idle + 1;
    update_w();
    return step < 1.0;
  }

  // Force j depends on the free ones to rounding: A e = 0 along e = (−A_PP⁻¹A_Pj, 1), so the energy falls evenly along
  // e until a bound is met. Where none is, (2) has no solution; or, if the pull is small, the row is not quite
  // dependent and rounding hides what would meet it: then it is left as it is.
  void slide(std::size_t j) {
    const std::size_t k = P.size();
    factor.solve_upper(direction);
    const double way = pull(j) > 0.0 ? 1.0 : -1.0;
    for (std::size_t i = 0; i < k; ++i) direction[i] *= -way;
    double step = clip(j, way, kUnbounded);
    for (std::size_t i = 0; i < k; ++i) step = clip(static_cast<std::size_t>(P[i]), direction[i], step);
    if (step == kUnbounded) {
      if (std::abs(pull(j)) > kTuning.nearly_dependent * largest())
        add_compliance();
      else
        state[j] = State::kLeft;
      return;
    }
    advance(j, way, step);
    for (std::size_t i = k; i-- > 0;)
      if (advance(static_cast<std::size_t>(P[i]), direction[i], step)) remove_at(i);
    idle = step > 0.0 ? 0 : idle + 1;
    update_w();
  }

  void add_compliance() {
    added_compliance = std::max(kTuning.more_compliance * added_compliance, kTuning.infeasible_compliance);
    factor_free();
  }

  // The residual of the problem as it was posed, without the compliance that was added.
  void finish(std::span<double> forces) {
    if (added_compliance > 0.0 || std::ranges::find(state, State::kLeft) != state.end())
      result.status = SolveStatus::kRelaxed;
    added_compliance = 0.0;
    update_w();
    double worst = 0.0;
    for (std::size_t j = 0; j < problem.m; ++j) {
      const double target =
          std::clamp(f[j] - w[j] * problem.scale[j] * problem.scale[j], problem.lower[j], problem.upper[j]);
      worst = std::max(worst, std::abs(f[j] - target) / problem.scale[j]);
      if (result.status == SolveStatus::kRelaxed)
        result.slack = std::max(result.slack, std::abs(pull(j)) / problem.scale[j]);
    }
    result.residual = largest() > 0.0 ? worst / largest() : 0.0;
    result.free = static_cast<int>(P.size());
    if (result.iterations >= limit()) result.status = SolveStatus::kIterationLimit;
    std::ranges::copy(f, forces.begin());
  }
};

ContactQpSolver::ContactQpSolver() : impl_(std::make_unique<Impl>()) {}
ContactQpSolver::~ContactQpSolver() = default;
ContactQpSolver::ContactQpSolver(ContactQpSolver&&) noexcept = default;
ContactQpSolver& ContactQpSolver::operator=(ContactQpSolver&&) noexcept = default;

ContactQpResult ContactQpSolver::solve(const ContactQp& problem, std::span<double> f) {
  return impl_->solve(problem, f);
}
ContactQpResult ContactQpSolver::solve(const FactoredContactQp& problem, std::span<double> f) {
  return impl_->solve(problem, f);
}

}  // namespace limber
