#include <algorithm>
#include <cmath>

#include "island_impl.h"

namespace limber::internal {
namespace {

/// Of a part that ends as it is.
IslandStatus status_of(const IslandReport& done) {
  if (done.attempts[StepAttempt::kRefused] > 0 || !std::isfinite(done.change)) return IslandStatus::kFailed;
  return done.accepted && done.change <= 1.0 ? IslandStatus::kSolved : IslandStatus::kLimit;
}

}  // namespace

void IslandParts::begin(const StepPart& part, bool contacts_react) {
  clock_.lap(Stage::kSolve);
  step_.begin(part, contacts_react);
  clock_.lap(Stage::kRows, step_.rows.size());
  energy_.begin(step_);
}

/// And the energy with it: where it would rise by more than what drives the island, impulses are refused.
IslandReport IslandParts::find_guarded(const StepPart& part) {
  IslandReport done = guard(part, find(part));
  done.status = status_of(done);
  return done;
}

IslandReport IslandParts::guard(const StepPart& part, IslandReport done) {
  if (step_.mean && !done.accepted && !part.last_resort) return done;
  if (part.options.guard_energy && energy_.close(step_, done) > 0.0) refuse_impulses(done);
  return done;
}

/// Where standing still is not enough, as rows that did not come together have left bodies bent: the free step, which
/// has the energy that it began with.
void IslandParts::refuse_impulses(IslandReport& report) {
  report.accepted = false;
  report.attempts[StepAttempt::kRefused] = 1;
  std::ranges::fill(step_.f, 0.0);
  std::ranges::fill(step_.reaction, 0.0);
  step_.predict();
  energy_.close(step_, report);
}

}  // namespace limber::internal
