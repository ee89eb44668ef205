// make_scene FOLDER: a small scene with an asset, for the page's test in a browser. Its names would be markup, if a
// page took them for that.
#include <filesystem>

#include "block_model.h"
#include "limber/core/file.h"

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
    "bodies": [{"name": "</script><script>alert(2)</script>", "asset": "</script>", "position": [0, 0, 1.2]},
               {"name": "b", "asset": "</script>", "position": [0, 0.4, 2.6], "angular_velocity": [0.5, 0, 0.3]},
               {"name": "swings", "asset": "</script>", "position": [3.2, 0, 2.2]}],
    "joints": [{"b": "swings", "type": "revolute", "origin": [2.2, 0, 2.7], "axis": [0, 1, 0],
                "limits": {"rotation": [-1, 1]}}]})");
}
