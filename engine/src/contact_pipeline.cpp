#include "contact_pipeline.h"
#include "tuning.h"

#include <algorithm>
#include <utility>

namespace limber::internal {

void ContactPipeline::reset(const ContactOptions& options) {
  ContactSet contacts(options);
  constraints_->set_contacts({});
  rows_.set = std::move(contacts);
  forecast_.tell_all_anew();
}

void ContactPipeline::advance(const Substep& substep, StepEvents& events, Jobs& jobs, StageClock& clock) {
  attempts_ = {};
  foresee(substep, jobs, clock);
  advance_free(substep, jobs, clock);
  constraints_->finish(jobs);
  for (const Index body : sleep_->awake()) (*bodies_)[body].held = constraints_->constrained(body);
  if (clock.runs()) clock.lap(constraints_->times(), Stage::kSolve);
  if (registry_->source() == nullptr) return;
  const bool woke = note_wakings();
  rows_.set.finish(fast_.any() ? fast_.rests() : sleep_->asleep(), woke);
  events.add(substep.index, rows_.set.events());
  clock.lap(Stage::kBookkeeping);
  if (!fast_.any()) return;
  const auto waiting = static_cast<std::int64_t>(fast_.members().size());
  fast_.advance(substep, search_.found(), rows_, events, attempts_);
  clock.lap(Stage::kFastBodies, waiting);
}

/// Finds what touches, the islands that it makes, and where these end. Contacts are looked for anew where bodies come
/// farther than expected, three times at most: each time at least twice as far.
void ContactPipeline::foresee(const Substep& substep, Jobs& jobs, StageClock& clock) {
  forecast_.begin(substep.length, substep.gravity);
  double rough = 0.0;
  if (registry_->source() != nullptr) {
    search_.begin(substep.length);
    rough = search_.roughness();
    search_.find(jobs, clock);
    take_contacts();
  }
  for (int look = 0;; ++look) {
    constraints_->hold_back(fast_.members());
    constraints_->find_islands(sleep_->awake());
    clock.lap(Stage::kRows);
    constraints_->foresee(jobs, {.step = substep.length,
                                 .gravity = substep.gravity,
                                 .timed = clock.runs(),
                                 .rough = look < kEngineTuning.looks.most ? rough : 0.0});
    if (clock.runs()) clock.lap(constraints_->foreseen_times(), Stage::kSolve);
    if (registry_->source() == nullptr || look == kEngineTuning.looks.most || !look_again(jobs, clock)) break;
    ++attempts_[StepAttempt::kLookedFarther];
  }
  clock.lap(Stage::kLookAhead);
  constraints_->refine(jobs);
  if (clock.runs()) clock.lap(constraints_->foreseen_times(), Stage::kSolve);
}

/// Takes the contacts that the motion foreseen meets beside those it was foreseen with. @return whether there are any
bool ContactPipeline::look_again(Jobs& jobs, StageClock& clock) {
  if (search_.find_again_along_foreseen(jobs, clock)) {
    take_contacts();
    constraints_->let_go();
    return true;
  }
  if (!search_.add_those_of_foreseen_end(jobs)) return false;
  take_contacts(search_.in_force());
  return true;
}

/// As rows for the islands; those of fast bodies wait.
void ContactPipeline::take_contacts() {
  if (fast_.any()) fast_.leave_out_contacts(search_.found());
  take_contacts(search_.in_force());
}

void ContactPipeline::take_contacts(std::span<const ContactPoint> found) {
  rows_.take(constraints_->states(), found);
  constraints_->set_contacts(rows_.set.constraints());
}

/// Bodies that nothing constrains.
void ContactPipeline::advance_free(const Substep& substep, Jobs& jobs, StageClock& clock) {
  const std::span<const Index> awake = sleep_->awake();
  bodies_->advance_free(awake, sleep_->changes(), substep.gravity, jobs);
  if (!clock.runs()) return;
  const auto constrained =
      std::count_if(awake.begin(), awake.end(), [&](Index body) { return constraints_->constrained(body); }) +
      static_cast<std::ptrdiff_t>(fast_.members().size());
  clock.lap(Stage::kAdvance, std::ssize(awake) - constrained);
}

/// @return whether a body whose contacts were remembered as those of a sleeper takes part again
bool ContactPipeline::note_wakings() {
  const Noted before = std::exchange(noted_, {sleep_->wakings(), fast_.any()});
  return before.wakings != noted_.wakings || before.waited || noted_.waited;
}

IslandReport ContactPipeline::report() const {
  IslandReport report = constraints_->report();
  report.attempts.add(attempts_);
  return report;
}

}  // namespace limber::internal
