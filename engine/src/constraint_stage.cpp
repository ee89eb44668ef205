#include "constraint_stage.h"

#include <algorithm>
#include <utility>

namespace limber::internal {

void ConstraintStage::set_body(Index body, const ConstrainedBody& at) {
  const auto i = static_cast<std::size_t>(body);
  if (i >= table_.size()) {
    table_.resize(i + 1);
    disturbed_.resize(i + 1);
    asleep_.resize(i + 1);
    held_back_.resize(i + 1);
    surplus_.resize(i + 1);
  }
  table_[i] = at;
  asleep_[i] = 0;
  disturbed_[i] = true;
  surplus_[i] = 0.0;
  stale_ = true;
}

void ConstraintStage::remove_body(Index body) {
  for (std::uint32_t i = 0; i < entries_.size(); ++i) {
    const Constraint* constraint = entries_[i].constraint();
    if (constraint == nullptr) continue;
    const std::array<Index, 2> on = constraint->bodies();
    if (on[0] == body || on[1] == body) remove(i);
  }
  release_bodies();
  table_[static_cast<std::size_t>(body)] = {};
  surplus_[static_cast<std::size_t>(body)] = 0.0;
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
  if (vacant_.empty()) {
    entries_.emplace_back();
    vacant_.reserve(entries_.size());  // so that remove() cannot fail
    vacant_.push_back(static_cast<std::uint32_t>(entries_.size() - 1));
  }
  const std::uint32_t index = vacant_.back();
  vacant_.pop_back();
  entry.generation = entries_[index].generation;
  entries_[index] = std::move(entry);
  stale_ = true;
  disturb_bodies_of(index);
  return index;
}

void ConstraintStage::remove(std::uint32_t index) {
  disturb_bodies_of(index);
  Entry& entry = entries_[index];
  entry.handle.reset();
  entry.joint.reset();
  stale_ = true;
  // A place whose generations are used up is never given again.
  if (++entry.generation != 0) vacant_.push_back(index);
}

ConstraintStage::Kind ConstraintStage::kind_of(const Entry& entry) {
  return entry.handle ? Kind::kHandle : entry.joint ? Kind::kJoint : Kind::kVacant;
}

void ConstraintStage::save_state(std::size_t bodies, StateWriter& state) const {
  for (std::size_t i = 0; i < bodies; ++i) state(asleep_[i], disturbed_[i], surplus_[i]);
  state(vacant_, static_cast<std::uint64_t>(entries_.size()));
  for (const Entry& entry : entries_) {
    state(entry.generation, kind_of(entry));
    if (entry.handle) state(*entry.handle);
    if (entry.joint) state(*entry.joint);
  }
}

void ConstraintStage::restore_state(std::size_t bodies, StateReader& state) {
  release_bodies();
  contacts_.clear();
  stale_ = true;
  for (std::size_t i = 0; i < bodies; ++i) state(asleep_[i], disturbed_[i], surplus_[i]);
  state(vacant_);
  entries_.resize(state.read<std::uint64_t>());
  for (Entry& entry : entries_) {
    const Kind known = kind_of(entry);
    entry.generation = state.read<std::uint32_t>();
    const Kind kind = state.read<Kind>();
    if (kind != known) entry.handle.reset(), entry.joint.reset();
    if (kind == Kind::kHandle) {
      if (!entry.handle) entry.handle = std::make_unique<Handle>(MaterialFrame(JointFrame{}), Vec3::Zero());
      state(*entry.handle);
    }
    if (kind == Kind::kJoint) {
      const MaterialFrame any(JointFrame{});
      if (!entry.joint) entry.joint = std::make_unique<JointConstraint>(any, any, JointSpec{});
      entry.joint->restore_state(state);
    }
  }
}

void ConstraintStage::disturb_bodies_of(std::uint32_t index) {
  for (const Index body : entries_[index].constraint()->bodies())
    if (body >= 0) disturb(body);
}

void ConstraintStage::set_asleep(Index body, bool asleep) {
  const auto i = static_cast<std::size_t>(body);
  if (asleep)
    table_[i].group->put_to_sleep(table_[i].slot);
  else
    table_[i].group->wake(table_[i].slot);
  asleep_[i] = asleep ? 1 : 0;
  disturbed_[i] = true;
  stale_ = true;
}

/// Bodies of islands that are no more advance by themselves again.
void ConstraintStage::release_bodies() {
  set_constrained(members_, false);
  members_.clear();
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
  set_constrained(held_bodies_, true);
  islands_.clear();
  constraints_.clear();
  reports_.clear();
  all_.clear();
  for (const Entry& entry : entries_)
    if (entry.constraint() != nullptr) all_.push_back(entry.constraint());
  all_.insert(all_.end(), contacts_.begin(), contacts_.end());
  if (all_.empty()) return;

  sets_.reset(table_.size());
  island_of_.assign(table_.size(), -1);
  for (const Constraint* constraint : all_) {
    const auto [a, b] = constraint->bodies();
    if (acts(a) && acts(b)) sets_.join(a, b);
  }
  number_islands();
  list_members(awake);
  list_constraints();
  set_constrained(members_, true);
  if (solvers_.size() < islands_.size()) solvers_.resize(islands_.size());
  reports_.assign(islands_.size(), {});
}

/// The root of the island that a constraint acts in; −1: it touches nothing that moves.
Index ConstraintStage::root_of(const Constraint* constraint) {
  const auto [a, b] = constraint->bodies();
  return acts(a) ? sets_.root(a) : acts(b) ? sets_.root(b) : Index{-1};
}

/// Roots that a constraint touches, in ascending order; an island's root is its first body.
void ConstraintStage::number_islands() {
  constexpr Index kTouched = 0;
  for (const Constraint* constraint : all_)
    if (const Index root = root_of(constraint); root >= 0) island_of_[static_cast<std::size_t>(root)] = kTouched;
  Index count = 0;
  for (Index& island : island_of_)
    if (island == kTouched) island = count++;
  islands_.assign(static_cast<std::size_t>(count), {});
}

/// Members of every island, ascending, one island after the other: counted, then filled in.
void ConstraintStage::list_members(std::span<const Index> awake) {
  for (const Index body : awake) {
    if (!acts(body)) continue;
    Index& island = island_of_[static_cast<std::size_t>(body)];
    island = island_of_[static_cast<std::size_t>(sets_.root(body))];  // a root comes before the others
    if (island >= 0) ++islands_[static_cast<std::size_t>(island)].members;
  }
  std::size_t count = 0;
  for (Island& island : islands_) {
    island.first_member = count;
    count += std::exchange(island.members, 0);
  }
  members_.resize(count);
  for (const Index body : awake) {
    if (!acts(body) || island_of_[static_cast<std::size_t>(body)] < 0) continue;
    Island& island = islands_[static_cast<std::size_t>(island_of_[static_cast<std::size_t>(body)])];
    members_[island.first_member + island.members++] = body;
  }
}

/// The same for the constraints, each island's in their own order.
void ConstraintStage::list_constraints() {
  const auto island_with = [&](const Constraint* constraint) -> Island* {
    const Index root = root_of(constraint);
    if (root < 0) return nullptr;
    return &islands_[static_cast<std::size_t>(island_of_[static_cast<std::size_t>(root)])];
  };
  for (const Constraint* constraint : all_)
    if (Island* island = island_with(constraint)) ++island->constraints;
  std::size_t count = 0;
  for (Island& island : islands_) {
    island.first_constraint = count;
    count += std::exchange(island.constraints, 0);
  }
  constraints_.resize(count);
  for (Constraint* constraint : all_)
    if (Island* island = island_with(constraint))
      constraints_[island->first_constraint + island->constraints++] = constraint;
}

void ConstraintStage::hold_back(std::span<const Index> bodies) {
  held_bodies_.assign(bodies.begin(), bodies.end());
  for (const Index body : bodies) held_back_[static_cast<std::size_t>(body)] = 1;
  stale_ = stale_ || !bodies.empty();
  together_report_ = {};
}

void ConstraintStage::let_go() {
  set_constrained(held_bodies_, false);
  for (const Index body : held_bodies_) held_back_[static_cast<std::size_t>(body)] = 0;
  held_bodies_.clear();
  stale_ = true;
}

double ConstraintStage::step_together(std::span<const Index> members, std::span<Constraint* const> contacts,
                                      const IslandOptions& options) {
  together_.clear();
  for (const Entry& entry : entries_)
    if (Constraint* constraint = entry.constraint())
      if (std::ranges::any_of(constraint->bodies(),
                              [&](Index body) { return std::ranges::binary_search(members, body); }))
        together_.push_back(constraint);
  together_.insert(together_.end(), contacts.begin(), contacts.end());
  IslandOptions own = options;
  own.energy_surplus = surplus_of(members);
  const IslandReport report = together_solver_.step(table_, members, together_, own);
  have_stepped(members, report);
  add_report(report, together_report_);
  return report.taken;
}

void ConstraintStage::end_together(std::span<const Index> members) {
  for (const Index body : members) {
    const ConstrainedBody& at = table_[static_cast<std::size_t>(body)];
    at.group->end_step(at.slot);
  }
}

void ConstraintStage::foresee(Jobs& jobs, const IslandOptions& options) {
  if (islands_.empty()) return;
  options_ = options;
  // One captured pointer fits in std::function's own storage, so this allocates nothing.
  jobs.parallel_for(islands_.size(), 1, [this](std::size_t begin, std::size_t end) {
    for (std::size_t island = begin; island < end; ++island) foresee_island(island);
  });
}

void ConstraintStage::refine(Jobs& jobs) {
  if (islands_.empty()) return;
  jobs.parallel_for(islands_.size(), 1, [this](std::size_t begin, std::size_t end) {
    for (std::size_t island = begin; island < end; ++island) solvers_[island].refine();
  });
}

bool ConstraintStage::are_settled() const {
  return std::all_of(solvers_.begin(), solvers_.begin() + static_cast<std::ptrdiff_t>(islands_.size()),
                     [](const IslandSolver& solver) { return solver.foreseen().status == SolveStatus::kSolved; });
}

void ConstraintStage::foresee_island(std::size_t island) {
  const Island& at = islands_[island];
  const std::span<const Index> members = members_of(at);
  IslandOptions own = options_;
  own.undisturbed =
      std::ranges::none_of(members, [&](Index body) { return disturbed_[static_cast<std::size_t>(body)] != 0; });
  own.energy_surplus = surplus_of(members);
  solvers_[island].foresee(table_, members, std::span(constraints_).subspan(at.first_constraint, at.constraints), own);
}

void ConstraintStage::finish(Jobs& jobs) {
  if (islands_.empty()) return;
  jobs.parallel_for(islands_.size(), 1, [this](std::size_t begin, std::size_t end) {
    for (std::size_t island = begin; island < end; ++island) {
      reports_[island] = solvers_[island].finish();
      have_stepped(members_of(islands_[island]), reports_[island]);
    }
  });
}

double ConstraintStage::surplus_of(std::span<const Index> members) const {
  double sum = 0.0;
  for (const Index body : members) sum += surplus_[static_cast<std::size_t>(body)];
  return sum;
}

void ConstraintStage::have_stepped(std::span<const Index> members, const IslandReport& report) {
  for (const Index body : members) {
    disturbed_[static_cast<std::size_t>(body)] = false;
    surplus_[static_cast<std::size_t>(body)] = report.energy_surplus / static_cast<double>(members.size());
  }
}

IslandReport ConstraintStage::report() const {
  IslandReport sum = together_report_;
  for (const IslandReport& r : reports_) add_report(r, sum);
  return sum;
}

StageTimes ConstraintStage::foreseen_times() const {
  StageTimes sum;
  for (std::size_t island = 0; island < islands_.size(); ++island) sum.add(solvers_[island].times());
  return sum;
}

StageTimes ConstraintStage::times() const {
  StageTimes sum;
  for (const IslandReport& r : reports_) sum.add(r.times);
  return sum;
}

void ConstraintStage::add_report(const IslandReport& r, IslandReport& sum) {
  if (r.status != SolveStatus::kSolved) sum.status = r.status;
  sum.bodies += r.bodies;
  sum.rows += r.rows;
  sum.attempts.add(r.attempts);
  sum.programs.add(r.programs);
  sum.iterations = std::max(sum.iterations, r.iterations);
  sum.newton_steps = std::max(sum.newton_steps, r.newton_steps);
  sum.change = std::max(sum.change, r.change);
  sum.energy_removed += r.energy_removed;
  sum.energy_surplus += r.energy_surplus;
}

}  // namespace limber::internal
