#include <algorithm>
#include <cmath>

#include "island_impl.h"

namespace limber {
namespace {

/// Of a part that ends as it is.
IslandStatus status_of(const IslandReport& done) {
  if (done.attempts[StepAttempt::kRefused] > 0 || !std::isfinite(done.change)) return IslandStatus::kFailed;
  return done.accepted && done.change <= 1.0 ? IslandStatus::kSolved : IslandStatus::kLimit;
}

}  // namespace

using internal::StepPart;

/// What becomes of the members by the end, all but the energy.
IslandReport IslandSolver::Impl::foresee(const StepPart& part) {
  clock.lap(Stage::kSolve);
  step.begin(part);
  clock.lap(Stage::kRows, step.rows.size());
  energy.begin(step);
  IslandReport done;
  if (step.mean) {
    foresee_mean(done);
    return done;
  }
  if (step.holds_contact_forces()) touch.solve(step, reaction, done.programs);
  reaction.find(step, StepTime::kStart);
  if (step.convex)
    rounds.solve(step, done);
  else
    done.accepted = newton.solve(step, done) == SolveStatus::kSolved;
  if (!done.accepted && foresee_middle(done)) return done;
  if (part.options.watch != nullptr) step.trace(motions);
  act_at_end();
  return done;
}

/// Joints beside contacts that rounds have not found: by rows of the middle of the step and true derivatives. @return
/// whether that is found; else what the rounds came to stays
bool IslandSolver::Impl::foresee_middle(IslandReport& done) {
  if (!step.convex || !step.touches || step.contacts_alone || step.part.options.watch != nullptr) return false;
  constexpr std::size_t kMostRows = 80;  // matrices are dense
  if (step.size() > kMostRows) return false;
  const bool all_early = step.loads.all_early;
  IslandReport middle;
  step.take_middle(true);
  middle.accepted = mean.solve(step, middle, true) == SolveStatus::kSolved;
  middle.attempts[StepAttempt::kInTheMiddle] = 1;
  if (middle.accepted) {
    done = middle;
    return true;
  }
  step.take_middle(false);
  if (all_early) step.loads.take_all_early();
  reaction.find(step, StepTime::kStart);
  rounds.take_again(step);
  return false;
}

/// Of bodies on joints and the like. As the last resort bodies do not bend, which is always found but for the
/// oddest rows; then they stay, and are slower.
void IslandSolver::Impl::foresee_mean(IslandReport& done) {
  done.accepted = mean.solve(step, done, true) == SolveStatus::kSolved;
  if (done.accepted || !step.part.last_resort) return;
  if (mean.solve(step, done, false) != SolveStatus::kSolved) mean.stay(step);
  done.attempts[StepAttempt::kRefused] = 1;
}

/// The frames' second half of what holds them, and of what strikes them.
void IslandSolver::Impl::act_at_end() {
  if (step.takes_loads_early()) return;
  step.linearise_end();
  if (step.holds_contact_forces()) touch.hold_forces(step.end_rows, step.length());
  reaction.find(step, StepTime::kEnd);
  step.load_end();
}

/// And the energy with it: where it would rise by more than what drives the island, relative motion is taken at the
/// start, if all rows came together, or impulses are refused.
IslandReport IslandSolver::Impl::foresee_guarded(const StepPart& part) {
  IslandReport done = foresee(part);
  if (!done.rough) done = guard(part, done);
  done.status = status_of(done);
  return done;
}

/// What has been foreseen roughly, to the law, and guarded.
IslandReport IslandSolver::Impl::refine(const StepPart& part, IslandReport done) {
  step.part.options.rough = 0.0;
  done.newton_steps = 0;  // bounded as those of the look were
  rounds.go_on(step, done);
  act_at_end();
  done = guard(part, done);
  done.status = status_of(done);
  return done;
}

IslandReport IslandSolver::Impl::guard(StepPart part, IslandReport done) {
  constexpr int kSlowings = 3;
  const ContactRule& rule = part.options.contact;
  if (step.mean && !done.accepted && !part.last_resort) return done;
  if (!part.options.guard_energy || (rule.is_program() && rule.guard == ProgramGuard::kNone)) return done;
  for (int slowing = 0;; ++slowing) {
    const double left = energy.close(step, done);
    if (!(left > 0.0)) return done;
    const bool may_slow = done.accepted && !step.holds_contact_forces() && std::isfinite(left);
    if (!may_slow || slowing == kSlowings || !energy.slow_start(step, left, part)) break;
    done = foresee(part);
    done.attempts[StepAttempt::kSlowed] = 1;
  }
  refuse_impulses(done);
  return done;
}

/// Where the rows did not come together and have left bodies bent, or loads have moved to contacts that have to be
/// filled first: less of the impulses, in the end none. The free step has the energy it began with. Where contacts
/// alone act, as little less as will do: half of what holds a pile would be half a fall.
void IslandSolver::Impl::refuse_impulses(IslandReport& report) {
  constexpr double kLeast = 4e-4;
  report.accepted = false;
  report.attempts[StepAttempt::kRefused] = 1;
  const double first = step.contacts_alone ? 0.01 : 0.5;
  for (double refused = first, accepted = 1.0; accepted > 0.0; refused = std::min(2.0 * refused, 0.5)) {
    accepted *= 1.0 - refused;
    if (accepted < kLeast) accepted = 0.0;
    for (std::size_t i = 0; i < step.size(); ++i) {
      // not times 0: they need not be finite
      step.f[i] = accepted == 0.0 ? 0.0 : (1.0 - refused) * step.f[i];
      step.reaction[i] = accepted == 0.0 ? 0.0 : (1.0 - refused) * step.reaction[i];
    }
    step.predict();
    if (step.part.options.watch != nullptr) step.trace(motions);
    if (!(energy.close(step, report) > 0.0)) return;
  }
}

}  // namespace limber
