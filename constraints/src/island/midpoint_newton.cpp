#include "midpoint_newton.h"
#include "../tuning.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace limber::internal {
SolveStatus MidpointNewton::solve(IslandStep& step, IslandReport& report, bool bends) {
  bends_ = bends;
  begin(step);
  const SolveStatus status = iterate(step, report);
  if (status != SolveStatus::kSolved) return status;
  report.change = problem_.largest_distance(step, impulses_);
  finish(step);
  return status;
}

SolveStatus MidpointNewton::iterate(IslandStep& step, IslandReport& report) {
  bool first = report.iterations == 0;
  for (int i = 0; i < kConstraintsTuning.midpoint.most_iterations;) {
    motion_.place(step);
    if (problem_.measure(step, motion_, impulses_)) return SolveStatus::kSolved;
    ++i, ++report.iterations;
    if (!improve(step)) break;
    if (std::exchange(first, false) && free_is_nearer()) {
      forget_forces(step);
      continue;
    }
    report.change = size();
    move(step);
    if (repeated_ || report.change > 1.0) continue;
    // What is left of the equations is of second order in this last change.
    motion_.place(step);
    if (step.touches) problem_.measure(step, motion_, impulses_);
    if (problem_.touches_law()) return SolveStatus::kSolved;
  }
  return SolveStatus::kIterationLimit;
}

void MidpointNewton::move(const IslandStep& step) {
  const double part = motion_.part_of(change_.motion);
  motion_.move(change_.motion, change_.load, part);
  step.for_units([&](std::size_t first, std::size_t count) {
    Vec3 impulse = Vec3::Zero();
    for (std::size_t r = 0; r < count; ++r)
      impulse[static_cast<int>(r)] =
          impulses_[first + r] + part * change_.impulses[static_cast<Eigen::Index>(first + r)];
    if (!is_equality(step.law(first))) {
      ContactPotential set = set_of(step.law(first));
      set.compliance = 1.0;
      impulse = set.nearest(impulse);
    }
    for (std::size_t r = 0; r < count; ++r) impulses_[first + r] = impulse[static_cast<int>(r)];
  });
  if (part < 1.0) secants_.clear();
}

/// From where the last step's forces would take the bodies.
void MidpointNewton::begin(IslandStep& step) {
  motion_.begin(step, bends_);
  forget_forces(step);
  motion_.write_place(free_);
  for (std::size_t i = 0; i < impulses_.size(); ++i) {
    const RowParameters& law = step.law(i);
    impulses_[i] = std::clamp(step.length() * law.last_force, law.lower, law.upper);
    within_[i] = impulses_[i] > law.lower && impulses_[i] < law.upper ? 1 : 0;
  }
  motion_.guess(step, impulses_);
  motion_.write_place(guess_);
}

void MidpointNewton::forget_matrix() {
  linear_ = false;
  secants_.clear();
}

/// To free flight.
void MidpointNewton::forget_forces(const IslandStep& step) {
  forget_matrix();
  impulses_.resize(step.size()), within_.resize(step.size());
  for (std::size_t i = 0; i < impulses_.size(); ++i)
    impulses_[i] = std::clamp(0.0, step.law(i).lower, step.law(i).upper);
  motion_.guess(step, impulses_);
}

/// Whether the last step's forces tell too little: Newton's first step from there is no small part of what forces do.
/// Bodies that whip would be led to other motions than those that are next to free flight, which break up later.
bool MidpointNewton::free_is_nearer() const {
  const auto first = change_.size.head(free_.size());
  return !(first.norm() <= kConstraintsTuning.midpoint.forces_lead * (guess_ + first - free_).norm());
}

void MidpointNewton::finish(IslandStep& step) {
  std::ranges::copy(impulses_, step.f.begin());
  motion_.finish(step, impulses_);
  velocities_.meet_rows(step, within_);
}

void MidpointNewton::write_slip(const IslandStep& step, std::span<double> slip) const {
  if (!step.loads_at_start) return;
  for (std::size_t i = 0; i < impulses_.size(); ++i)
    if (step.law(i).friction > 0.0 && impulses_[i] > 0.0)
      slip[i] = problem_.off().segment<2>(static_cast<Eigen::Index>(i) + 1).norm();
}

/// To change_: Newton's step from where things are, by the matrix of an earlier place while that does. @return whether
/// there is a step
bool MidpointNewton::improve(const IslandStep& step) {
  repeated_ = linear_ && repeat(step);
  if (repeated_) return true;
  secants_.clear();
  linear_ = problem_.linearise(step, motion_, impulses_);
  if (!linear_) return false;
  answer_.begin(step, impulses_, problem_);
  do {
    answer_.solve(step, impulses_, problem_, motion_);
    take(step);
  } while (answer_.extend(step, impulses_, problem_));
  std::ranges::copy(answer_.within(), within_.begin());
  secants_.remember(change_);
  return std::isfinite(change_.size.sum());
}

/// The same by the matrix at hand. @return whether it will do
bool MidpointNewton::repeat(const IslandStep& step) {
  problem_.aim(motion_);
  const bool same = answer_.solve_again(step, impulses_, problem_, motion_);
  take(step);
  if (!same || answer_.extend(step, impulses_, problem_) || !secants_.correct(change_)) return false;
  if (!(change_.size.norm() < kConstraintsTuning.midpoint.shrinks * secants_.size())) return false;
  secants_.remember(change_);
  return true;
}

void MidpointNewton::take(const IslandStep& step) {
  problem_.answer(motion_, answer_.rows(), answer_.change(), change_);
  const Eigen::Index n = change_.motion.size();
  const Vector& gaps = problem_.gap_change();
  change_.size.resize(n + gaps.size());
  motion_.write_relative(change_.motion, change_.size.head(n));
  for (Eigen::Index i = 0; i < gaps.size(); ++i)
    change_.size[n + i] =
        gaps[i] / (kConstraintsTuning.midpoint.lengths * step.law(static_cast<std::size_t>(i)).tolerance);
}

/// By tolerances.
double MidpointNewton::size() const {
  const Eigen::Index gaps = change_.size.size() - change_.motion.size();
  return std::max(motion_.size_of(change_.motion),
                  kConstraintsTuning.midpoint.lengths * change_.size.tail(gaps).cwiseAbs().maxCoeff());
}

}  // namespace limber::internal
