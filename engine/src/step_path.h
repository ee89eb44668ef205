// The door between World's step, and what finds contacts, solves the islands of a step and moves its bodies.
//
//   World::step():  loads of each substep → StepPath::advance() → report, events → sleep
//
// One path is in force for each contact source (World::set_contact_source). It owns what its contacts remember.
#pragma once

#include <span>

#include "limber/constraints/contact_constraint.h"
#include "limber/constraints/island_solver.h"
#include "limber/core/jobs.h"
#include "limber/core/stage_times.h"
#include "state_hash.h"
#include "step_events.h"

namespace limber::internal {

/// One of the equal parts that a step is taken in (WorldOptions::substeps).
struct Substep {
  int index = 0;                ///< in its step, from 0
  double length = 0.0;          ///< s
  Vec3 gravity = Vec3::Zero();  ///< m/s², world
};

class StepPath {
 public:
  virtual ~StepPath() = default;

  /// Moves all bodies that are awake from the start of a substep to its end, together with all that ties them. Bodies
  /// that are touched wake. Once warm, allocates nothing.
  /// @param events is told of the contacts of the substep. @param clock laps over all that is done
  virtual void advance(const Substep& substep, StepEvents& events, Jobs& jobs, StageClock& clock) = 0;
  /// Sums over the islands of the last substep.
  virtual IslandReport report() const = 0;

  /// A body that is removed: what its contacts remember goes with it.
  virtual void forget(Index body) = 0;
  /// The forces that dent a body's collision surface beyond its modes, as the last substep left them.
  virtual std::span<const DentLoad> dent_loads(Index body) const = 0;
  /// Energy that a body's contacts store, beside that of its modes, J.
  virtual double stored_energy(Index body) const = 0;

  // The contacts' memory from step to step. Between steps.
  virtual void add_to(StateHash& hash) const = 0;
  virtual void save_state(StateWriter& state) const = 0;
  virtual void restore_state(StateReader& state) = 0;
};

}  // namespace limber::internal
