// Scenes step by step, and back.
#include "limber/scene/scene_player.h"

#include <gtest/gtest.h>

#include "block_model.h"
#include "limber/core/error.h"
#include "limber/scene/run.h"

namespace limber {
namespace {

/// Something acts in it all the time, and begins and ends in between.
const char* const kBusy = R"({"step": 0.01, "steps": 60, "assets": {"block": "block.glb"}, "contact": {},
  "statics": [{"name": "ground", "shape": {"half_space": {"offset": -1}}}],
  "bodies": [{"name": "a", "asset": "block"}, {"name": "b", "asset": "block", "position": [2, 0, 1]}],
  "strikes": [{"body": "a", "time": 0.083, "at": {"nearest": [0, 0.5, 0.5]}, "impulse": [0, 0.3, 0]},
              {"body": "b", "time": 0.41, "at": {"nearest": [2, 0.5, 0.5]}, "impulse": [0.2, 0.3, 0]}],
  "forces": [{"body": "b", "start": 0.1, "duration": 0.2, "at": {"nearest": [2, 0.5, 0]}, "force": [0, 4, 0]}],
  "handles": [{"body": "a", "start": 0.15, "duration": 0.2, "at": {"nearest": [0, 0, 0.5]},
               "motion": {"shake": {"axis": [1, 0, 0], "amplitude": 0.1, "frequency": 3}}}]})";

struct Played {
  Scene scene = parse_scene(kBusy, "busy.json", "");
  SceneModels models = make_models(scene, {{"block", testing::block_asset(3)}});
  ScenePlayer player{scene, models, scene.steps};
  void step(int count) {
    for (int i = 0; i < count; ++i) player.step();
  }
};

TEST(ScenePlayer, StepByStepIsTheWholeRun) {
  Played played;
  played.step(60);
  const RunResult run = run_scene(played.scene, played.models);
  EXPECT_EQ(played.player.world().state_hash(), run.state_hash);
  EXPECT_EQ(played.player.strikes().size(), 2u);
  EXPECT_EQ(played.player.handles().front().point, run.handles.front().point);
}

TEST(ScenePlayer, GoingBackPlaysWhatTheSceneSaysOnceMore) {
  Played whole;
  whole.step(60);
  for (const int at : {0, 8, 9, 12, 20, 34, 36, 45}) {
    Played played;
    played.step(at);
    std::vector<std::byte> state;
    played.player.save_state(state);
    played.step(60 - at);
    played.player.restore_state(state);
    EXPECT_EQ(played.player.steps_taken(), at);
    played.step(60 - at);
    EXPECT_EQ(played.player.world().state_hash(), whole.player.world().state_hash()) << "from step " << at;
  }
}

TEST(ScenePlayer, BytesOfAnotherKindAreRefused) {
  Played played;
  std::vector<std::byte> state;
  played.player.save_state(state);
  played.step(3);
  const std::uint64_t now = played.player.world().state_hash();
  for (const std::size_t size : {std::size_t{0}, std::size_t{7}, std::size_t{100}, state.size() - 1})
    EXPECT_THROW(played.player.restore_state(std::span(state).first(size)), InvalidArgument) << size;
  EXPECT_EQ(played.player.world().state_hash(), now);
}

}  // namespace
}  // namespace limber
