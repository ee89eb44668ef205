#include "mean_newton.h"

#include <algorithm>
#include <cmath>

namespace limber::internal {
namespace {

std::span<double> numbers(Vector& v) { return {v.data(), static_cast<std::size_t>(v.size())}; }
std::span<double> numbers(Matrix& m) { return {m.data(), static_cast<std::size_t>(m.size())}; }

const RowLaw& law_of(const IslandStep& step, Eigen::Index row) { return step.law(static_cast<std::size_t>(row)); }

}  // namespace

SolveStatus MeanNewton::solve(IslandStep& step, IslandReport& report, bool bends) {
  constexpr int kMost = 40;
  motion_.begin(step, bends);
  impulses_.assign(step.size(), 0.0);
  active_.assign(step.size(), 1);
  for (report.iterations = 1; report.iterations <= kMost; ++report.iterations) {
    motion_.place(step);
    report.change = improve(step);
    if (!std::isfinite(report.change)) break;
    const double part = motion_.part_of(motion_change_);
    motion_.move(motion_change_, load_change_, part);
    for (std::size_t i = 0; i < impulses_.size(); ++i)
      impulses_[i] += part * impulse_change_[static_cast<Eigen::Index>(i)];
    if (report.change > 1.0) continue;
    // What is left of the equations is of second order in this last change.
    motion_.place(step);
    std::ranges::copy(impulses_, step.f.begin());
    motion_.finish(step, impulses_);
    velocities_.meet_rows(step, active_);
    return SolveStatus::kSolved;
  }
  return SolveStatus::kIterationLimit;
}

/// Newton's step from where things are. @return its size, by tolerances
double MeanNewton::improve(const IslandStep& step) {
  linearise(step);
  stiffen(step);
  reduce(step);
  answer(step);
  motion_change_ = stopped_;
  motion_change_.noalias() += moved_ * impulse_change_;
  right_.noalias() = at_.gap_by_motion * motion_change_;
  double size = motion_.size_of(motion_change_);
  impulse_change_ -= stiffness_.cwiseProduct(right_);
  load_change_ = -at_.modes;
  load_change_.noalias() += at_.modes_by_impulse * impulse_change_;
  right_.noalias() += at_.gap_by_amplitude * (motion_.modal_response().cwiseProduct(load_change_));
  motion_.add_turned(motion_change_, load_change_);
  for (Eigen::Index i = 0; i < right_.size(); ++i)
    size = std::max(size, std::abs(right_[i]) / law_of(step, i).tolerance);
  return std::isfinite(right_.sum()) ? size : kUnbounded;
}

void MeanNewton::linearise(const IslandStep& step) {
  motion_.find_residual(step, impulses_, at_.bodies, at_.modes);
  motion_.find_derivative(step, impulses_, at_.by_motion);
  motion_.find_forces(step, at_.by_impulse, at_.modes_by_impulse);
  motion_.find_gap_derivative(step, at_.gap_by_motion, at_.gap_by_amplitude);
  motion_.condense(at_.modes_by_impulse, at_.gap_by_amplitude, at_.modes, at_.by_motion, at_.by_impulse,
                   at_.gap_by_motion, at_.bodies);
  weighted_.noalias() = at_.gap_by_amplitude * motion_.modal_response().asDiagonal();
  at_.gap_through_modes.noalias() = weighted_ * at_.modes_by_impulse;
}

/// Rows without bounds stand in as springs γ for what they hold: forces that pull a body away from its place, as a
/// pushed rod's do, would else make its matrix singular. With a the gap that an impulse on the row alone makes, γ is
/// 1/a and more where forces are large.
void MeanNewton::stiffen(const IslandStep& step) {
  const Eigen::Index m = at_.gap_by_motion.rows();
  stiffness_.setZero(m), scale_.setZero(m);
  motion_.find_mobility(at_.gap_by_motion, at_.by_impulse, right_);
  const double harder = 1.0 + motion_.force_to_inertia(at_.by_motion);
  for (Eigen::Index i = 0; i < m; ++i) {
    const double a = right_[i] + at_.gap_through_modes(i, i);
    if (right_[i] > 0.0 && is_equality(law_of(step, i))) stiffness_[i] = harder / a;
    if (a > 0.0) scale_[i] = 1.0 / std::sqrt(a);
  }
}

/// The impulses' own problem. With E, F and K the gaps' and the bodies' derivatives, B what modes make of gaps, c the
/// rows' compliance, ΔQ = Δf + γ E Δx and E' = (1 − B γ − c γ) E:
///   Δx = (K + F γ E)⁻¹ (F ΔQ − r),      gaps = open + A ΔQ,      A = E' (K + F γ E)⁻¹ F + B + c
void MeanNewton::reduce(const IslandStep& step) {
  const Eigen::Index n = at_.by_motion.rows(), m = at_.gap_by_motion.rows();
  weighted_.noalias() = at_.by_impulse * stiffness_.asDiagonal();
  at_.by_motion.noalias() += weighted_ * at_.gap_by_motion;
  moved_ = at_.by_impulse;
  stopped_ = -at_.bodies;
  if (!factor_.factor(numbers(at_.by_motion), static_cast<std::size_t>(n))) stopped_.setConstant(kUnbounded);
  factor_.solve(numbers(moved_), static_cast<std::size_t>(m));
  factor_.solve(numbers(stopped_), 1);
  A_ = at_.gap_through_modes;
  for (Eigen::Index i = 0; i < m; ++i) A_(i, i) += law_of(step, i).compliance;
  weighted_.noalias() = A_ * stiffness_.asDiagonal();
  free_gap_ = at_.gap_by_motion;
  free_gap_.noalias() -= weighted_ * at_.gap_by_motion;
  A_.noalias() += free_gap_ * moved_;
  open_.resize(m);
  for (Eigen::Index i = 0; i < m; ++i) {
    const auto row = static_cast<std::size_t>(i);
    open_[i] = step.gap[row] - step.law(row).offset + step.law(row).compliance * impulses_[row];
  }
  find_damping(step);
  open_.noalias() += free_gap_ * stopped_;
  open_.noalias() -= at_.gap_by_amplitude * (motion_.modal_response().cwiseProduct(at_.modes));
}

/// Redundant rows are so to the accuracy alone to which gaps are closed: what is smaller than these tells nothing.
void MeanNewton::find_damping(const IslandStep& step) {
  constexpr double kOfGaps = 1e-3, kLeast = 1e-9, kMost = 1e-2;
  constexpr double kLengths = 1e11;  // tolerances
  double off = 0.0;
  for (Eigen::Index i = 0; i < open_.size(); ++i)
    if (is_equality(law_of(step, i))) off = std::max(off, std::abs(open_[i]) / (kLengths * law_of(step, i).tolerance));
  damping_ = std::clamp(kOfGaps * off, kLeast, kMost);
}

/// ΔQ with which the rows, linear about here, meet their law: those strictly within their bounds by equality, in the
/// sense of least squares with rows scaled alike; the others at their bounds. All rows go over at a time that want to,
/// and where that does not end one at a time, the first: that does (Júdice and Pires 1994, Murty 1974).
void MeanNewton::answer(const IslandStep& step) {
  constexpr int kTogether = 4, kTrials = 100;
  constexpr double kYields = 1e-6, kYieldsMore = 1e-2;
  impulse_change_.setZero(open_.size());
  then_ = open_;
  for (int trial = 0; trial < kTrials; ++trial) {
    if (!find_active(step, trial >= kTogether) && trial > 0) return;
    meet_active(step, trial < kTogether ? kYields : kYieldsMore);
    then_ = open_;
    then_.noalias() += A_ * impulse_change_;
  }
}

/// Which rows with bounds are within them. @return whether that has changed
bool MeanNewton::find_active(const IslandStep& step, bool one) {
  bool changed = false;
  for (Eigen::Index i = 0; i < open_.size() && !(one && changed); ++i) {
    const RowLaw& law = law_of(step, i);
    if (is_equality(law)) continue;
    const auto row = static_cast<std::size_t>(i);
    const double wanted = impulses_[row] + impulse_change_[i] - then_[i] * scale_[i] * scale_[i];
    const char within = wanted > law.lower && wanted < law.upper ? 1 : 0;
    changed = changed || within != active_[row];
    active_[row] = within;
    if (within == 0) impulse_change_[i] = std::clamp(wanted, law.lower, law.upper) - impulses_[row];
  }
  return changed;
}

/// Rows with bounds that ask for what no motion gives, as a motor against its stop, push against each other until one
/// comes to its bound: each yields a little to what it exerts. Where two are all but the same, as limits of a ball
/// joint that meet, their part of A can have a negative determinant, as forces are those of the step's middle and gaps
/// those of its end: then they yield by more, and the next iteration makes up for it. @param yields of what an impulse
/// moves its own row by
void MeanNewton::meet_active(const IslandStep& step, double yields) {
  const Eigen::Index m = open_.size();
  reduced_.setIdentity(m, m);
  right_.setZero(m);
  for (Eigen::Index i = 0; i < m; ++i) {
    if (active_[static_cast<std::size_t>(i)] == 0) continue;
    right_[i] = -scale_[i] * open_[i];
    for (Eigen::Index j = 0; j < m; ++j)
      if (active_[static_cast<std::size_t>(j)] != 0)
        reduced_(i, j) = scale_[i] * A_(i, j) * scale_[j];
      else
        right_[i] -= scale_[i] * A_(i, j) * impulse_change_[j];
    if (!is_equality(law_of(step, i))) reduced_(i, i) += yields;
  }
  rows_.solve(numbers(reduced_), damping_, numbers(right_));
  for (Eigen::Index i = 0; i < m; ++i)
    if (active_[static_cast<std::size_t>(i)] != 0) impulse_change_[i] = scale_[i] * right_[i];
}

}  // namespace limber::internal
