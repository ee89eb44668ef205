/// @file limber/constraints/step_attempts.h
/// In which ways a step of an island may be taken, and how often each was (island_solver.h).
#pragma once

#include <array>
#include <cstddef>

namespace limber {

/// What is tried where a step cannot be taken as it is; each has a cost and a cause.
enum class StepAttempt {
  kCutAtTouch,   ///< where bodies touch: by [H03]'s velocity program alone
  kDivided,      ///< into halves, down to 64ths: joints did not come together
  kRefused,      ///< impulses or bending were given up: the step has failed (IslandStatus::kFailed)
  kInTheMiddle,  ///< joints beside contacts by rows of the middle of the step, after rounds did not settle
};
/// How many parts of steps were taken so.
class StepAttempts {
 public:
  int& operator[](StepAttempt a) { return counts_[static_cast<std::size_t>(a)]; }
  int operator[](StepAttempt a) const { return counts_[static_cast<std::size_t>(a)]; }
  /// Of the step.
  int cuts() const { return (*this)[StepAttempt::kCutAtTouch] + (*this)[StepAttempt::kDivided]; }
  void add(const StepAttempts& other) {
    for (std::size_t i = 0; i < counts_.size(); ++i) counts_[i] += other.counts_[i];
  }

 private:
  std::array<int, 4> counts_{};
};

}  // namespace limber
