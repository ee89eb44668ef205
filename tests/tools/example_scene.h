/// @file example_scene.h
/// A folder with an asset and a scene that uses it, for tests of the programs.
#pragma once

#include <filesystem>
#include <string>

#include "block_model.h"
#include "limber/core/file.h"
#include "limber/model/asset.h"

namespace limber::testing {

/// A spinning block struck inside a step, and a grid of four; modes at 5, 20, 45 and 80 Hz.
inline const char* const kExampleScene = R"({
  "step": 0.002, "duration": 0.5, "gravity": [0, 0, -1],
  "assets": {"block": "block.glb"},
  "bodies": [
    {"name": "one", "asset": "block", "position": [0, 0, 3], "angular_velocity": [0, 1, 2]},
    {"name": "grid", "asset": "block", "copies": {"count": [2, 2, 1], "spacing": [3, 2, 0]}}
  ],
  "strikes": [
    {"body": "one", "time": 0.0333, "at": {"nearest": [0.2, 0.5, 3]}, "impulse": [0, -0.8, 0]},
    {"body": "grid", "time": 0.1, "at": {"vertex": 3}, "impulse": [0, 0.5, 0], "axes": "body"}
  ],
  "forces": [{"body": "grid[2]", "start": 0.2, "duration": 0.1, "at": {"triangle": 7}, "force": [0, 2, 0]}]
})";

/// Writes block.glb and scene.json.
inline void write_example_scene(const std::filesystem::path& folder) {
  write_asset(folder / "block.glb", block_asset(4));
  write_file(folder / "scene.json", kExampleScene);
}

}  // namespace limber::testing
