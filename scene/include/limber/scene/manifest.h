/// @file limber/scene/manifest.h
/// Parts that are left out when a scene is played, with reason and saving: found by playing it with each put back.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "limber/scene/run.h"
#include "limber/scene/scene_model.h"

namespace limber {

/// One thing that is left out, of all models together, and the scene played with it put back.
struct ManifestItem {
  std::string what;        ///< of LeftOut; or "drawing", "sleep"
  std::string why;         ///< of the first model; what differs for others stands in ModelManifest::left_out
  std::int64_t bytes = 0;  ///< more in memory
  double seconds =
      0.0;  ///< of the processor, more a step; less than 0: the clock's noise, or it costs time to leave it out
  double difference = 0.0;  ///< m, the most by which a vertex is elsewhere at a key
  /// m, what the difference may be. None: not known, where modes are dropped and the scene tells no largest force, or
  /// more than one point is pushed.
  std::optional<double> bound{};
};

struct SceneManifest {
  std::vector<ManifestItem> left_out;
  std::vector<std::string> unused_methods;    ///< contact methods; they hold no memory until they are used
  std::int64_t steps = 0, asleep_steps = 0;   ///< of all bodies together; the latter: that sleeping bodies did not take
  std::size_t bytes = 0, bytes_with_all = 0;  ///< of the models
  double seconds = 0.0, seconds_with_all = 0.0;  ///< of the processor, a step
  double difference_with_all = 0.0;              ///< m, as in an item
};

/// Plays the scene once as it is, once with everything put back and once for each item, and measures.
/// @param assets one per key of Scene::assets. @param use as in make_models(); what it keeps is no item
/// @param options of each run; keys are where positions are compared
/// @throws as run_scene()
SceneManifest measure_manifest(const Scene& scene, const std::map<std::string, Asset>& assets, const SceneUse& use,
                               const RunOptions& options = {});

}  // namespace limber
