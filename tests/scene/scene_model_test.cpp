// Lean models: what a scene does not need is left out, told in the manifest, and what stays is unchanged.
#include "limber/scene/scene_model.h"

#include <gtest/gtest.h>

#include "block_model.h"
#include "limber/core/error.h"

namespace limber {
namespace {

using testing::block_asset;

Scene model_scene(const std::string& limits, const std::string& bodies = R"({"name": "b", "asset": "block"})") {
  return parse_scene(R"({"step": 0.01, "steps": 1, "contact": {}, "assets": {"block": "some/block.glb"}, "bodies": [)" +
                         bodies + "]" + (limits.empty() ? "" : ", \"limits\": " + limits) + "}",
                     "\"test.json\"", "");
}

TEST(SceneModel, WithoutLimitsTheModelIsTheAssetsOwn) {
  const Asset asset = block_asset(4);
  const SceneModels models = make_models(model_scene(""), {{"block", asset}});
  EXPECT_EQ(models.of_body[0], asset.bodies[0]);
  ASSERT_EQ(models.manifest.size(), 1u);
  EXPECT_TRUE(models.manifest[0].dropped.empty());
  EXPECT_EQ(models.manifest[0].bytes, models.manifest[0].bytes_in_asset);
}

TEST(SceneModel, ACameraTellsTheSmallestDisplacementByHalfAPixel) {
  // 90 degrees at 4 m: 8 m over 1,000 pixels.
  const Scene scene = model_scene(R"({"max_force": 1, "camera": {"distance": 4, "degrees": 90, "height": 1000}})");
  EXPECT_NEAR(scene.limits->min_displacement, 0.004, 1e-12);
  EXPECT_THROW(model_scene(R"({"max_force": 1, "camera": {"distance": 4, "degrees": 180, "height": 1000}})"),
               InputError);
  EXPECT_THROW(model_scene(R"({"camera": {"distance": 4, "degrees": 90, "height": 1000}})"), InputError);
  EXPECT_THROW(
      model_scene(R"({"max_force": 1, "min_displacement": 1, "camera": {"distance": 4, "degrees": 90, "height": 1}})"),
      InputError);
  EXPECT_THROW(visible_displacement(0.0, 1.0, 100), InvalidArgument);
}

TEST(SceneModel, ModesFasterThanTheFramesAreLeftOutWithTheirReason) {
  // 5, 20, 45, 80 Hz against half of 60 Hz.
  const SceneModels models = make_models(model_scene(R"({"frame_rate": 60})"), {{"block", block_asset(4)}});
  const ModelManifest& m = models.manifest[0];
  EXPECT_EQ(m.modes_in_asset, 4);
  EXPECT_EQ(m.modes, 2);
  ASSERT_EQ(m.dropped.size(), 2u);
  EXPECT_EQ(m.dropped[0].mode, 2);
  EXPECT_EQ(m.dropped[0].reason, DropReason::kTooFast);
  EXPECT_NEAR(m.dropped[0].value, 45.0, 0.01);
  EXPECT_EQ(m.dropped[0].limit, 30.0);
  EXPECT_EQ(2 * m.multiply_adds, m.multiply_adds_in_asset);
  EXPECT_LT(m.bytes, m.bytes_in_asset);
  EXPECT_EQ(m.file, "block.glb");
}

TEST(SceneModel, ModesThatTheLargestForceCannotShowAreLeftOut) {
  // Mode i shows at most 2 F |w|²/λ with |w|² = 2/3: 6.75e-4 and 4.2e-5 m for 0.5 N and the first two modes.
  const SceneModels models =
      make_models(model_scene(R"({"max_force": 0.5, "min_displacement": 1e-4})"), {{"block", block_asset(4)}});
  EXPECT_EQ(models.manifest[0].modes, 1);
  EXPECT_NEAR(models.manifest[0].dropped[0].value,
              2.0 * 0.5 * (2.0 / 3.0) / (1600.0 * std::numbers::pi * std::numbers::pi), 1e-10);
}

TEST(SceneModel, AReducedModelKeepsTheRestBitForBit) {
  const auto model = testing::block_model(5);
  const std::vector<Index> kept{1, 4};
  const auto lean = reduce_model(*model, kept);
  EXPECT_EQ(lean->data().mass, model->data().mass);
  EXPECT_EQ(lean->data().inertia, model->data().inertia);
  EXPECT_EQ(lean->data().origin_in_input, model->data().origin_in_input);
  for (Index i = 0; i < 2; ++i) {
    const Index of = kept[static_cast<std::size_t>(i)];
    EXPECT_EQ(lean->frequency_hz(i), model->frequency_hz(of));
    for (Index v = 0; v < model->render().vertices(); ++v)
      EXPECT_EQ(lean->render().basis.shape(v, i), model->render().basis.shape(v, of));
  }
  EXPECT_THROW(reduce_model(*model, std::vector<Index>{4, 1}), InvalidArgument);
  EXPECT_THROW(reduce_model(*model, kept, 1.0, 0.0), InvalidArgument);
  EXPECT_THROW(reduce_model(*model, std::vector<Index>{5}), InvalidArgument);
}

TEST(SceneModel, ARigidBodyOfAnAssetTellsOfNoFrequencies) {
  Asset asset = block_asset(3);
  asset.bodies.push_back(testing::block_model(3, "brick"));
  asset.frequency_errors = {{0.1, 0.2, 0.3}, {0.1, 0.2, 0.3}};
  make_rigid(asset, 1);
  const Asset read = asset_from_bytes(asset_bytes(asset), "test");
  EXPECT_EQ(read.bodies[0]->modes(), 3);
  EXPECT_EQ(read.frequency_errors[0].size(), 3u);
  EXPECT_EQ(read.bodies[1]->modes(), 0);
  EXPECT_TRUE(read.frequency_errors[1].empty());
  EXPECT_EQ(read.bodies[1]->data().mass, read.bodies[0]->data().mass);
  EXPECT_THROW(make_rigid(asset, 2), InvalidArgument);
}

TEST(SceneModel, WhatALeftOutModeAnsweredStaticallyGoesIntoTheResidualAtAnyStiffness) {
  ModalModelData data = testing::block_data(5);
  ResidualCompliance residual(ResidualCompliance::Form::kFull, data.render.vertices());
  for (Index v = 0; v < residual.vertices(); ++v) residual.set(v, v, 1e-6 * Mat3::Identity());
  data.residual_compliance = residual;
  const ModalModel model(std::move(data));
  const auto lean = reduce_model(model, std::vector<Index>{0, 3});
  const auto soft = reduce_model(model, std::vector<Index>{0, 3}, 1.0, 0.25);
  const auto statics = [](const ModalModel& m, Index a, Index b) {
    Mat3 sum = m.data().residual_compliance->block(a, b);
    for (Index i = 0; i < m.modes(); ++i)
      sum += m.collision().basis.shape(a, i).cast<double>() *
             m.collision().basis.shape(b, i).cast<double>().transpose() /
             m.data().eigenvalues[static_cast<std::size_t>(i)];
    return sum;
  };
  for (Index a = 0; a < model.render().vertices(); ++a)
    for (Index b = 0; b < model.render().vertices(); ++b) {
      constexpr double kFloat = 1e-6;  // single precision of both
      const Mat3 before = statics(model, a, b);
      const double least = kFloat * (statics(model, a, a).norm() + before.norm());
      EXPECT_LE((statics(*lean, a, b) - before).norm(), least);
      EXPECT_LE((0.25 * statics(*soft, a, b) - before).norm(), least) << "a quarter of the modulus gives way fourfold";
    }
  for (std::size_t i = 0; i < 2; ++i)  // frequencies halve, damping ratios stay
    EXPECT_DOUBLE_EQ(soft->data().decays[i], 0.5 * lean->data().decays[i]);
}

TEST(SceneModel, BodiesOfOneAssetShareOneModelAndPartsAreFoundByName) {
  Asset two = block_asset(2, "first");
  two.bodies.push_back(testing::block_model(3, "second"));
  const SceneModels models =
      make_models(model_scene(R"({"max_modes": 1})", R"({"name": "a", "asset": "block", "part": "second"},
      {"name": "b", "asset": "block", "part": 1}, {"name": "c", "asset": "block"})"),
                  {{"block", two}});
  EXPECT_EQ(models.of_body[0], models.of_body[1]);
  EXPECT_EQ(models.of_body[0]->name(), "second");
  EXPECT_EQ(models.of_body[2]->name(), "first");
  EXPECT_EQ(models.manifest.size(), 2u);
}

}  // namespace
}  // namespace limber
