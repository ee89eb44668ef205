/// @file timed_scenes.h
/// Scenes to be timed: of the library where the offline half is built, which bakes their bodies, and from files.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "limber/core/jobs.h"
#include "scene_cost.h"

namespace limber::tools {

/// How large a scene of the library is made; 0: its own size.
struct SceneScale {
  int bodies = 0, modes = 0, vertices = 0;
};

/// Keeps what it has baked.
class SceneSource {
 public:
  SceneSource();
  ~SceneSource();
  SceneSource(const SceneSource&) = delete;
  SceneSource& operator=(const SceneSource&) = delete;
  /// @param name of the library, or a file whose name ends in ".json", which has its own size
  /// @throws InvalidArgument, InputError
  TimedScene scene(const std::string& name, const SceneScale& scale = {});

 private:
  struct Library;
  std::unique_ptr<Library> library_;
};

/// Scenes of the library that take seconds.
std::vector<std::string> usual_scenes();

/// Null for one thread. @throws InvalidArgument where limber is built without oneTBB
std::unique_ptr<Jobs> jobs_of(int threads);

}  // namespace limber::tools
