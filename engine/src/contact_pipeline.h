// The exact path of a step: contacts once, then islands, each solved to the law of its rows.
//
//   ContactSearch → ContactRows → ConstraintStage        bodies that nothing constrains move exactly
#pragma once

#include <cstdint>

#include "contact_rows.h"
#include "contact_search.h"
#include "step_path.h"

namespace limber::internal {

class ContactPipeline final : public StepPath {
 public:
  ContactPipeline(BodyTable& bodies, ConstraintStage& constraints, SleepStage& sleep, ContactRegistry& registry)
      : bodies_(&bodies),
        constraints_(&constraints),
        sleep_(&sleep),
        registry_(&registry),
        search_(bodies, sleep, registry) {}

  /// For another source: forgets all contacts. @throws InvalidArgument, and then changes nothing
  void reset(const ContactOptions& options);

  void advance(const Substep& substep, StepEvents& events, Jobs& jobs, StageClock& clock) override;
  IslandReport report() const override { return constraints_->report(); }
  void forget(Index body) override { rows_.set.forget(body); }
  std::span<const DentLoad> dent_loads(Index body) const override { return rows_.set.dent_loads(body); }
  double stored_energy(Index body) const override { return rows_.set.dent_energy(constraints_->states(), body); }
  void add_to(StateHash& hash) const override { add_memory_to(hash, rows_.set, bodies_->size()); }
  void save_state(StateWriter& state) const override { rows_.set.save_state(state); }
  void restore_state(StateReader& state) override { rows_.set.restore_state(state); }

 private:
  BodyTable* bodies_;
  ConstraintStage* constraints_;
  SleepStage* sleep_;
  ContactRegistry* registry_;
  ContactRows rows_;
  ContactSearch search_;
  std::uint64_t wakings_ = 0;  // SleepStage::wakings() of the last substep
};

}  // namespace limber::internal
