// All that coming steps depend on as bytes, and back (World::save_state).
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "body_table.h"
#include "constraint_stage.h"
#include "contact_registry.h"
#include "drawing.h"
#include "joint_breaks.h"
#include "limber/core/state_archive.h"
#include "sensor_stage.h"
#include "sleep_stage.h"
#include "step_events.h"
#include "step_path.h"
#include "substeps.h"
#include "world_time.h"

namespace limber::internal {

class Snapshot {
 public:
  /// Whose states they are.
  struct Rooms {
    WorldOptions& options;  // of which the step and gravity are
    WorldTime& time;
    BodyTable& bodies;
    ConstraintStage& constraints;
    SleepStage& sleep;
    Substeps& parts;
    StepEvents& events;
    JointBreaks& breaks;
    SensorStage& sensors;
    ContactRegistry& registry;
    StepPath& path;
    ContactSolver solver;  // that of the path
    Drawing& drawing;
  };
  explicit Snapshot(const Rooms& rooms) : rooms_(rooms) {}

  /// Replaces the bytes.
  void save(std::vector<std::byte>& bytes) const;

  // Restoring: open(), check_structure(), then the bodies it returns are removed, then restore_motion(). The first two
  // throw InvalidArgument in the name of World::restore_state, and change nothing.
  static StateReader open(std::span<const std::byte> bytes);
  /// @return bodies that have come since
  std::vector<BodyId> check_structure(StateReader& state) const;
  void restore_motion(StateReader& state);

 private:
  void save_structure(StateWriter& state) const;
  BodyId check_body(std::size_t i, bool saved, StateReader& state) const;
  void save_motion(StateWriter& state) const;

  Rooms rooms_;
};

}  // namespace limber::internal
