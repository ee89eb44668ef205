#include "row_answer.h"

#include <algorithm>
#include <cmath>

namespace limber::internal {
void RowAnswer::begin(const IslandStep& step, std::span<const double> impulses, const MeanProblem& problem) {
  const std::size_t m = impulses.size();
  rows_.clear();
  takes_part_.assign(m, 0), within_.assign(m, 0);
  for (std::size_t i = 0; i < m; ++i) {
    const RowLaw& law = step.law(i);
    const auto row = static_cast<Eigen::Index>(i);
    const double scale = problem.scale()[row],
                 wanted = std::clamp(impulses[i] - problem.off()[row] * scale * scale, law.lower, law.upper);
    const bool inside = impulses[i] > law.lower && impulses[i] < law.upper;
    if (!inside && wanted == impulses[i]) continue;
    takes_part_[i] = 1, within_[i] = is_equality(law) ? 1 : 0;
    rows_.push_back(static_cast<Index>(i));
  }
}

bool RowAnswer::extend(const IslandStep& step, std::span<const double> impulses, const MeanProblem& problem) {
  const std::size_t before = rows_.size();
  for (std::size_t i = 0; i < impulses.size(); ++i) {
    if (takes_part_[i] != 0) continue;
    const RowLaw& law = step.law(i);
    const auto row = static_cast<Eigen::Index>(i);
    const double scale = problem.scale()[row], off = problem.off()[row] + problem.gap_change()[row];
    if (std::clamp(impulses[i] - off * scale * scale, law.lower, law.upper) == impulses[i]) continue;
    takes_part_[i] = 1;
    rows_.push_back(static_cast<Index>(i));
  }
  return rows_.size() > before;
}

/// All rows go over at a time that want to, and where that does not end one at a time, the first: that does (Júdice and
/// Pires 1994, Murty 1974).
void RowAnswer::solve(const IslandStep& step, std::span<const double> impulses, MeanProblem& problem,
                      const MeanMotion& motion) {
  constexpr int kTogether = 4, kTrials = 100;
  constexpr double kYields = 1e-6, kYieldsMore = 1e-2;
  problem.reduce(step, motion, rows_, A_);
  problem.find_open(motion, rows_, open_);
  scale_.resize(open_.size());
  for (std::size_t i = 0; i < rows_.size(); ++i) scale_[static_cast<Eigen::Index>(i)] = problem.scale()[rows_[i]];
  find_damping(step);
  change_.resize(open_.size()).setZero();
  then_ = open_;
  for (int trial = 0; trial < kTrials; ++trial) {
    if (!find_within(step, impulses, trial >= kTogether) && trial > 0) break;
    factor(step, trial < kTogether ? kYields : kYieldsMore);
    meet();
  }
}

bool RowAnswer::solve_again(const IslandStep& step, std::span<const double> impulses, const MeanProblem& problem,
                            const MeanMotion& motion) {
  problem.find_open(motion, rows_, open_);
  change_.resize(open_.size()).setZero();
  meet();
  return !find_within(step, impulses, true);
}

/// Redundant rows are so to the accuracy alone to which gaps are closed: what is smaller than these tells nothing.
void RowAnswer::find_damping(const IslandStep& step) {
  constexpr double kOfGaps = 1e-3, kLeast = 1e-9, kMost = 1e-2;
  constexpr double kLengths = 1e11;  // tolerances
  double off = 0.0;
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    const RowLaw& law = step.law(static_cast<std::size_t>(rows_[i]));
    if (is_equality(law))
      off = std::max(off, std::abs(open_[static_cast<Eigen::Index>(i)]) / (kLengths * law.tolerance));
  }
  damping_ = std::clamp(kOfGaps * off, kLeast, kMost);
}

/// @return whether rows are within their bounds now that were not, or the other way round
bool RowAnswer::find_within(const IslandStep& step, std::span<const double> impulses, bool one) {
  bool changed = false;
  for (std::size_t i = 0; i < rows_.size() && !(one && changed); ++i) {
    const auto row = static_cast<std::size_t>(rows_[i]);
    const auto at = static_cast<Eigen::Index>(i);
    const RowLaw& law = step.law(row);
    if (is_equality(law)) continue;
    const double wanted = impulses[row] + change_[at] - then_[at] * scale_[at] * scale_[at];
    const char within = wanted > law.lower && wanted < law.upper ? 1 : 0;
    changed = changed || within != within_[row];
    within_[row] = within;
    if (within == 0) change_[at] = std::clamp(wanted, law.lower, law.upper) - impulses[row];
  }
  return changed;
}

/// Rows with bounds that ask for what no motion gives, as a motor against its stop, push against each other until one
/// comes to its bound: each yields a little to what it exerts. Where two are all but the same, as limits of a ball
/// joint that meet, their part of A can have a negative determinant, as forces are those of the step's middle and gaps
/// those of its end: then they yield by more, and the next iteration makes up for it. @param yields of what an impulse
/// moves its own row by
void RowAnswer::factor(const IslandStep& step, double yields) {
  const Eigen::Index m = open_.size();
  const auto A = A_.view();
  auto reduced = reduced_.resize(m, m);
  reduced.setIdentity();
  for (Eigen::Index i = 0; i < m; ++i) {
    if (!within(i)) continue;
    for (Eigen::Index j = 0; j < m; ++j)
      if (within(j)) reduced(i, j) = scale_[i] * A(i, j) * scale_[j];
    if (!is_equality(step.law(static_cast<std::size_t>(rows_[static_cast<std::size_t>(i)])))) reduced(i, i) += yields;
  }
  least_squares_.factor(reduced_.numbers(), static_cast<std::size_t>(m), damping_);
}

/// Δ of the rows within their bounds, under that of the others; and what gaps are then.
void RowAnswer::meet() {
  const Eigen::Index m = open_.size();
  right_.resize(m);
  for (Eigen::Index i = 0; i < m; ++i)
    if (within(i)) change_[i] = 0.0;
  then_ = open_;
  then_.view().noalias() += A_.view() * change_.view();
  for (Eigen::Index i = 0; i < m; ++i) right_[i] = within(i) ? -scale_[i] * then_[i] : 0.0;
  least_squares_.solve(right_.numbers());
  for (Eigen::Index i = 0; i < m; ++i)
    if (within(i)) change_[i] = scale_[i] * right_[i];
  then_ = open_;
  then_.view().noalias() += A_.view() * change_.view();
}

}  // namespace limber::internal
