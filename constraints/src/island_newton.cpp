#include <algorithm>
#include <cmath>
#include <limits>

#include "island_step.h"

namespace limber {
namespace {

Eigen::Map<const Eigen::VectorXd> as_vector(std::span<const double> v) {
  return {v.data(), static_cast<Eigen::Index>(v.size())};
}

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

}  // namespace

SolveStatus IslandSolver::Impl::iterate(const BodyStates& states, std::span<Constraint* const> constraints,
                                        const IslandOptions& options, IslandReport& report) {
  step = options.step;
  if (convex) return solve_convex(states, constraints, options, report);
  bodies.write_position_metric(step, theta, metric);
  sort_rows();
  constexpr int kIterationsUnsettled = 6, kIterationsOfStart = 30;
  factor();
  report.iterations = 1;
  secant.begin(f.size());
  for (;; ++report.iterations) {
    predict(options);
    measure(states, StepTime::kEnd, constraints, gap);
    const SolveStatus status = improve();
    report.change = largest_change();
    if (report.change <= 1.0) {
      share_anew(states, constraints, options);
      return status;
    }
    // Rows that are not solved for give other impulses every time.
    const int most = status == SolveStatus::kIterationLimit ? std::min(kIterationsUnsettled, options.max_iterations)
                                                            : options.max_iterations;
    if (report.iterations > std::min(most, kIterationsOfStart) && can_differentiate())
      return differentiate(states, constraints, options, report);
    if (report.iterations > most) return take_best(states, constraints, options, report);
    for (std::size_t i = 0; i < f.size(); ++i) next_f[i] -= f[i];
    for (Index i = 0; i < rows.size(); ++i) change[static_cast<std::size_t>(i)] /= rows.row(i).law.tolerance;
    secant.advance(f, next_f, change);
    keep_within_bounds();
  }
}

/// Loads that are shared in another way than at the last measuring change no gap but by what each row yields: then the
/// last answer is the one.
void IslandSolver::Impl::share_anew(const BodyStates& states, std::span<Constraint* const> constraints,
                                    const IslandOptions& options) {
  if (flexibility.empty()) return;
  std::ranges::fill(change, 0.0);
  for_flexibilities([&](std::size_t i, std::size_t j, double G) { change[i] += G / step * (next_f[j] - f[j]); });
  if (largest_change() <= 1.0) return;
  std::copy(next_f.begin(), next_f.end(), f.begin());
  predict(options);
  measure(states, StepTime::kEnd, constraints, gap);
}

/// Makes ready what all iterations of a step share: the factor of the rows, or A with the equality rows first.
void IslandSolver::Impl::factor() {
  order_rows();
  if (bounded.empty()) {
    factor_equalities();
    return;
  }
  const std::size_t c = bounded.size();
  b_reduced.resize(c), ordered_b.resize(order.size());
  assemble_ordered();
  A_reduced.resize(c * c);
  for (std::vector<double>* v : {&f_bounded, &lower_bounded, &upper_bounded, &held_impulse}) v->resize(c);
  friction.resize(cones);
  for (std::size_t i = 0; i < cones; ++i) friction[i] = laws[static_cast<std::size_t>(bounded[3 * i])].friction;
}

void IslandSolver::Impl::factor_equalities() {
  const std::size_t m = order.size(), n = metric.size();
  std::size_t soft = 0;
  for (const Index row : order) soft += compliance[static_cast<std::size_t>(row)] > 0.0 ? 1 : 0;
  if (soft == 0) {
    least_squares.factor(J, metric, static_cast<int>(m));
    return;
  }
  // A row's compliance is a degree of freedom of its own.
  const std::size_t width = n + soft;
  wide_J.assign(m * width, 0.0), wide_metric = metric;
  for (std::size_t i = 0; i < m; ++i) {
    const auto at = static_cast<std::size_t>(order[i]);
    std::copy_n(J.begin() + static_cast<std::ptrdiff_t>(at * n), n,
                wide_J.begin() + static_cast<std::ptrdiff_t>(i * width));
    if (compliance[at] == 0.0) continue;
    wide_J[i * width + wide_metric.size()] = 1.0;
    wide_metric.push_back(compliance[at]);
  }
  least_squares.factor(wide_J, wide_metric, static_cast<int>(m));
}

/// A = J D Jᵀ with compliances and flexibilities, in that order.
void IslandSolver::Impl::assemble_ordered() {
  const std::size_t m = order.size(), n = metric.size();
  weigh();
  A.resize(m * m);
  const Eigen::Map<const RowMajor> B(ordered_G.data(), static_cast<Eigen::Index>(m), static_cast<Eigen::Index>(n));
  Eigen::Map<RowMajor>(A.data(), static_cast<Eigen::Index>(m), static_cast<Eigen::Index>(m)).noalias() =
      B * B.transpose();
  for (std::size_t i = 0; i < m; ++i) A[i * m + i] += compliance[static_cast<std::size_t>(order[i])];
  for_flexibilities([&](std::size_t i, std::size_t j, double G) {
    A[static_cast<std::size_t>(place[i]) * m + static_cast<std::size_t>(place[j])] += G / step;
  });
}

/// J D^½ of the rows in their order.
void IslandSolver::Impl::weigh() {
  const std::size_t n = metric.size();
  take_roots();
  ordered_G.resize(order.size() * n);
  double* to = ordered_G.data();
  for (const Index row : order) {
    const double* from = J.data() + static_cast<std::size_t>(row) * n;
    for (std::size_t i = 0; i < n; ++i) *to++ = from[i] * weighted[i];
  }
}

/// What impulses make of the gaps, compliance left out: J D Jᵀ values.
void IslandSolver::Impl::respond(std::span<const double> values, std::vector<double>& gaps) {
  const auto m = static_cast<Eigen::Index>(values.size()), n = static_cast<Eigen::Index>(metric.size());
  const Eigen::Map<const RowMajor> Jacobian(J.data(), m, n);
  Eigen::Map<Eigen::VectorXd> x(weighted.data(), n);
  x.noalias() = Jacobian.transpose() * as_vector(values);
  x.array() *= as_vector(metric).array();
  Eigen::Map<Eigen::VectorXd>(gaps.data(), m).noalias() = Jacobian * x;
}

/// One step of Newton's method from f, to next_f; `change` is what it makes of the gaps.
SolveStatus IslandSolver::Impl::improve() {
  const SolveStatus status = bounded.empty() ? improve_equalities() : improve_all();
  for (std::size_t i = 0; i < f.size(); ++i) b[i] = next_f[i] - f[i];
  respond(b, change);
  return status;
}

/// Rows without bounds: A Δf = −(gap − offset + compliance f), in the least-squares sense.
SolveStatus IslandSolver::Impl::improve_equalities() {
  next_f = f;
  f_equal.resize(order.size());
  if (order.empty()) return SolveStatus::kSolved;
  for (std::size_t i = 0; i < order.size(); ++i) {
    const auto at = static_cast<std::size_t>(order[i]);
    const RowLaw& law = laws[at];
    f_equal[i] = law.offset - gap[at] - law.compliance * (f[at] + step * reaction[at]);
  }
  const SolveStatus status = least_squares.solve(f_equal, f_equal);
  for (std::size_t i = 0; i < order.size(); ++i) next_f[static_cast<std::size_t>(order[i])] += f_equal[i];
  return status;
}

/// Rows with bounds beside the others, which are eliminated first: A f' + b, b = gap − offset − A₀ f.
SolveStatus IslandSolver::Impl::improve_all() {
  respond(f, change);
  for_flexibilities([&](std::size_t i, std::size_t j, double G) { change[i] -= G * reaction[j]; });
  const std::size_t m = order.size(), e = m - bounded.size();
  next_f = f;
  for (std::size_t i = 0; i < m; ++i) {
    const auto at = static_cast<std::size_t>(order[i]);
    const RowLaw& law = laws[at];
    ordered_b[i] = gap[at] - law.offset - change[at] + law.compliance * step * reaction[at];
  }
  elimination.reduce(A, ordered_b, static_cast<int>(e), A_reduced, b_reduced);
  gap_before.clear();
  for (const Index row : bounded)
    gap_before.push_back(start_gap[static_cast<std::size_t>(row)] - laws[static_cast<std::size_t>(row)].offset);
  const SolveStatus status = solve_bounded();
  f_equal.resize(e);
  elimination.recover(f_bounded, f_equal);
  for (std::size_t i = 0; i < m; ++i)
    next_f[static_cast<std::size_t>(order[i])] = i < e ? f_equal[i] : f_bounded[i - e];
  return status;
}

/// Whether contacts are solved for by linear programs or heuristics.
bool IslandSolver::Impl::by_program() const { return rule.method == ContactMethod::kGapProgram || cones > 0; }

/// b − A Δt reaction, of the rows with bounds.
void IslandSolver::Impl::take_held_impulses() {
  const auto size = static_cast<Eigen::Index>(bounded.size());
  Eigen::Map<Eigen::VectorXd>(b_reduced.data(), size).noalias() -=
      Eigen::Map<const RowMajor>(A_reduced.data(), size, size) * as_vector(held_impulse);
}

/// Bounds and cones are of whole impulses, F = f + Δt reaction: A F + (b − A Δt reaction).
SolveStatus IslandSolver::Impl::solve_bounded() {
  const std::size_t n = bounded.size();
  for (std::size_t i = 0; i < n; ++i) {
    const auto at = static_cast<std::size_t>(bounded[i]);
    held_impulse[i] = step * reaction[at];
    f_bounded[i] = f[at] + held_impulse[i];
    lower_bounded[i] = laws[at].lower, upper_bounded[i] = laws[at].upper;
  }
  take_held_impulses();
  const ContactProblem problem{.cones = static_cast<int>(cones),
                               .A = A_reduced,
                               .b = b_reduced,
                               .friction = friction,
                               .lower = lower_bounded,
                               .upper = upper_bounded,
                               .gap_before = gap_before,
                               .step = step};
  const SolveStatus status = by_program() ? programs.solve(problem, rule.program(), f_bounded, program_report)
                                          : qp.solve(ContactQp{.size = static_cast<int>(n),
                                                               .A = A_reduced,
                                                               .b = b_reduced,
                                                               .lower = lower_bounded,
                                                               .upper = upper_bounded},
                                                     f_bounded)
                                                .status;
  for (std::size_t i = 0; i < n; ++i) f_bounded[i] -= held_impulse[i];
  return status;
}

double IslandSolver::Impl::largest_change() const {
  double largest = 0.0;
  for (Index i = 0; i < rows.size(); ++i)
    largest = std::max(largest, std::abs(change[static_cast<std::size_t>(i)]) / rows.row(i).law.tolerance);
  return largest;
}

void IslandSolver::Impl::keep_within_bounds() {
  for (std::size_t i = 0; i < f.size(); ++i) f[i] = std::clamp(f[i], lower[i], upper[i]);
  if (rule.friction == FrictionModel::kHeuristicNoSlip) return;
  for (std::size_t i = 0; i < cones; ++i) {
    const auto n = static_cast<std::size_t>(bounded[3 * i]), t = n + 1, u = n + 2;
    const double largest = friction[i] * (f[n] + step * reaction[n]);
    const double along = f[t] + step * reaction[t], across = f[u] + step * reaction[u];
    const double size = std::hypot(along, across);
    if (!(size > largest)) continue;
    f[t] += along * (largest / size - 1.0);
    f[u] += across * (largest / size - 1.0);
  }
}

/// Whether the island is small enough, and its rows have an interval each.
bool IslandSolver::Impl::can_differentiate() const {
  constexpr std::size_t kMostRows = 96;
  return f.size() <= kMostRows && cones == 0 && flexibility.empty() && rule.method != ContactMethod::kGapProgram;
}

/// From the best impulses seen, with the rows' true derivatives.
SolveStatus IslandSolver::Impl::differentiate(const BodyStates& states, std::span<Constraint* const> constraints,
                                              const IslandOptions& options, IslandReport& report) {
  const std::size_t m = f.size(), n = metric.size();
  take_best(states, constraints, options, report);
  slope.resize(m), tolerance.resize(m);
  for (std::size_t i = 0; i < m; ++i) {
    slope[i] = compliance[i];
    for (std::size_t j = 0; j < n; ++j) slope[i] += metric[j] * J[i * n + j] * J[i * n + j];
    tolerance[i] = laws[i].tolerance;
  }
  struct Context {
    Impl& solver;
    const BodyStates& states;
    std::span<Constraint* const> constraints;
    const IslandOptions& options;
    IslandReport& report;
  } context{*this, states, constraints, options, report};
  // One captured pointer fits in std::function's own storage, so this allocates nothing.
  const auto evaluate = [&context](std::span<const double> impulses, std::span<double> w) {
    Impl& s = context.solver;
    if (impulses.data() != s.f.data()) std::copy(impulses.begin(), impulses.end(), s.f.begin());
    s.predict(context.options);
    s.measure(context.states, StepTime::kEnd, context.constraints, s.gap);
    ++context.report.iterations;
    for (std::size_t i = 0; i < w.size(); ++i)
      w[i] = s.gap[i] - s.laws[i].offset + s.compliance[i] * (s.f[i] + s.step * s.reaction[i]);
  };
  report.change = newton.solve({.slope = slope, .tolerance = tolerance, .lower = lower, .upper = upper}, evaluate, f);
  return report.change <= 1.0 ? SolveStatus::kSolved : SolveStatus::kIterationLimit;
}

/// The best impulses seen, where Newton's method does not settle: steps in which bodies turn by a radian and more.
SolveStatus IslandSolver::Impl::take_best(const BodyStates& states, std::span<Constraint* const> constraints,
                                          const IslandOptions& options, IslandReport& report) {
  if (!(report.change <= secant.best())) {
    report.change = secant.best();
    std::copy(secant.best_iterate().begin(), secant.best_iterate().end(), f.begin());
    if (convex) take_whole(f), take_impulses();
    predict(options);
    measure(states, StepTime::kEnd, constraints, gap);
  }
  return SolveStatus::kIterationLimit;
}

}  // namespace limber
