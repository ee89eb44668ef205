#include "bounded_rows.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace limber::internal {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

bool in_cone(const RowParameters& law) { return law.slides || law.friction > 0.0; }

}  // namespace

void BoundedRows::sort(const IslandStep& step) {
  order_.clear(), friction_.clear();
  const auto take = [&](bool (*belongs)(const RowParameters&)) {
    for (Index i = 0; i < step.rows.size(); ++i)
      if (belongs(step.rows.row(i).law)) order_.push_back(i);
  };
  take(is_equality);
  first_bounded_ = order_.size();
  take(in_cone);
  for (std::size_t i = first_bounded_; i < order_.size(); i += 3)
    friction_.push_back(step.law(static_cast<std::size_t>(order_[i])).friction);
  take([](const RowParameters& law) { return !is_equality(law) && !in_cone(law); });
}

void BoundedRows::assemble(const IslandStep& step, std::span<const double> J, std::span<const double> metric) {
  const std::size_t m = order_.size(), n = metric.size();
  G_.resize(m * n), A_.resize(m * m);
  for (std::size_t i = 0; i < m; ++i)
    for (std::size_t k = 0; k < n; ++k)
      G_[i * n + k] = J[static_cast<std::size_t>(order_[i]) * n + k] * std::sqrt(metric[k]);
  const Eigen::Map<const RowMajor> G(G_.data(), static_cast<Eigen::Index>(m), static_cast<Eigen::Index>(n));
  Eigen::Map<RowMajor>(A_.data(), static_cast<Eigen::Index>(m), static_cast<Eigen::Index>(m)).noalias() =
      G * G.transpose();
  place_.resize(m);
  for (std::size_t i = 0; i < m; ++i) {
    const auto row = static_cast<std::size_t>(order_[i]);
    A_[i * m + i] += step.law(row).compliance;
    place_[row] = static_cast<Index>(i);
  }
  for (const ConstraintRows::Flexibility& g : step.rows.flexibility()) {
    const auto i = static_cast<std::size_t>(place_[static_cast<std::size_t>(g.i)]);
    const auto j = static_cast<std::size_t>(place_[static_cast<std::size_t>(g.j)]);
    A_[i * m + j] += g.value / step.length();
    if (i != j) A_[j * m + i] += g.value / step.length();
  }
}

SolveStatus BoundedRows::solve(const IslandStep& step, const ContactRule& rule, std::span<const double> b,
                               std::span<double> F, ProgramReport& report) {
  b_.clear();
  for (const Index row : order_) b_.push_back(b[static_cast<std::size_t>(row)]);
  bounded_.b.resize(order_.size() - first_bounded_);
  bounded_.A.resize(bounded_.b.size() * bounded_.b.size());
  elimination_.reduce(A_, b_, static_cast<int>(first_bounded_), bounded_.A, bounded_.b);
  const SolveStatus status = solve_bounded(step, rule, F, report);
  F_equal_.resize(first_bounded_);
  elimination_.recover(bounded_.F, F_equal_);
  for (std::size_t i = 0; i < order_.size(); ++i)
    F[static_cast<std::size_t>(order_[i])] = i < first_bounded_ ? F_equal_[i] : bounded_.F[i - first_bounded_];
  return status;
}

SolveStatus BoundedRows::solve_bounded(const IslandStep& step, const ContactRule& rule, std::span<const double> F,
                                       ProgramReport& report) {
  const std::size_t n = bounded_.b.size();
  for (std::vector<double>* v : {&bounded_.lower, &bounded_.upper, &bounded_.gap_before, &bounded_.F}) v->resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const auto at = static_cast<std::size_t>(order_[first_bounded_ + i]);
    const RowParameters& law = step.law(at);
    bounded_.F[i] = F[at];
    bounded_.lower[i] = law.lower, bounded_.upper[i] = law.upper;
    bounded_.gap_before[i] = step.start_gap[at] - law.offset;
  }
  return programs_.solve({.cones = contacts(),
                          .A = bounded_.A,
                          .b = bounded_.b,
                          .friction = friction_,
                          .lower = bounded_.lower,
                          .upper = bounded_.upper,
                          .gap_before = bounded_.gap_before,
                          .step = step.length()},
                         rule.program(), bounded_.F, report);
}

void BoundedRows::keep_within(const IslandStep& step, const ContactRule& rule, std::span<double> F) const {
  for (std::size_t i = 0; i < F.size(); ++i) F[i] = std::clamp(F[i], step.law(i).lower, step.law(i).upper);
  if (rule.friction == FrictionModel::kHeuristicNoSlip) return;
  for (std::size_t i = 0; i < friction_.size(); ++i) {
    const auto n = static_cast<std::size_t>(order_[first_bounded_ + 3 * i]), t = n + 1, u = n + 2;
    const double largest = friction_[i] * F[n], size = std::hypot(F[t], F[u]);
    if (!(size > largest)) continue;
    F[t] *= largest / size, F[u] *= largest / size;
  }
}

}  // namespace limber::internal
