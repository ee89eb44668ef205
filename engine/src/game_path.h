// The path of a step by small steps: contacts once, then substeps over all rows (small_steps.h).
//
//   ContactSearch → ContactRows → SmallStepSolver        bodies that nothing touches move exactly
//
// Work is bounded: nothing is looked at twice but where sleepers wake.
#pragma once

#include <cstdint>
#include <vector>

#include "body_table.h"
#include "constraint_stage.h"
#include "contact_registry.h"
#include "contact_rows.h"
#include "contact_search.h"
#include "limber/constraints/small_steps.h"
#include "sleep_stage.h"
#include "step_path.h"

namespace limber::internal {

class GamePath final : public StepPath {
 public:
  GamePath(BodyTable& bodies, ConstraintStage& constraints, SleepStage& sleep, ContactRegistry& registry)
      : bodies_(&bodies),
        constraints_(&constraints),
        sleep_(&sleep),
        registry_(&registry),
        search_(bodies, sleep, registry) {}

  /// For another source: forgets all contacts. @throws InvalidArgument, and then changes nothing
  void reset(const ContactOptions& options);

  void advance(const Substep& substep, StepEvents& events, Jobs& jobs, StageClock& clock) override;
  IslandReport report() const override { return report_; }
  void forget(Index body) override { rows_.set.forget(body); }
  std::span<const DentLoad> dent_loads(Index body) const override { return rows_.set.dent_loads(body); }
  double stored_energy(Index body) const override { return rows_.set.dent_energy(constraints_->states(), body); }
  void add_to(StateHash& hash) const override { add_memory_to(hash, rows_.set, bodies_->size()); }
  void save_state(StateWriter& state) const override;
  void restore_state(StateReader& state) override;

 private:
  void list_members();
  void list_constraints();
  void solve(const Substep& substep, Jobs& jobs);

  BodyTable* bodies_;
  ConstraintStage* constraints_;
  SleepStage* sleep_;
  ContactRegistry* registry_;
  ContactRows rows_;
  ContactSearch search_;
  SmallStepSolver solver_;
  std::vector<Index> members_;             // all that rows touch and that move, ascending
  std::vector<Constraint*> constraining_;  // handles and joints that act
  std::uint64_t wakings_ = 0;              // SleepStage::wakings() of the last substep
  IslandReport report_;
};

}  // namespace limber::internal
