#include "limber/hauser/contact_program.h"

#include <algorithm>
#include <cmath>

#include "limber/core/types.h"

namespace limber {
namespace {

/// (A f + b)_i.
double gap_of(const ContactProblem& problem, std::span<const double> f, std::size_t i) {
  const std::size_t n = f.size();
  double sum = problem.b[i];
  for (std::size_t j = 0; j < n; ++j) sum += problem.A[i * n + j] * f[j];
  return sum;
}

}  // namespace

void ProgramReport::add(const ProgramReport& other) {
  guard.solves += other.guard.solves;
  guard.clamped += other.guard.clamped;
  guard.complementary += other.guard.complementary;
  guard.blend_sum += other.guard.blend_sum;
  guard.energy_refused += other.guard.energy_refused;
  different += other.different;
  relaxed += other.relaxed;
}

SolveStatus ContactProgramSolver::solve(const ContactProblem& problem, const ContactProgramRule& rule,
                                        std::span<double> f, ProgramReport& report) {
  constexpr int kRounds = 20;
  constexpr double kSettled = 1e-12;  // of the largest impulse
  choose_rows(problem);
  const std::size_t cone_rows = 3 * static_cast<std::size_t>(problem.cones);
  SolveStatus status = SolveStatus::kSolved;
  for (int round = 0; round < kRounds; ++round) {
    last_.assign(f.begin(), f.end());
    for (std::size_t i = 0; i < cone_rows; ++i)
      if (i % 3 != 0) f[i] = 0.0;
    report = {};
    status = solve_normals(problem, rule, f, report);
    add_friction(problem, f);
    if (rest_.empty()) break;
    solve_rest(problem, f);
    double change = 0.0, largest = 0.0;
    for (std::size_t i = 0; i < f.size(); ++i) {
      change = std::max(change, std::abs(f[i] - last_[i]));
      largest = std::max(largest, std::abs(f[i]));
    }
    if (change <= kSettled * largest) break;
  }
  if (rule.stops_slip && problem.cones > 0) return stop_slip(problem, f);
  return status;
}

void ContactProgramSolver::choose_rows(const ContactProblem& problem) {
  const std::size_t cone_rows = 3 * static_cast<std::size_t>(problem.cones);
  one_sided_.clear(), rest_.clear();
  for (std::size_t i = 0; i < problem.b.size(); ++i) {
    const bool one_sided = i < cone_rows ? i % 3 == 0 : problem.lower[i] == 0.0 && problem.upper[i] == kUnbounded;
    if (one_sided) one_sided_.push_back(i);
    if (!one_sided && i >= cone_rows) rest_.push_back(i);
  }
}

/// A and b of some rows, all others at their f.
void ContactProgramSolver::take_part(const ContactProblem& problem, std::span<const std::size_t> part,
                                     std::span<const double> f) {
  const std::size_t m = part.size(), n = f.size();
  A_.resize(m * m), b_.resize(m);
  for (std::size_t i = 0; i < m; ++i) {
    b_[i] = gap_of(problem, f, part[i]);
    for (std::size_t j = 0; j < m; ++j) {
      A_[i * m + j] = problem.A[part[i] * n + part[j]];
      b_[i] -= A_[i * m + j] * f[part[j]];
    }
  }
}

SolveStatus ContactProgramSolver::solve_normals(const ContactProblem& problem, const ContactProgramRule& rule,
                                                std::span<double> f, ProgramReport& report) {
  const std::size_t m = one_sided_.size();
  take_part(problem, one_sided_, f);
  f_complementary_.resize(m), f_program_.resize(m);
  for (std::size_t i = 0; i < m; ++i) f_complementary_[i] = std::max(0.0, f[one_sided_[i]]);
  SolveStatus status = qp_.solve(ContactQp{.size = static_cast<int>(m), .A = A_, .b = b_}, f_complementary_).status;
  if (rule.least_sum) {
    const int size = static_cast<int>(m);
    const LinearProgramResult result = program_.solve({.rows = size, .columns = size, .A = A_, .b = b_}, f_program_);
    status = result.status;
    report.relaxed = status == SolveStatus::kRelaxed ? 1 : 0;
    if (status == SolveStatus::kIterationLimit || status == SolveStatus::kInvalidInput) f_program_ = f_complementary_;
    guard(problem, rule, report);
    // A relaxed program has an answer, the one of least slack.
    if (status == SolveStatus::kRelaxed) status = SolveStatus::kSolved;
  } else {
    f_program_ = f_complementary_;
  }
  for (std::size_t i = 0; i < m; ++i) f[one_sided_[i]] = f_program_[i];
  return status;
}

void ContactProgramSolver::guard(const ContactProblem& problem, const ContactProgramRule& rule, ProgramReport& report) {
  constexpr double kDifferent = 1e-6;
  const auto presses = [](double f) { return f > 0.0; };
  if (std::ranges::none_of(f_program_, presses) && std::ranges::none_of(f_complementary_, presses)) return;
  product_.resize(f_program_.size());
  gap_.clear();
  if (!problem.gap_before.empty())
    for (const std::size_t row : one_sided_) gap_.push_back(problem.gap_before[row]);
  const EnergyGuardResult result = guard_energy({.A = A_, .b = b_, .gap_before = gap_, .step = problem.step},
                                                f_program_, f_complementary_, product_);
  report.guard.add(result);
  const double size = std::max(std::abs(result.energy_program), std::abs(result.energy_complementary));
  report.different = std::abs(result.energy_program - result.energy_complementary) > kDifferent * size ? 1 : 0;
  if (rule.guard == ProgramGuard::kClamp) f_program_ = product_;
  if (rule.guard == ProgramGuard::kComplementary && result.blend < 1.0) f_program_ = f_complementary_;
}

void ContactProgramSolver::solve_rest(const ContactProblem& problem, std::span<double> f) {
  take_part(problem, rest_, f);
  const std::size_t m = rest_.size();
  lower_.resize(m), upper_.resize(m), product_.resize(m);
  for (std::size_t i = 0; i < m; ++i) {
    lower_[i] = problem.lower[rest_[i]], upper_[i] = problem.upper[rest_[i]];
    product_[i] = std::clamp(f[rest_[i]], lower_[i], upper_[i]);
  }
  qp_.solve(ContactQp{.size = static_cast<int>(m), .A = A_, .b = b_, .lower = lower_, .upper = upper_}, product_);
  for (std::size_t i = 0; i < m; ++i) f[rest_[i]] = product_[i];
}

/// Contact by contact the impulse that takes away its slip, which those before it have changed, at most μ f_n.
void ContactProgramSolver::add_friction(const ContactProblem& problem, std::span<double> f) {
  const std::size_t n = f.size();
  for (std::size_t c = 0; c < static_cast<std::size_t>(problem.cones); ++c) {
    const std::size_t t = 3 * c + 1, u = t + 1;
    const double largest = problem.friction[c] * f[3 * c];
    const double a = problem.A[t * n + t], d = problem.A[u * n + u], o = problem.A[t * n + u];
    const double determinant = a * d - o * o;
    if (!(largest > 0.0) || !(determinant > 1e-12 * a * d)) continue;
    const double slip_t = gap_of(problem, f, t), slip_u = gap_of(problem, f, u);
    f[t] -= (d * slip_t - o * slip_u) / determinant;
    f[u] -= (a * slip_u - o * slip_t) / determinant;
    const double size = std::hypot(f[t], f[u]);
    if (size > largest) f[t] *= largest / size, f[u] *= largest / size;
  }
}

/// Normals and tangents that did not slide, all together; the other tangents stay.
SolveStatus ContactProgramSolver::stop_slip(const ContactProblem& problem, std::span<double> f) {
  constexpr double kBelow = 1.0 - 1e-9;
  lower_.assign(problem.lower.begin(), problem.lower.end());
  upper_.assign(problem.upper.begin(), problem.upper.end());
  for (std::size_t c = 0; c < static_cast<std::size_t>(problem.cones); ++c) {
    const std::size_t i = 3 * c;
    const bool sticks = f[i] > 0.0 && std::hypot(f[i + 1], f[i + 2]) < kBelow * problem.friction[c] * f[i];
    lower_[i] = 0.0, upper_[i] = kUnbounded;
    for (std::size_t t = i + 1; t < i + 3; ++t) {
      lower_[t] = sticks ? -kUnbounded : f[t];
      upper_[t] = sticks ? kUnbounded : f[t];
    }
  }
  return qp_
      .solve(
          ContactQp{
              .size = static_cast<int>(f.size()), .A = problem.A, .b = problem.b, .lower = lower_, .upper = upper_},
          f)
      .status;
}

}  // namespace limber
