#include "row_newton.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace limber::internal {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

}  // namespace

SolveStatus RowNewton::solve(IslandStep& step, const ContactRule& rule, IslandReport& report, ProgramReport& programs) {
  programs_ = {};
  const SolveStatus status = iterate(step, rule, report);
  programs.add(programs_);
  return status;
}

SolveStatus RowNewton::iterate(IslandStep& step, const ContactRule& rule, IslandReport& report) {
  constexpr int kIterationsUnsettled = 6;
  const int allowed = step.part.options.max_iterations;
  factor(step);
  F_.resize(step.size());
  for (std::size_t i = 0; i < F_.size(); ++i)
    F_[i] = std::clamp(step.length() * step.reaction[i], step.law(i).lower, step.law(i).upper);
  secants_.begin(F_.size());
  for (report.iterations = 1;; ++report.iterations) {
    take(step, F_);
    const SolveStatus status = improve(step, rule);
    report.change = largest_change(step);
    if (report.change <= 1.0) return status;
    // Rows that are not solved for give other impulses every time.
    const int most = status == SolveStatus::kIterationLimit ? std::min(kIterationsUnsettled, allowed) : allowed;
    if (report.iterations > most) return take_best(step, report);
    for (std::size_t i = 0; i < F_.size(); ++i) {
      next_[i] -= F_[i];
      change_[i] /= step.law(i).tolerance;
    }
    secants_.advance(F_, next_, change_);
    bounded_.keep_within(step, rule, F_);
  }
}

/// Makes ready what all iterations share.
void RowNewton::factor(const IslandStep& step) {
  const auto n = static_cast<std::size_t>(step.bodies.degrees_of_freedom());
  J_.resize(step.size() * n), metric_.resize(n), x_.resize(n);
  for (std::vector<double>* v : {&next_, &change_, &b_}) v->resize(step.size());
  step.bodies.write_jacobian(step.rows, J_);
  step.bodies.write_position_metric(step.length(), step.theta, metric_);
  bounded_.sort(step);
  bounded_.assemble(step, J_, metric_);
}

/// One step from F, to next_; change_ is what it makes of the gaps.
SolveStatus RowNewton::improve(const IslandStep& step, const ContactRule& rule) {
  programs_ = {};
  next_ = F_;
  respond(F_, b_);
  for (std::size_t i = 0; i < F_.size(); ++i) b_[i] = step.gap[i] - step.law(i).offset - b_[i];
  const SolveStatus status = bounded_.solve(step, rule, b_, next_, programs_);
  for (std::size_t i = 0; i < F_.size(); ++i) b_[i] = next_[i] - F_[i];
  respond(b_, change_);
  return status;
}

/// What impulses make of the gaps, what rows yield by themselves left out: J D Jᵀ impulses.
void RowNewton::respond(std::span<const double> impulses, std::vector<double>& gaps) {
  const auto m = static_cast<Eigen::Index>(impulses.size()), n = static_cast<Eigen::Index>(metric_.size());
  const Eigen::Map<const RowMajor> J(J_.data(), m, n);
  Eigen::Map<Eigen::VectorXd> x(x_.data(), n);
  x.noalias() = J.transpose() * Eigen::Map<const Eigen::VectorXd>(impulses.data(), m);
  x.array() *= Eigen::Map<const Eigen::ArrayXd>(metric_.data(), n);
  Eigen::Map<Eigen::VectorXd>(gaps.data(), m).noalias() = J * x;
}

double RowNewton::largest_change(const IslandStep& step) const {
  double largest = 0.0;
  for (std::size_t i = 0; i < change_.size(); ++i)
    largest = std::max(largest, std::abs(change_[i]) / step.law(i).tolerance);
  return largest;
}

/// Impulses, and the step under them.
void RowNewton::take(IslandStep& step, std::span<const double> whole) {
  for (std::size_t i = 0; i < whole.size(); ++i) step.f[i] = whole[i] - step.length() * step.reaction[i];
  step.predict();
}

/// The best impulses seen, where Newton's method does not settle: steps in which bodies turn by a radian and more.
SolveStatus RowNewton::take_best(IslandStep& step, IslandReport& report) {
  if (!(report.change <= secants_.best())) {
    report.change = secants_.best();
    std::ranges::copy(secants_.best_iterate(), F_.begin());
    take(step, F_);
  }
  return SolveStatus::kIterationLimit;
}

}  // namespace limber::internal
