#include "row_answer.h"
#include "../tuning.h"

#include <algorithm>
#include <cmath>

namespace limber::internal {
namespace {

/// Of a row or a contact, beside others: a set whose impulse stays as it is wherever gaps let it.
bool stays(const RowParameters& law, const Vec3& impulse, const Vec3& off, double response) {
  ContactPotential set = set_of(law);
  set.compliance = response;
  return set.natural(off, impulse) == impulse;
}

}  // namespace

void RowAnswer::begin(const IslandStep& step, std::span<const double> impulses, const MidpointProblem& problem) {
  rows_.clear();
  takes_part_.assign(impulses.size(), 0), within_.assign(impulses.size(), 0);
  for (std::size_t i = 0; i < impulses.size(); ++i)
    if (is_equality(step.law(i))) add(i, 1), within_[i] = 1;
  equalities_ = rows_.size();
  extend(step, impulses, problem);
}

void RowAnswer::add(std::size_t first, std::size_t count) {
  for (std::size_t i = first; i < first + count; ++i) {
    takes_part_[i] = 1;
    rows_.push_back(static_cast<Index>(i));
  }
}

bool RowAnswer::extend(const IslandStep& step, std::span<const double> impulses, const MidpointProblem& problem) {
  const std::size_t before = rows_.size();
  step.for_units([&](std::size_t first, std::size_t count) {
    if (takes_part_[first] != 0) return;
    Vec3 impulse = Vec3::Zero(), off = Vec3::Zero();
    bool inside = false;
    for (std::size_t r = 0; r < count; ++r) {
      const std::size_t i = first + r;
      const auto row = static_cast<Eigen::Index>(i);
      impulse[static_cast<int>(r)] = impulses[i];
      off[static_cast<int>(r)] = problem.off()[row] + problem.gap_change()[row];
      inside = inside || (impulses[i] != step.law(i).lower && impulses[i] != step.law(i).upper);
    }
    if (inside || !stays(step.law(first), impulse, off, problem.response(first))) add(first, count);
  });
  return rows_.size() > before;
}

void RowAnswer::solve(const IslandStep& step, std::span<const double> impulses, MidpointProblem& problem,
                      const MidpointMotion& motion) {
  problem.reduce(step, motion, rows_, A_);
  problem.find_open(motion, rows_, open_);
  scale_.resize(open_.size()), change_.resize(open_.size());
  for (std::size_t i = 0; i < rows_.size(); ++i)
    scale_[static_cast<Eigen::Index>(i)] = 1.0 / std::sqrt(problem.response(static_cast<std::size_t>(rows_[i])));
  factor(step);
  find_equilibrium(step, problem);
  meet(impulses);
  find_within(step);
}

bool RowAnswer::solve_again(const IslandStep& step, std::span<const double> impulses, const MidpointProblem& problem,
                            const MidpointMotion& motion) {
  problem.find_open(motion, rows_, open_);
  meet(impulses);
  return !find_within(step);
}

/// Redundant rows are so to the accuracy alone to which gaps are closed: what is smaller than these tells nothing.
/// Beside contacts rows yield to a change of their impulses by as much, so that what no motion gives, as a hand in the
/// ground, is left with them.
void RowAnswer::factor(const IslandStep& step) {
  constexpr const MidpointTuning& tuning = kConstraintsTuning.midpoint;
  const auto m = static_cast<Eigen::Index>(equalities_);
  double off = 0.0;
  for (Eigen::Index i = 0; i < m; ++i) {
    const RowParameters& law = step.law(static_cast<std::size_t>(rows_[static_cast<std::size_t>(i)]));
    off = std::max(off, std::abs(open_[i]) / (tuning.lengths * law.tolerance));
  }
  const double damping = std::clamp(tuning.damping_of_gaps * off, tuning.least_damping, tuning.most_damping);
  const auto A = A_.view();
  auto factored = factored_.resize(m, m);
  for (Eigen::Index i = 0; i < m; ++i)
    for (Eigen::Index j = 0; j < m; ++j) factored(i, j) = scale_[i] * A(i, j) * scale_[j];
  if (step.touches) factored.diagonal().array() += std::max(damping, tuning.least_damping_beside_contacts);
  least_squares_.factor(factored_.numbers(), equalities_, step.touches ? tuning.least_damping : damping);
}

/// x ← A⁺ x of the equalities.
std::span<double> RowAnswer::solve_equalities(std::span<double> x) {
  for (std::size_t i = 0; i < x.size(); ++i) x[i] *= scale_[static_cast<Eigen::Index>(i)];
  least_squares_.solve(x);
  for (std::size_t i = 0; i < x.size(); ++i) x[i] *= scale_[static_cast<Eigen::Index>(i)];
  return x;
}

/// What is left between the rows with bounds where those without are met.
void RowAnswer::find_equilibrium(const IslandStep& step, const MidpointProblem& problem) {
  const auto m = static_cast<Eigen::Index>(equalities_), n = static_cast<Eigen::Index>(rows_.size()) - m;
  const auto A = A_.view();
  auto answers = answers_.resize(n, m);
  for (Eigen::Index j = 0; j < n; ++j) {
    answers.row(j) = A.col(m + j).head(m).transpose();
    solve_equalities(answers_.numbers().subspan(static_cast<std::size_t>(j * m), equalities_));
  }
  W_.resize(static_cast<std::size_t>(n * n));
  Eigen::Map<Matrix> W(W_.data(), n, n);
  W = A.bottomRightCorner(n, n);
  W.noalias() -= A.bottomLeftCorner(n, m) * answers.transpose();
  equilibrium_.clear();
  for (std::size_t i = equalities_, count = 1; i < rows_.size(); i += count) {
    const auto row = static_cast<std::size_t>(rows_[i]);
    const RowParameters& law = step.law(row);
    count = static_cast<std::size_t>(contact_rows(law));
    ContactPotential set = set_of(law);
    set.compliance = problem.response(row);
    equilibrium_.add_unit(count, set, law.tolerance);
  }
  equilibrium_.set_matrix(W_);
}

/// Δ of all rows that take part.
void RowAnswer::meet(std::span<const double> impulses) {
  const auto m = static_cast<Eigen::Index>(equalities_), n = open_.size() - m;
  const auto A = A_.view();
  apart_.assign(open_.numbers().begin(), open_.numbers().begin() + m);
  const Eigen::Map<const Vector> stopped(solve_equalities(apart_).data(), m);
  auto change = change_.view();
  bounded_.resize(static_cast<std::size_t>(2 * n));
  Eigen::Map<Vector> f(bounded_.data(), n), b(bounded_.data() + n, n);
  for (Eigen::Index i = 0; i < n; ++i)
    f[i] = impulses[static_cast<std::size_t>(rows_[static_cast<std::size_t>(m + i)])];
  const Eigen::Map<const Matrix> W(W_.data(), n, n);
  b = open_.view().tail(n);
  b.noalias() -= A.bottomLeftCorner(n, m) * stopped;
  b.noalias() -= W * f;
  change.tail(n) = -f;
  equilibrium_.solve(std::span(b.data(), static_cast<std::size_t>(n)),
                     std::span(f.data(), static_cast<std::size_t>(n)));
  change.tail(n) += f;
  change.head(m) = -stopped;
  change.head(m).noalias() -= answers_.view().transpose() * change.tail(n);
}

/// @return whether rows are within their bounds now that were not, or the other way round
bool RowAnswer::find_within(const IslandStep& step) {
  bool changed = false;
  for (std::size_t i = equalities_, count = 1; i < rows_.size(); i += count) {
    const auto first = static_cast<std::size_t>(rows_[i]);
    const RowParameters& law = step.law(first);
    count = static_cast<std::size_t>(contact_rows(law));
    Vec3 f = Vec3::Zero();
    for (std::size_t r = 0; r < count; ++r) f[static_cast<int>(r)] = bounded_[i - equalities_ + r];
    const bool stuck = law.radius > 0.0 ? f.norm() < kConstraintsTuning.midpoint.inside * law.radius
                                        : f.tail<2>().norm() < kConstraintsTuning.midpoint.inside * law.friction * f[0];
    for (std::size_t r = 0; r < count; ++r) {
      const bool alone = law.radius == 0.0 && r == 0;
      const char within = alone ? f[0] > law.lower && f[0] < law.upper : stuck;
      changed = changed || within != within_[first + r];
      within_[first + r] = within;
    }
  }
  return changed;
}

}  // namespace limber::internal
