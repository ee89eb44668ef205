/// @file scene_cost.h
/// Cost of a scene's steps, stage by stage.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "limber/constraints/contact_constraint.h"
#include "limber/core/jobs.h"
#include "limber/core/stage_times.h"
#include "limber/dynamics/contact_source.h"
#include "limber/scene/scene_file.h"
#include "limber/scene/scene_model.h"

namespace limber::tools {

/// A scene ready to be played.
struct TimedScene {
  std::string name;
  Scene scene;
  SceneModels models;
  int settling = 0;  ///< steps at the start that are not timed
};

/// Who answers contacts in place of what the scene says.
struct ContactChoice {
  enum class Finder { kOfTheScene, kContactFinder, kManifolds };
  std::optional<ContactSolver> solver{};
  Finder finder = Finder::kOfTheScene;
  int substeps = 0;  ///< of ContactSolver::kGame; 0: the scene's

  /// Null: the scene's own.
  std::unique_ptr<ContactSource> make_finder() const;
};

struct CostOptions {
  int steps = 0;          ///< timed at most; 0: all of the scene
  Jobs* jobs = nullptr;   ///< null: serial
  bool draw = true;       ///< all bodies after every step: positions, then positions and normals
  bool rehearse = false;  ///< takes the timed steps once before, from the same state
  ContactChoice contact{};
};

/// What a scene that is measured holds.
struct SceneSize {
  std::size_t bodies = 0;
  Index modes = 0;     ///< the most of a body
  Index vertices = 0;  ///< drawn, of all bodies
  double step = 0.0;   ///< s
  int steps = 0;       ///< timed
};

/// Means of a step, and sums. They do not differ between equal runs.
struct SceneWork {
  double contacts = 0.0, rows = 0.0, iterations = 0.0, newton_steps = 0.0;
  int unsettled = 0;
  long asleep = 0;  ///< at the end
};

/// Times are seconds of this thread where the work is serial, of the wall clock where it is not.
struct SceneCost {
  std::string scene;
  SceneSize size{};
  SceneWork work{};
  std::vector<double> step_seconds, position_seconds, draw_seconds;  ///< of every step; the last: normals too
  StageTimes stages;                                  ///< of all timed steps, and of drawing with normals
  double allocations = 0.0;                           ///< calls of new a step, in the last half
  std::optional<std::size_t> step_bytes, draw_bytes;  ///< memory touched by one step at the end
};

SceneCost measure(const TimedScene& timed, const CostOptions& options);

/// Steps of two scenes in turn, so that what else runs on the machine slows both alike. @return time of a step of the
/// first over one of the second, by the medians
double cost_ratio(const TimedScene& first, const TimedScene& second, int steps);

/// @param q in [0, 1] of the values in ascending order
double quantile(std::vector<double> values, double q);

}  // namespace limber::tools
