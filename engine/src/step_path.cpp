#include "step_path.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace limber::internal {

void StepPath::reset(const ContactOptions& options) {
  ContactSet contacts(options);
  constraints_->set_contacts({});
  rows_.set = std::move(contacts);
  clear();
  search_.tell_all_anew();
}

void StepPath::advance(const Substep& substep, StepEvents& events, Jobs& jobs, StageClock& clock) {
  if (registry_->source() != nullptr) {
    search_.find(substep, parts(), rows_, jobs, clock);
    rows_.take(constraints_->states(), search_.found(), substep.gravity, jobs);
    constraints_->set_contacts(rows_.set.constraints());
  }
  const std::span<const Index> awake = sleep_->awake();
  constraints_->find_islands(awake);
  members_.clear();
  std::copy_if(awake.begin(), awake.end(), std::back_inserter(members_),
               [&](Index body) { return constraints_->constrained(body); });
  clock.lap(Stage::kRows);
  bodies_->advance_free(awake, sleep_->changes(), substep.gravity, jobs);
  clock.lap(Stage::kAdvance, std::ssize(awake) - std::ssize(members_));
  report_ = solve(substep, jobs, clock);
  if (registry_->source() == nullptr) return;
  rows_.set.finish(sleep_->asleep(), std::exchange(wakings_, sleep_->wakings()) != sleep_->wakings());
  events.add(substep.index, rows_.set.events());
  clock.lap(Stage::kBookkeeping);
}

}  // namespace limber::internal
