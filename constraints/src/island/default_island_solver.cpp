#include "../tuning.h"
#include "augmented_lagrangian.h"
#include "island_impl.h"
#include "midpoint_newton.h"

namespace limber {
namespace internal {
namespace {

/// Joints and the like in the middle of the step, islands with contacts in rounds.
class DefaultIslandSolver final : public IslandParts {
 protected:
  IslandReport find(const StepPart& part) override;
  void write_slip(std::span<double> slip) const override;

 private:
  void find_middle(IslandReport& done);
  void find_mean(IslandReport& done);

  AugmentedLagrangian rounds_;
  MidpointNewton mean_;
};

IslandReport DefaultIslandSolver::find(const StepPart& part) {
  begin(part, false);
  IslandReport done;
  if (step_.mean) {
    find_mean(done);
    return done;
  }
  rounds_.solve(step_, done);
  if (!done.accepted) find_middle(done);
  return done;
}

void DefaultIslandSolver::write_slip(std::span<double> slip) const {
  step_.mean ? mean_.write_slip(step_, slip) : rounds_.write_slip(step_, slip);
}

/// Joints beside contacts that rounds have not found: by rows of the middle of the step and true derivatives. Where
/// that is not found either, what the rounds came to stays.
void DefaultIslandSolver::find_middle(IslandReport& done) {
  if (step_.contacts_alone || step_.size() > kConstraintsTuning.parts.most_rows_in_the_middle) return;
  IslandReport middle;
  step_.mean = true;
  middle.accepted = mean_.solve(step_, middle, true) == SolveStatus::kSolved;
  middle.attempts[StepAttempt::kInTheMiddle] = 1;
  if (middle.accepted) {
    done = middle;
    return;
  }
  step_.mean = false;
  rounds_.take_again(step_);
}

/// Of bodies on joints and the like. As the last resort bodies do not bend, which is always found but for the
/// oddest rows; then they stay, and are slower.
void DefaultIslandSolver::find_mean(IslandReport& done) {
  done.accepted = mean_.solve(step_, done, true) == SolveStatus::kSolved;
  if (done.accepted || !step_.part.last_resort) return;
  if (mean_.solve(step_, done, false) != SolveStatus::kSolved) mean_.stay(step_);
  done.attempts[StepAttempt::kRefused] = 1;
}

}  // namespace
}  // namespace internal

std::unique_ptr<IslandSolver> make_island_solver() { return std::make_unique<internal::DefaultIslandSolver>(); }

}  // namespace limber
