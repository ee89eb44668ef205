#include "timed_scenes.h"

#include "limber/core/error.h"
#if LIMBER_HAS_PRECOMPUTE
#include "scene_library.h"
#endif
#if LIMBER_HAS_TBB
#include "limber/jobs_tbb/tbb_jobs.h"
#endif

namespace limber::tools {
namespace {

TimedScene from_file(const std::string& file, const SceneScale& scale) {
  if (scale.bodies != 0 || scale.modes != 0 || scale.vertices != 0)
    throw InvalidArgument("--bodies, --modes and --vertices: \"" + file + "\" is a file, whose scene has its own size");
  TimedScene timed{.name = {}, .scene = read_scene(file), .models = {}};
  timed.name = timed.scene.name;
  timed.models = load_models(timed.scene);
  return timed;
}

}  // namespace

#if LIMBER_HAS_PRECOMPUTE

struct SceneSource::Library {
  scenes::SceneLibrary scenes;
};
SceneSource::SceneSource() : library_(std::make_unique<Library>()) {}

TimedScene SceneSource::scene(const std::string& name, const SceneScale& scale) {
  if (name.ends_with(".json")) return from_file(name, scale);
  const scenes::LibraryScene made =
      library_->scenes.scene(name, {.bodies = scale.bodies, .modes = scale.modes, .vertices = scale.vertices});
  TimedScene timed{.name = name, .scene = made.parsed(), .models = {}, .settling = scenes::scene_entry(name).settling};
  timed.models = make_models(timed.scene, made.assets);
  return timed;
}

std::vector<std::string> usual_scenes() {
  std::vector<std::string> usual;
  for (const scenes::SceneEntry& entry : scenes::scene_entries())
    if (entry.name != "bin" && (entry.name != "bunnies" || scenes::has_bunny())) usual.emplace_back(entry.name);
  return usual;
}

#else

struct SceneSource::Library {};
SceneSource::SceneSource() = default;

TimedScene SceneSource::scene(const std::string& name, const SceneScale& scale) {
  if (name.ends_with(".json")) return from_file(name, scale);
  throw InvalidArgument("--scene: is \"" + name +
                        "\", expected FILE.json: limber was built without the offline half, which bakes the library");
}

std::vector<std::string> usual_scenes() {
  throw InvalidArgument("--scene: expected FILE.json: limber was built without the offline half");
}

#endif

SceneSource::~SceneSource() = default;

std::unique_ptr<Jobs> jobs_of(int threads) {
  if (threads == 1) return nullptr;
#if LIMBER_HAS_TBB
  return std::make_unique<TbbJobs>(threads);
#else
  throw InvalidArgument("--threads: is " + std::to_string(threads) + ", expected 1: limber was built without oneTBB");
#endif
}

}  // namespace limber::tools
