// What a scene is played without changes nothing beyond its bound, each by itself, and saves the bytes that it says.
#include "limber/scene/manifest.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "block_model.h"

namespace limber {
namespace {

constexpr Index kManifestModes = 5;

/// A block that is drawn finely and touched coarsely, with a residual compliance.
Asset full_asset() {
  ModalModelData data = testing::block_data(kManifestModes);
  data.render = testing::block_surface(64, kManifestModes);
  data.collision = testing::block_surface(8, kManifestModes);
  ResidualCompliance residual(ResidualCompliance::Form::kFull, data.collision->vertices());
  for (Index v = 0; v < residual.vertices(); ++v) residual.set(v, v, 1e-7 * Mat3::Identity());
  data.residual_compliance = residual;
  Asset asset;
  asset.bodies = {std::make_shared<const ModalModel>(std::move(data))};
  return asset;
}

Scene scene_of(const std::string& inside) {
  return parse_scene(R"({"step": 0.01, "steps": 60, "assets": {"block": "block.glb"}, )" + inside + "}",
                     "\"test.json\"", "");
}

/// Pushed in flight by the largest force that the limits tell.
Scene pushed() {
  return scene_of(R"("gravity": [0, 0, 0], "limits": {"max_force": 2, "min_displacement": 1e-3},
      "bodies": [{"name": "b", "asset": "block"}],
      "forces": [{"body": "b", "at": {"nearest": [1, 0.5, 0.5]}, "force": [0, 2, 0]}])");
}

/// Falls on the ground.
Scene fallen(const std::string& contact = "{}") {
  return scene_of("\"contact\": " + contact +
                  R"(, "statics": [{"name": "ground", "shape": {"half_space": {}}}],
      "bodies": [{"name": "a", "asset": "block", "position": [0, 0, 0.6]}])");
}

SceneUse nobody() { return {.drawn = false, .reached_into = false}; }

SceneManifest measured(const Scene& scene, const SceneUse& use = nobody()) {
  return measure_manifest(scene, {{"block", full_asset()}}, use, {.key_rate = 20.0});
}

const ManifestItem* item(const SceneManifest& manifest, const std::string& what) {
  const auto found = std::find_if(manifest.left_out.begin(), manifest.left_out.end(),
                                  [&](const ManifestItem& i) { return i.what == what; });
  return found == manifest.left_out.end() ? nullptr : &*found;
}

void expect_within_bounds(const SceneManifest& manifest) {
  for (const ManifestItem& i : manifest.left_out) {
    ASSERT_TRUE(i.bound) << i.what;
    EXPECT_LE(i.difference, *i.bound) << i.what;
    EXPECT_FALSE(i.why.empty()) << i.what;
  }
}

TEST(Manifest, WhatAPushedBodyInFlightDoesWithoutIsWithinItsBound) {
  const SceneManifest m = measured(pushed());
  expect_within_bounds(m);
  for (const char* what : {"modes", "vertex_rows", "residual_compliance", "collision_surface"}) {
    ASSERT_NE(item(m, what), nullptr) << what;
    EXPECT_GT(item(m, what)->bytes, 0) << what;
  }
  EXPECT_NE(item(m, "drawing"), nullptr);
  EXPECT_EQ(item(m, "drawn_surface"), nullptr);  // the force asks for a place on it
  // The dropped modes can be seen in the numbers, so that the bound could be broken.
  EXPECT_GT(item(m, "modes")->difference, 0.01 * *item(m, "modes")->bound);
  EXPECT_LT(m.bytes, m.bytes_with_all / 4);
  EXPECT_LE(m.difference_with_all, *item(m, "modes")->bound + 1e-6);
}

TEST(Manifest, WhatABodyThatFallsDoesWithoutMovesNothing) {
  const SceneManifest m = measured(fallen());
  expect_within_bounds(m);
  EXPECT_NE(item(m, "drawn_surface"), nullptr);
  EXPECT_GT(item(m, "drawn_surface")->bytes, 0);
  for (const char* what : {"vertex_rows", "residual_compliance", "collision_surface", "modes"})
    EXPECT_EQ(item(m, what), nullptr) << what;
  EXPECT_EQ(m.unused_methods, (std::vector<std::string>{"gap_program", "velocity_program", "penalty"}));
}

TEST(Manifest, AResidualComplianceThatContactsDoNotUseIsLeftOut) {
  const SceneManifest m = measured(fallen(R"({"residual_compliance": false})"));
  ASSERT_NE(item(m, "residual_compliance"), nullptr);
  expect_within_bounds(m);
}

TEST(Manifest, BodiesThatWearAShapeNeedNoRowsOfTheirOwn) {
  Scene scene = fallen();
  scene.bodies[0].shape = std::make_shared<const Shape>(Sphere{.radius = 0.5});
  const SceneManifest m = measured(scene);
  EXPECT_NE(item(m, "vertex_rows"), nullptr);
  EXPECT_NE(item(m, "residual_compliance"), nullptr);
  expect_within_bounds(m);
}

TEST(Manifest, WhoDrawsOrReachesInKeepsTheSurfaces) {
  const SceneManifest m = measured(fallen(), {});
  EXPECT_EQ(item(m, "drawn_surface"), nullptr);
  EXPECT_EQ(item(m, "drawing"), nullptr);
  EXPECT_EQ(m.bytes, m.bytes_with_all);
  EXPECT_EQ(item(measured(pushed(), {}), "collision_surface"), nullptr);
}

TEST(Manifest, TellsHowManyStepsSleepSaved) {
  Scene scene = fallen();
  scene.sleep = {.enabled = true, .time = 0.05, .speed = 10.0};
  const SceneManifest m = measured(scene);
  ASSERT_NE(item(m, "sleep"), nullptr);
  EXPECT_EQ(m.steps, 60);
  EXPECT_GT(m.asleep_steps, 30);
  EXPECT_LT(m.asleep_steps, 60);
}

TEST(Manifest, TheBytesOfAModelAreThoseOfItsParts) {
  const SceneModels lean = make_models(pushed(), {{"block", full_asset()}}, nobody());
  const ModelManifest& manifest = lean.manifest.front();
  EXPECT_EQ(manifest.bytes, shape_bytes(lean.of_body.front()->data()));
  for (const ModelSaving& saving : manifest.left_out) {
    SceneUse use = nobody();
    use.keep = {saving.what};
    const SceneModels with = make_models(pushed(), {{"block", full_asset()}}, use);
    EXPECT_EQ(shape_bytes(with.of_body.front()->data()) - manifest.bytes, saving.bytes) << to_string(saving.what);
  }
}

}  // namespace
}  // namespace limber
