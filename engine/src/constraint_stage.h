// The constraints of a world: what they are, which bodies they tie together, and their step.
#pragma once

#include <memory>
#include <vector>

#include "constraint_table.h"
#include "island_partition.h"
#include "limber/constraints/handle.h"
#include "limber/constraints/island_solver.h"
#include "limber/constraints/joint_constraint.h"
#include "limber/core/jobs.h"

namespace limber::internal {

class ConstraintStage {
 public:
  using Entry = ConstraintTable::Entry;

  // Bodies, by number ---------------------------------------------------------------------------------------------
  void set_body(Index body, const ConstrainedBody& at);
  /// Forgets it, and all constraints on it.
  void remove_body(Index body);
  BodyStates states() const { return BodyStates(table_); }
  std::span<const ConstrainedBody> table() const { return table_; }
  bool moves(Index body) const { return body >= 0 && table_[static_cast<std::size_t>(body)].group != nullptr; }
  /// Stops a body, or lets it go on: one that sleeps is no member of any island.
  void set_asleep(Index body, bool asleep);
  /// How the islands' steps are taken from now on. Between steps.
  void set_island_solver(IslandSolverFactory make);
  /// Its velocity, place or shape was changed from outside.
  void disturb(Index body) { notes_[static_cast<std::size_t>(body)].disturbed = 1; }

  // Constraints, by place -----------------------------------------------------------------------------------------
  std::uint32_t add(std::unique_ptr<Handle> handle);
  std::uint32_t add(std::unique_ptr<JointConstraint> joint);
  void remove(std::uint32_t place);
  const std::vector<Entry>& entries() const { return constraints_.entries(); }
  void set_user_data(std::uint32_t place, std::uint64_t data) { constraints_.set_user_data(place, data); }
  void set_strength(std::uint32_t place, double newtons) { constraints_.set_strength(place, newtons); }
  void disturb_bodies_of(std::uint32_t place);

  /// Constraints of the coming step alone, beside the others: they stay the caller's.
  void set_contacts(std::span<Constraint* const> contacts);
  /// Islands of the bodies that constraints tie together; those bodies are left alone by BodyGroup::advance().
  /// @param awake all that move and do not sleep, ascending
  void find_islands(std::span<const Index> awake);
  /// Advances them by one step.
  void step(Jobs& jobs, const IslandOptions& options);

  // All constraints, and what the coming step knows of bodies. Between steps.
  /// @param bodies how many, of those that set_body() named
  void save_state(std::size_t bodies, StateWriter& state) const;
  /// Constraints made since are removed, those removed since made again.
  void restore_state(std::size_t bodies, StateReader& state);

  /// Sums over the islands of the last step.
  IslandReport report() const;
  /// Time that the islands' threads spent on stages in step(), with IslandOptions::timed.
  StageTimes times() const;
  int island_count() const { return static_cast<int>(islands_.size()); }
  /// The bodies of one island, ascending.
  std::span<const Index> members(int island) const { return islands_.members(static_cast<std::size_t>(island)); }
  /// Whether a body is in an island.
  bool constrained(Index body) const { return islands_.contains(body); }

 private:
  /// State of a body between steps. Different threads write those of different bodies.
  struct Notes {
    char asleep = 0;
    char disturbed = 0;
    double surplus = 0.0;  // J: its share of its island's
  };
  std::uint32_t place(Entry&& entry);
  void step_island(std::size_t island);
  void release_bodies();
  double surplus_of(std::span<const Index> members) const;
  void have_stepped(std::span<const Index> members, const IslandReport& report);
  void set_constrained(std::span<const Index> bodies, bool constrained);
  static void add_report(const IslandReport& report, IslandReport& sum);

  std::vector<ConstrainedBody> table_;
  std::vector<Notes> notes_;  // as table_
  ConstraintTable constraints_;
  std::vector<Constraint*> contacts_;
  std::vector<Constraint*> all_;  // entries and contacts, in this order
  IslandPartition islands_;
  bool stale_ = true;  // the islands
  IslandSolverFactory make_solver_ = make_island_solver;
  std::vector<std::unique_ptr<IslandSolver>> solvers_;  // one per island
  std::vector<IslandReport> reports_;
  IslandOptions options_;
};

}  // namespace limber::internal
