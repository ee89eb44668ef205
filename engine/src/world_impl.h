// A World's parts: seven rooms, each of which knows the others only by what it is given.
//
//   BodyTable         bodies by number: ids, shapes, groups of one model
//   ExactPath         from where bodies are to contacts, rows and islands: the exact path of a step (StepPath)
//   GamePath          the path by small steps
//   ConstraintStage   handles and joints, and the islands that they and contacts make
//   SleepStage        who is at rest
//   Drawing           surfaces between two steps
//   Snapshot          all of it as bytes, and back
//
// ContactRegistry stands between bodies and the contact source, StepParts between a step and its substeps. World's own
// functions, which check what they are given, are in world.cpp (bodies, time, loads), world_constraints.cpp and
// world_state.cpp.
#pragma once

#include "body_queries.h"
#include "body_table.h"
#include "constraint_stage.h"
#include "contact_registry.h"
#include "drawing.h"
#include "exact_path.h"
#include "game_path.h"
#include "limber/engine/world.h"
#include "rigid_models.h"
#include "sensor_stage.h"
#include "sleep_stage.h"
#include "snapshot.h"
#include "step_events.h"
#include "step_parts.h"
#include "world_time.h"

namespace limber {

struct World::Impl {
  /// Results that a step tells.
  struct LastStep {
    ConstraintReport report;
    internal::StepEvents events;
  };

  Impl(const WorldOptions& wanted, Jobs& lent)
      : options(wanted),
        jobs(lent),
        bodies(wanted.half_precision),
        queries(bodies),
        sensors(bodies, queries),
        sleep(constraints),
        registry(bodies),
        contacts(bodies, constraints, sleep, registry),
        game(bodies, constraints, sleep, registry),
        drawing(bodies),
        parts(constraints, wanted.substeps, wanted.step) {}

  /// That of the contact solver in force.
  internal::StepPath& path() {
    if (solver == ContactSolver::kGame) return game;
    return contacts;
  }
  internal::Snapshot snapshot() {
    return internal::Snapshot(
        {options, time, bodies, constraints, sleep, parts, last.events, sensors, registry, path(), solver, drawing});
  }
  void add_to_report(const IslandReport& substep);

  WorldOptions options;
  Jobs& jobs;
  internal::BodyTable bodies;
  internal::BodyQueries queries;
  internal::SensorStage sensors;
  internal::RigidModels rigid;
  internal::ConstraintStage constraints;  // bodies by their entries' indices
  internal::SleepStage sleep;
  internal::ContactRegistry registry;
  internal::ExactPath contacts;
  internal::GamePath game;
  ContactSolver solver = kDefaultContactSolver;
  internal::Drawing drawing;
  internal::StepParts parts;
  internal::WorldTime time;
  LastStep last;
  StageTimes* stage_times = nullptr;
};

}  // namespace limber
