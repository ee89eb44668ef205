// make_scene: writes a scene of the library with its assets, to be played, drawn and opened as a page.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <filesystem>

#include "limber/core/error.h"
#include "program.h"
#include "scene_library.h"

namespace limber::scenes {
namespace {

struct Arguments {
  std::string name, folder;
  bool list = false;
  SceneSize size;
};

void declare(CLI::App& options, Arguments& a) {
  auto* name = options.add_option("SCENE", a.name, "which to make; see --list");
  options.add_flag("--list", a.list, "print the names of all and stop")->excludes(name);
  options.add_option("-o,--out", a.folder, "folder for SCENE.json and its assets; made if it is not there")
      ->type_name("DIR");
  const auto add = [&](const char* option, int& value, int most, const char* what) {
    options.add_option(option, value, what)->type_name("N")->check(CLI::Range(1, most));
  };
  add("--bodies", a.size.bodies, 100'000, "that move; default: the scene's own");
  add("--modes", a.size.modes, 1000, "of each body that bends; default: the scene's own");
  add("--vertices", a.size.vertices, 1'000'000, "of each drawn surface, about; default: the mesh's own");
}

void list(tools::Program& program) {
  for (const SceneEntry& e : scene_entries())
    program.print(fmt::format("{:<9} {:>5} bodies  {}\n", e.name, e.size.bodies, e.what));
}

void make(tools::Program& program, const Arguments& a) {
  if (a.list) return list(program);
  if (a.name.empty() || a.folder.empty()) throw InvalidArgument("expected SCENE and --out DIR, or --list");
  const std::filesystem::path folder = a.folder;
  program.progress().stage("baking");
  const LibraryScene scene = SceneLibrary().scene(a.name, a.size);
  std::filesystem::create_directories(folder);
  program.write_file(folder / (a.name + ".json"), scene.text);
  for (const auto& [name, asset] : scene.assets) program.write_file(folder / (name + ".glb"), asset_bytes(asset));
  program.print(fmt::format("{}: {} bodies, {} assets\n", (folder / (a.name + ".json")).string(),
                            scene.parsed().bodies.size(), scene.assets.size()));
}

}  // namespace
}  // namespace limber::scenes

int main(int argc, char** argv) {
  limber::tools::Program program("make_scene", "Writes a scene of limber's library as a scene file with its assets.");
  limber::scenes::Arguments arguments;
  limber::scenes::declare(program.options(), arguments);
  return program.run(argc, argv, [&] { limber::scenes::make(program, arguments); });
}
