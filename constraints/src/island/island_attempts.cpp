#include <algorithm>
#include <cmath>

#include "../tuning.h"
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

/// Where the rows did not come together and have left bodies bent, or loads have moved to contacts that have to be
/// filled first: less of the impulses, in the end none. The free step has the energy it began with. Where contacts
/// alone act, as little less as will do: half of what holds a pile would be half a fall.
void IslandParts::refuse_impulses(IslandReport& report) {
  constexpr const EnergyTuning& tuning = kConstraintsTuning.energy;
  report.accepted = false;
  report.attempts[StepAttempt::kRefused] = 1;
  const double first = step_.contacts_alone ? tuning.refused_of_contacts : tuning.refused_of_joints;
  for (double refused = first, accepted = 1.0; accepted > 0.0;
       refused = std::min(2.0 * refused, tuning.refused_at_most)) {
    accepted *= 1.0 - refused;
    if (accepted < tuning.least_accepted) accepted = 0.0;
    for (std::size_t i = 0; i < step_.size(); ++i) {
      // not times 0: they need not be finite
      step_.f[i] = accepted == 0.0 ? 0.0 : (1.0 - refused) * step_.f[i];
      step_.reaction[i] = accepted == 0.0 ? 0.0 : (1.0 - refused) * step_.reaction[i];
    }
    step_.predict();
    if (!(energy_.close(step_, report) > 0.0)) return;
  }
}

}  // namespace limber::internal
