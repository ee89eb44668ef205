// make_scene FOLDER: a small scene with an asset, and a model with joints to pose, for the page's tests in a browser.
// Names would be markup, if a page took them for that.
#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "block_model.h"
#include "limber/core/file.h"

namespace {

/// Two bars end to end along x, 1 × 0.2 × 0.2, faces of each with 4 × 1 quads along it.
std::string bars() {
  std::string text;
  int first = 1;
  for (const double start : {0.0, 1.02}) {
    for (int i = 0; i <= 4; ++i)
      for (const auto& [y, z] : std::vector<std::array<double, 2>>{{0.0, 0.0}, {0.2, 0.0}, {0.2, 0.2}, {0.0, 0.2}})
        text += "v " + std::to_string(start + 0.25 * i) + " " + std::to_string(y) + " " + std::to_string(z) + "\n";
    const auto quad = [&](int a, int b, int c, int d) {
      text += "f";
      for (const int v : {a, b, c, d}) text += " " + std::to_string(first + v);
      text += "\n";
    };
    for (int i = 0; i < 4; ++i)
      for (int k = 0; k < 4; ++k) quad(4 * i + k, 4 * i + (k + 1) % 4, 4 * i + 4 + (k + 1) % 4, 4 * i + 4 + k);
    quad(3, 2, 1, 0);
    quad(16, 17, 18, 19);
    first += 20;
  }
  return text;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const std::filesystem::path folder = argv[1];
  std::filesystem::create_directories(folder);
  limber::ModalModelData data = limber::testing::block_data(4, "<img src=x onerror=alert(1)>");
  limber::write_asset(folder / "block.glb",
                      {.bodies = {std::make_shared<const limber::ModalModel>(std::move(data))}, .provenance = {}});
  limber::write_file(folder / "markup.json", R"({"step": 0.016666666666666666, "duration": 60, "contact": {},
    "assets": {"</script>": "block.glb"},
    "statics": [{"name": "<b>ground</b>", "shape": {"half_space": {}}},
                {"name": "ball", "shape": {"sphere": {"radius": 0.6}}, "position": [0, 1.5, 0.6]}],
    "sensors": [{"name": "<b>gate</b>", "shape": {"box": {"half_extents": [1.5, 1.5, 0.3]}}, "position": [0, 0, 0.31]},
                {"name": "high", "shape": {"sphere": {"radius": 0.5}}, "position": [-3, 0, 3]}],
    "bodies": [{"name": "</script><script>alert(2)</script>", "asset": "</script>", "position": [0, 0, 1.2]},
               {"name": "b", "asset": "</script>", "position": [0, 0.4, 2.6], "angular_velocity": [0.5, 0, 0.3]},
               {"name": "swings", "asset": "</script>", "position": [3.2, 0, 2.2]}],
    "joints": [{"b": "swings", "type": "revolute", "origin": [2.2, 0, 2.7], "axis": [0, 1, 0],
                "limits": {"rotation": [-1, 1]}}]})");
  limber::write_file(folder / "bars.obj", bars());
  limber::write_file(folder / "bars.joints.json", R"({"components": [{"name": "<b>base</b>", "faces": [[0, 18]]},
      {"name": "arm", "faces": [[18, 18]]}],
    "joints": [{"a": 0, "b": 1, "type": "revolute", "origin": [1.01, 0.1, 0.1], "axis": [0, 1, 0],
                "limits": {"rotation": [-1, 1]}}]})");
}
