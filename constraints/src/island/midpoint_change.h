// A step of Newton's method on bodies under impulses in the middle of a step, and what steps by one matrix tell of the
// next: Broyden's update of its inverse, by the steps alone (Kelley, Iterative Methods for Linear and Nonlinear
// Equations, 1995, section 7.3).
#pragma once

#include <array>

#include "../tuning.h"
#include "midpoint_motion.h"

namespace limber::internal {

struct MidpointChange {
  Vector motion, load, impulses;  // of (d, τ) by body, of all modal loads, and by row
  Vector size;                    // what it changes, all in parts of a length and radians

  void add(const MidpointChange& other, double factor) {
    motion += factor * other.motion, load += factor * other.load, impulses += factor * other.impulses;
    size += factor * other.size;
  }
};

class MidpointSecants {
 public:
  void clear() { count_ = 0; }
  /// Of the last step; unbounded where none is remembered.
  double size() const { return count_ == 0 ? kUnbounded : steps_[count_ - 1].size.norm(); }
  /// @param step by the same matrix as those that are remembered @return whether there is one by which to go on
  bool correct(MidpointChange& step) const {
    if (count_ == 0) return true;
    if (count_ == kMost) return false;
    for (std::size_t j = 0; j + 1 < count_; ++j) step.add(steps_[j + 1], along(j, step));
    const double left = 1.0 - along(count_ - 1, step);
    if (!(left > 0.0)) return false;
    step.add(step, 1.0 / left - 1.0);
    return true;
  }
  void remember(const MidpointChange& step) { steps_[count_++] = step; }

 private:
  static constexpr std::size_t kMost = kConstraintsTuning.midpoint.most_secants;
  double along(std::size_t j, const MidpointChange& step) const {
    return steps_[j].size.dot(step.size) / steps_[j].size.squaredNorm();
  }

  std::array<MidpointChange, kMost> steps_;
  std::size_t count_ = 0;
};

}  // namespace limber::internal
