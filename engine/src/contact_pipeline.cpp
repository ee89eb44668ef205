#include "contact_pipeline.h"

#include <algorithm>
#include <utility>

namespace limber::internal {

void ContactPipeline::reset(const ContactOptions& options) {
  ContactSet contacts(options);
  constraints_->set_contacts({});
  rows_.set = std::move(contacts);
  search_.tell_all_anew();
}

void ContactPipeline::advance(const Substep& substep, StepEvents& events, Jobs& jobs, StageClock& clock) {
  if (registry_->source() != nullptr) {
    search_.find(substep, 1, rows_, jobs, clock);
    rows_.take(constraints_->states(), search_.found());
    constraints_->set_contacts(rows_.set.constraints());
  }
  constraints_->find_islands(sleep_->awake());
  clock.lap(Stage::kRows);
  const std::span<const Index> awake = sleep_->awake();
  bodies_->advance_free(awake, sleep_->changes(), substep.gravity, jobs);
  const auto constrained =
      std::count_if(awake.begin(), awake.end(), [&](Index body) { return constraints_->constrained(body); });
  clock.lap(Stage::kAdvance, std::ssize(awake) - constrained);
  constraints_->step(jobs, {.step = substep.length, .gravity = substep.gravity, .timed = clock.runs()});
  if (clock.runs()) clock.lap(constraints_->times(), Stage::kSolve);
  if (registry_->source() == nullptr) return;
  rows_.set.finish(sleep_->asleep(), std::exchange(wakings_, sleep_->wakings()) != sleep_->wakings());
  events.add(substep.index, rows_.set.events());
  clock.lap(Stage::kBookkeeping);
}

}  // namespace limber::internal
