// Every scene of assets/scenes by name, made small, plays: as many bodies as asked for, none lost, no energy from
// nowhere.
#include <gtest/gtest.h>

#include <cmath>

#include "limber/core/error.h"
#include "limber/scene/run.h"
#include "scene_library.h"

namespace limber::scenes {
namespace {

/// Small, but with all that the scene has: two layers of the pit, each kind of body.
int few_bodies(std::string_view name) {
  if (name == "boxes" || name == "mixed") return 11;
  if (name == "sleepers") return 104;
  if (name == "bunnies") return 1;  // two that meet while they fall take seconds
  return 3;
}

SceneLibrary& library() {
  static SceneLibrary shared;
  return shared;
}

class LibraryScenes : public ::testing::TestWithParam<std::string_view> {};

TEST_P(LibraryScenes, PlayWithAsManyBodiesAsAskedFor) {
  const bool with_bunny = GetParam() == "bunnies" || GetParam() == "bin";
  if (with_bunny && !has_bunny()) GTEST_SKIP() << "the Stanford bunny is not here: apt-get install glmark2-data";
  const LibraryScene made = library().scene(GetParam(), {.bodies = few_bodies(GetParam()), .modes = 4, .vertices = 0});
  const Scene scene = made.parsed();
  EXPECT_EQ(scene.bodies.size(), static_cast<std::size_t>(few_bodies(GetParam())));
  EXPECT_GT(scene.steps, scene_entry(GetParam()).settling);
  const RunResult r = run_scene(scene, make_models(scene, made.assets), {.steps = 45, .key_rate = 1e9});
  // Piles that fall end at the limit of contact solves: that is no failure.
  EXPECT_LE(r.constraints.failed_steps, 1);
  // Handles and forces do work, and so does what pushes bodies apart that overlap.
  const bool is_driven = !scene.handles.empty() || !scene.forces.empty() || !scene.strikes.empty();
  double scale = 0.0;
  for (const BodyTrack& body : r.trajectory.bodies) {
    EXPECT_LE(body.model->modes(), 4);
    EXPECT_LT(body.poses.back().p.norm(), 60.0) << body.name;
    EXPECT_TRUE(std::isfinite(body.energies.back().total())) << body.name;
    scale += std::abs(body.energies.front().total()) + body.model->data().mass * scene.gravity.norm();
  }
  if (!is_driven) {
    EXPECT_LE(r.energy_after, r.energy_before + 1e-6 * scale);
  }
}

INSTANTIATE_TEST_SUITE_P(All, LibraryScenes, ::testing::ValuesIn([] {
                           std::vector<std::string_view> names;
                           for (const SceneEntry& entry : scene_entries()) names.push_back(entry.name);
                           return names;
                         }()),
                         [](const auto& info) { return std::string(info.param); });

TEST(SceneLibrary, DrawnSurfacesHaveAboutAsManyVerticesAsAskedFor) {
  const LibraryScene made = library().scene("drag", {.modes = 3, .vertices = 1000});
  const Index vertices = made.assets.at("bar").bodies.front()->render().vertices();
  EXPECT_GT(vertices, 500);
  EXPECT_LT(vertices, 2000);
}

TEST(SceneLibrary, RefusesNamesAndSizesInOneLine) {
  EXPECT_THROW(library().scene("flihgt"), InvalidArgument);
  EXPECT_THROW(library().scene("flight", {.bodies = -1}), InvalidArgument);
}

}  // namespace
}  // namespace limber::scenes
