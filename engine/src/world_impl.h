// A World's parts: eight rooms, each of which knows the others only by what it is given.
//
//   BodyTable         bodies by number: ids, shapes, groups of one model
//   BodyProbes        queries and sensors, which move nothing
//   ContactPaths      who meets, and the two paths of a step from where bodies are to contacts, rows and islands
//   ConstraintStage   handles and joints, and the islands that they and contacts make
//   SleepStage        who is at rest
//   Drawing           surfaces between two steps
//   Snapshot          all of it as bytes, and back
//
// Substeps stands between a step and its substeps. World's own
// functions, which check what they are given, are in world.cpp (bodies, time, loads), world_constraints.cpp and
// world_state.cpp.
#pragma once

#include "body_probes.h"
#include "body_table.h"
#include "constraint_stage.h"
#include "contact_paths.h"
#include "drawing.h"
#include "hit_events.h"
#include "joint_breaks.h"
#include "limber/engine/world.h"
#include "rigid_models.h"
#include "sleep_stage.h"
#include "snapshot.h"
#include "step_events.h"
#include "substeps.h"
#include "world_time.h"

namespace limber {

struct World::Impl {
  /// What a step tells.
  struct LastStep {
    ConstraintReport report;
    internal::StepEvents events;
    internal::HitEvents hits;
    internal::JointBreaks breaks;
    StageTimes* times = nullptr;  // written if not null
  };
  Impl(const WorldOptions& wanted, Jobs& lent)
      : options(wanted),
        jobs(lent),
        bodies(wanted.half_precision),
        probes(bodies),
        sleep(constraints),
        paths(bodies, constraints, sleep),
        drawing(bodies),
        parts(constraints, wanted.substeps, wanted.step) {}

  internal::Snapshot snapshot() {
    return internal::Snapshot({options, time, bodies, constraints, sleep, parts, last.events, last.breaks,
                               probes.sensors, paths.registry, paths.in_force(), paths.solver, drawing});
  }
  void add_to_report(const IslandReport& substep);
  /// World::add_body(). @param parts of a compound, in the frame of the body: what others meet of it; empty: of others
  BodyId add_moving(std::shared_ptr<const ModalModel> model, const BodyPlacement& placement,
                    std::span<const ShapePart> parts);
  void add_part(Index body, const ShapePart& part);
  void remove(Index entry);
  void remove_joint(std::uint32_t place);

  WorldOptions options;
  Jobs& jobs;
  internal::BodyTable bodies;
  internal::BodyProbes probes;
  internal::RigidModels rigid;
  internal::ConstraintStage constraints;  // bodies by their entries' indices
  internal::SleepStage sleep;
  internal::ContactPaths paths;
  internal::Drawing drawing;
  internal::Substeps parts;
  internal::WorldTime time;
  LastStep last;
};

}  // namespace limber
