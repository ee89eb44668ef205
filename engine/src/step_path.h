// How a substep takes all bodies from its start to its end: contacts once, then what solves their rows together with
// handles and joints.
//
//   World::step():  loads of each substep → StepPath::advance() → report, events → sleep
//   advance():      ContactSearch → ContactRows → solve()        bodies that nothing constrains move exactly
//
// One path is in force for each contact source (World::set_contact_source). It owns what its contacts remember.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "body_table.h"
#include "constraint_stage.h"
#include "contact_registry.h"
#include "contact_rows.h"
#include "contact_search.h"
#include "limber/constraints/contact_constraint.h"
#include "limber/constraints/island_solver.h"
#include "limber/core/jobs.h"
#include "limber/core/stage_times.h"
#include "sleep_stage.h"
#include "state_hash.h"
#include "step_events.h"
#include "substep.h"

namespace limber::internal {

class StepPath {
 public:
  StepPath(BodyTable& bodies, ConstraintStage& constraints, SleepStage& sleep, ContactRegistry& registry)
      : bodies_(&bodies),
        constraints_(&constraints),
        sleep_(&sleep),
        registry_(&registry),
        search_(bodies, sleep, registry) {}
  virtual ~StepPath() = default;
  StepPath(const StepPath&) = delete;
  StepPath& operator=(const StepPath&) = delete;

  /// For another source: forgets all contacts. @throws InvalidArgument, and then changes nothing
  void reset(const ContactOptions& options);

  /// Moves all bodies that are awake from the start of a substep to its end, together with all that ties them. Bodies
  /// that are touched wake. Once warm, allocates nothing.
  /// @param events is told of the contacts of the substep. @param clock laps over all that is done
  void advance(const Substep& substep, StepEvents& events, Jobs& jobs, StageClock& clock);
  /// Sums over the islands of the last substep.
  const IslandReport& report() const { return report_; }

  /// A body that is removed: what its contacts remember goes with it.
  void forget(Index body) { rows_.set.forget(body); }
  /// The forces that indent a body's collision surface beyond its modes, as the last substep left them.
  std::span<const IndentationLoad> indentation_loads(Index body) const { return rows_.set.indentation_loads(body); }
  /// Energy that a body's contacts store, beside that of its modes, J.
  double stored_energy(Index body) const { return rows_.set.indentation_energy(constraints_->states(), body); }

  /// Bodies' surfaces run otherwise from now on.
  void tell_surfaces() { rows_.stale = true; }

  // The contacts' memory from step to step. Between steps.
  void add_to(StateHash& hash) const { add_memory_to(hash, rows_.set, bodies_->size()); }
  virtual void save_state(StateWriter& state) const { rows_.set.save_state(state); }
  virtual void restore_state(StateReader& state) {
    rows_.set.restore_state(state);
    tell_surfaces();
  }

 protected:
  /// In how many parts velocities change over a substep.
  virtual int parts() const { return 1; }
  /// Moves the members to the substep's end.
  virtual IslandReport solve(const Substep& substep, Jobs& jobs, StageClock& clock) = 0;
  virtual void clear() {}

  ConstraintStage& constraints() const { return *constraints_; }
  ContactRows& rows() { return rows_; }
  const ContactRows& rows() const { return rows_; }
  const ContactSearch& search() const { return search_; }
  /// All bodies that rows touch and that move, ascending.
  std::span<const Index> members() const { return members_; }

 private:
  BodyTable* bodies_;
  ConstraintStage* constraints_;
  SleepStage* sleep_;
  ContactRegistry* registry_;
  ContactRows rows_;
  ContactSearch search_;
  std::vector<Index> members_;
  std::uint64_t wakings_ = 0;  // SleepStage::wakings() of the last substep
  IslandReport report_;
};

}  // namespace limber::internal
