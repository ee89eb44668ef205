#include "game_path.h"

#include <algorithm>
#include <utility>

namespace limber::internal {

void GamePath::reset(const ContactOptions& options) {
  ContactSet contacts(options);
  constraints_->set_contacts({});
  rows_.set = std::move(contacts);
  solver_.clear();
  search_.tell_all_anew();
}

void GamePath::advance(const Substep& substep, StepEvents& events, Jobs& jobs, StageClock& clock) {
  if (registry_->source() != nullptr) {
    search_.find(substep, rows_.set.options().small_steps.substeps, rows_, jobs, clock);
    rows_.take(constraints_->states(), search_.found());
    constraints_->set_contacts(rows_.set.constraints());
  }
  constraints_->find_islands(sleep_->awake());
  list_members();
  list_constraints();
  clock.lap(Stage::kRows, std::ssize(search_.found()));
  bodies_->advance_free(sleep_->awake(), sleep_->changes(), substep.gravity, jobs);
  clock.lap(Stage::kAdvance, std::ssize(sleep_->awake()) - std::ssize(members_));
  solve(substep, jobs);
  clock.lap(Stage::kSolve, report_.rows);
  if (registry_->source() == nullptr) return;
  rows_.set.finish(sleep_->asleep(), std::exchange(wakings_, sleep_->wakings()) != sleep_->wakings());
  events.add(substep.index, rows_.set.events());
  clock.lap(Stage::kBookkeeping);
}

void GamePath::list_members() {
  members_.clear();
  for (const Index body : sleep_->awake())
    if (constraints_->constrained(body)) members_.push_back(body);
}

void GamePath::list_constraints() {
  const auto acts = [&](Index body) { return body >= 0 && constraints_->constrained(body); };
  constraining_.clear();
  for (const ConstraintStage::Entry& entry : constraints_->entries()) {
    Constraint* constraint = entry.constraint();
    if (constraint == nullptr) continue;
    const auto [a, b] = constraint->bodies();
    if (acts(a) || acts(b)) constraining_.push_back(constraint);
  }
}

void GamePath::solve(const Substep& substep, Jobs& jobs) {
  const SmallStepReport report = solver_.step({.table = constraints_->table(),
                                               .members = members_,
                                               .contacts = &rows_.set,
                                               .constraints = constraining_,
                                               .thickness = search_.thickness(),
                                               .step = substep.length,
                                               .gravity = substep.gravity},
                                              jobs);
  report_ = {};
  report_.status = report.solved ? IslandStatus::kSolved : IslandStatus::kFailed;
  report_.statuses[report_.status] = 1;
  report_.bodies = static_cast<int>(members_.size());
  report_.rows = report.rows;
  report_.change = report.residual;
}

void GamePath::save_state(StateWriter& state) const {
  rows_.set.save_state(state);
  solver_.save_state(state);
}

void GamePath::restore_state(StateReader& state) {
  rows_.set.restore_state(state);
  solver_.restore_state(state);
}

}  // namespace limber::internal
