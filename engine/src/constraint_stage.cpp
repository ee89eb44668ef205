#include "constraint_stage.h"

#include <algorithm>
#include <utility>

namespace limber::internal {

void ConstraintStage::set_body(Index body, const ConstrainedBody& at) {
  const auto i = static_cast<std::size_t>(body);
  if (i >= table_.size()) {
    table_.resize(i + 1);
    notes_.resize(i + 1);
  }
  table_[i] = at;
  notes_[i].asleep = 0;
  notes_[i].disturbed = 1;
  notes_[i].surplus = 0.0;
  stale_ = true;
}

void ConstraintStage::set_island_solver(IslandSolverFactory make) {
  make_solver_ = std::move(make);
  solvers_.clear();
  stale_ = true;
}

void ConstraintStage::remove_body(Index body) {
  for (std::uint32_t i = 0; i < entries().size(); ++i) {
    const Constraint* constraint = entries()[i].constraint();
    if (constraint == nullptr) continue;
    const std::array<Index, 2> on = constraint->bodies();
    if (on[0] == body || on[1] == body) remove(i);
  }
  release_bodies();
  table_[static_cast<std::size_t>(body)] = {};
  notes_[static_cast<std::size_t>(body)].surplus = 0.0;
  stale_ = true;
}

std::uint32_t ConstraintStage::add(std::unique_ptr<Handle> handle) {
  Entry entry;
  entry.handle = std::move(handle);
  return place(std::move(entry));
}

std::uint32_t ConstraintStage::add(std::unique_ptr<JointConstraint> joint) {
  Entry entry;
  entry.joint = std::move(joint);
  return place(std::move(entry));
}

std::uint32_t ConstraintStage::place(Entry&& entry) {
  const std::uint32_t place = constraints_.add(std::move(entry));
  stale_ = true;
  disturb_bodies_of(place);
  return place;
}

void ConstraintStage::remove(std::uint32_t place) {
  disturb_bodies_of(place);
  constraints_.remove(place);
  stale_ = true;
}

void ConstraintStage::save_state(std::size_t bodies, StateWriter& state) const {
  for (std::size_t i = 0; i < bodies; ++i) state(notes_[i].asleep, notes_[i].disturbed, notes_[i].surplus);
  constraints_.save_state(state);
}

void ConstraintStage::restore_state(std::size_t bodies, StateReader& state) {
  release_bodies();
  contacts_.clear();
  stale_ = true;
  for (std::size_t i = 0; i < bodies; ++i) state(notes_[i].asleep, notes_[i].disturbed, notes_[i].surplus);
  constraints_.restore_state(state);
}

void ConstraintStage::disturb_bodies_of(std::uint32_t index) {
  for (const Index body : entries()[index].constraint()->bodies())
    if (body >= 0) disturb(body);
}

void ConstraintStage::set_asleep(Index body, bool asleep) {
  const auto i = static_cast<std::size_t>(body);
  if (asleep)
    table_[i].group->put_to_sleep(table_[i].slot);
  else
    table_[i].group->wake(table_[i].slot);
  notes_[i].asleep = asleep ? 1 : 0;
  notes_[i].disturbed = 1;
  stale_ = true;
}

/// Bodies of islands that are no more advance by themselves again.
void ConstraintStage::release_bodies() {
  set_constrained(islands_.members(), false);
  islands_.forget_members();
}

void ConstraintStage::set_constrained(std::span<const Index> bodies, bool constrained) {
  for (const Index body : bodies)
    if (const ConstrainedBody& at = table_[static_cast<std::size_t>(body)]; at.group != nullptr)
      at.group->set_constrained(at.slot, constrained);
}

void ConstraintStage::set_contacts(std::span<Constraint* const> contacts) {
  stale_ = stale_ || !contacts_.empty() || !contacts.empty();
  contacts_.assign(contacts.begin(), contacts.end());
}

void ConstraintStage::find_islands(std::span<const Index> awake) {
  if (!stale_) return;
  stale_ = false;
  release_bodies();
  islands_.begin(table_.size());
  reports_.clear();
  all_.clear();
  for (const Entry& entry : entries())
    if (entry.constraint() != nullptr) all_.push_back(entry.constraint());
  all_.insert(all_.end(), contacts_.begin(), contacts_.end());
  if (all_.empty()) return;

  for (const Index body : awake)
    if (notes_[static_cast<std::size_t>(body)].asleep == 0) islands_.let_act(body);
  islands_.find(all_);
  set_constrained(islands_.members(), true);
  while (solvers_.size() < islands_.size()) solvers_.push_back(make_solver_());
  reports_.assign(islands_.size(), {});
}

void ConstraintStage::step(Jobs& jobs, const IslandOptions& options) {
  if (islands_.empty()) return;
  options_ = options;
  // One captured pointer fits in std::function's own storage, so this allocates nothing.
  jobs.parallel_for(islands_.size(), 1, [this](std::size_t begin, std::size_t end) {
    for (std::size_t island = begin; island < end; ++island) step_island(island);
  });
}

void ConstraintStage::step_island(std::size_t island) {
  const std::span<const Index> members = islands_.members(island);
  IslandOptions own = options_;
  own.undisturbed =
      std::ranges::none_of(members, [&](Index body) { return notes_[static_cast<std::size_t>(body)].disturbed != 0; });
  own.energy_surplus = surplus_of(members);
  reports_[island] = solvers_[island]->step(table_, members, islands_.constraints(island), own);
  have_stepped(members, reports_[island]);
}

double ConstraintStage::surplus_of(std::span<const Index> members) const {
  double sum = 0.0;
  for (const Index body : members) sum += notes_[static_cast<std::size_t>(body)].surplus;
  return sum;
}

void ConstraintStage::have_stepped(std::span<const Index> members, const IslandReport& report) {
  for (const Index body : members) {
    Notes& notes = notes_[static_cast<std::size_t>(body)];
    notes.disturbed = 0;
    notes.surplus = report.energy_surplus / static_cast<double>(members.size());
  }
}

IslandReport ConstraintStage::report() const {
  IslandReport sum;
  for (const IslandReport& r : reports_) add_report(r, sum);
  return sum;
}

StageTimes ConstraintStage::times() const {
  StageTimes sum;
  for (const IslandReport& r : reports_) sum.add(r.times);
  return sum;
}

void ConstraintStage::add_report(const IslandReport& r, IslandReport& sum) {
  sum.status = std::max(sum.status, r.status);
  sum.statuses.add(r.statuses);
  sum.accepted = sum.accepted && r.accepted;
  sum.bodies += r.bodies;
  sum.rows += r.rows;
  sum.attempts.add(r.attempts);
  sum.iterations = std::max(sum.iterations, r.iterations);
  sum.newton_steps = std::max(sum.newton_steps, r.newton_steps);
  sum.change = std::max(sum.change, r.change);
  sum.energy_removed += r.energy_removed;
  sum.energy_surplus += r.energy_surplus;
}

}  // namespace limber::internal
