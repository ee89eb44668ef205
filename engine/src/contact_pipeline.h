// The exact path of a step: from where bodies are to contacts, rows and islands, each solved to the law of its rows.
//
//   MotionForecast → ContactSearch → ContactRows → ConstraintStage::foresee() → is that where contacts were looked for?
//                          ↑ no, three times at most                             |
//                          └─────────────────────────────────────────────────────┘
//   then bodies move: those that nothing constrains, islands, and FastBodies by themselves
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
        forecast_(bodies, constraints, sleep),
        fast_(bodies, constraints, sleep, registry, forecast_),
        search_(bodies, constraints, sleep, registry, forecast_, fast_, rows_) {}

  /// For another source: forgets all contacts. @throws InvalidArgument, and then changes nothing
  void reset(const ContactOptions& options);

  void advance(const Substep& substep, StepEvents& events, Jobs& jobs, StageClock& clock) override;
  IslandReport report() const override;
  void forget(Index body) override { rows_.set.forget(body); }
  std::span<const DentLoad> dent_loads(Index body) const override { return rows_.set.dent_loads(body); }
  double stored_energy(Index body) const override { return rows_.set.dent_energy(constraints_->states(), body); }
  void add_to(StateHash& hash) const override { add_memory_to(hash, rows_.set, bodies_->size()); }
  void save_state(StateWriter& state) const override { rows_.set.save_state(state); }
  void restore_state(StateReader& state) override { rows_.set.restore_state(state); }

 private:
  /// As of the last substep.
  struct Noted {
    std::uint64_t wakings = 0;  // SleepStage::wakings()
    bool waited = false;        // contacts of fast bodies were remembered like those of sleepers
  };
  void foresee(const Substep& substep, Jobs& jobs, StageClock& clock);
  bool look_again(Jobs& jobs, StageClock& clock);
  void take_contacts();
  void take_contacts(std::span<const ContactPoint> found);
  void advance_free(const Substep& substep, Jobs& jobs, StageClock& clock);
  bool note_wakings();

  BodyTable* bodies_;
  ConstraintStage* constraints_;
  SleepStage* sleep_;
  ContactRegistry* registry_;
  ContactRows rows_;
  MotionForecast forecast_;
  FastBodies fast_;
  ContactSearch search_;
  Noted noted_;
  StepAttempts attempts_;  // of the last substep, beside those of islands
};

}  // namespace limber::internal
