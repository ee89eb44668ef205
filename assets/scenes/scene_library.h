/// @file scene_library.h
/// Scenes by name, drawn and baked by formulae at any size: what tests, benchmarks, examples and the page share
/// (README.md beside this file). As files by make_scene; never installed.
#pragma once

#include <map>
#include <span>
#include <string>
#include <string_view>
#include <tuple>

#include "limber/mesh/tet_mesh.h"
#include "limber/model/asset.h"
#include "limber/scene/scene_file.h"

namespace limber::scenes {

/// How large a scene is made; 0: as it is by itself.
struct SceneSize {
  int bodies = 0;    ///< that move
  int modes = 0;     ///< of each body that bends
  int vertices = 0;  ///< of each drawn surface, about
};

struct SceneEntry {
  std::string_view name, what;  ///< the latter in a few words
  SceneSize size;               ///< its own
  int settling = 0;             ///< steps at its start that are no part of what it shows
};
std::span<const SceneEntry> scene_entries();
/// @throws InvalidArgument naming the known ones
const SceneEntry& scene_entry(std::string_view name);

struct LibraryScene {
  std::string name, text;               ///< the latter: the scene file, whose assets are NAME.glb beside it
  std::map<std::string, Asset> assets;  ///< by the scene's names
  Scene parsed() const;
};

/// Makes scenes, and bakes each body once.
class SceneLibrary {
 public:
  /// @throws InvalidArgument for names and sizes; InputError where the Stanford bunny is wanted and Debian's package
  /// glmark2-data is not there
  LibraryScene scene(std::string_view name, const SceneSize& size = {});

 private:
  /// A body of the library: "box", "brick", "bar", "link", "bowl", "bunny".
  const Asset& body(const std::string& name, int modes, int vertices);
  std::map<std::tuple<std::string, int, int>, Asset> baked_;
};

/// Whether Debian's Stanford bunny is on this machine.
bool has_bunny();

}  // namespace limber::scenes
