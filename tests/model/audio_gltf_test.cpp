#include "limber/model/audio_gltf.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "block_model.h"
#include "limber/core/error.h"
#include "limber/model/glb.h"

namespace limber {
namespace {

using ::testing::HasSubstr;

/// Two blocks, of which the second sounds with three modes.
Asset audible_blocks() {
  Asset asset;
  asset.bodies = {testing::block_model(1, "mute"), testing::block_model(1, "bell")};
  const ModalSurface& surface = asset.bodies[1]->collision();
  SoundModes modes{.eigenvalues = {}, .decays = {3.0, 5.5, 40.0}, .shapes = {}, .vertices = surface.vertices()};
  for (Index m = 0; m < 3; ++m) {
    modes.eigenvalues.push_back(std::pow(2.0 * std::numbers::pi * 440.0 * (m + 1), 2));
    for (const Vec3f& r : surface.rest) {
      const Vec3f w = testing::block_shape(r.cast<double>(), m).cast<float>();
      modes.shapes.insert(modes.shapes.end(), {w.x(), w.y(), w.z()});
    }
  }
  asset.sounds = {nullptr, std::make_shared<SoundModes>(modes)};
  return asset;
}

TEST(AudioGltf, ModesComeBackToSinglePrecision) {
  const Asset asset = audible_blocks();
  Warnings warnings;
  const auto models = audio_models_from_glb(audio_glb_bytes(asset), "test", warnings);
  ASSERT_EQ(models.size(), 1u);
  EXPECT_TRUE(warnings.empty());
  const AudioModel& bell = models[0];
  const SoundModes& told = *asset.sounds[1];
  EXPECT_EQ(bell.name, "bell");
  EXPECT_EQ(bell.mass, testing::kBlockMass);
  EXPECT_EQ(bell.rest, asset.bodies[1]->collision().rest);
  EXPECT_EQ(bell.triangles, asset.bodies[1]->collision().triangles);
  EXPECT_EQ(bell.modes.shapes, told.shapes);
  ASSERT_EQ(bell.modes.modes(), told.modes());
  constexpr double kSingle = 2e-7;
  for (std::size_t k = 0; k < told.eigenvalues.size(); ++k) {
    EXPECT_NEAR(bell.modes.eigenvalues[k] / told.eigenvalues[k], 1.0, 2 * kSingle);
    EXPECT_NEAR(bell.modes.decays[k] / told.decays[k], 1.0, kSingle);
  }
}

// By the draft's own words, read with a plain JSON parser.
TEST(AudioGltf, TheFileHasTheAccessorsThatTheDraftAsksFor) {
  const std::string bytes = audio_glb_bytes(audible_blocks());
  const auto document = nlohmann::json::parse(glb_chunks(bytes, "test").json);
  EXPECT_THAT(document["extensionsUsed"].dump(), HasSubstr("KHR_audio_rigid_bodies"));
  EXPECT_FALSE(document.contains("extensionsRequired"));
  const auto& model = document["extensions"]["KHR_audio_rigid_bodies"]["modalModels"][0];
  const std::size_t points = 4 * 17;
  const auto expect_accessor = [&](const char* key, const char* type, int component, std::size_t count) {
    const auto& accessor = document["accessors"][model[key].get<std::size_t>()];
    EXPECT_EQ(accessor["type"], type) << key;
    EXPECT_EQ(accessor["componentType"], component) << key;
    EXPECT_EQ(accessor["count"], count) << key;
  };
  expect_accessor("frequencies", "SCALAR", 5126, 3);
  expect_accessor("decayRates", "SCALAR", 5126, 3);
  expect_accessor("positions", "VEC3", 5126, points);
  expect_accessor("shapes", "VEC3", 5126, 3 * points);
  expect_accessor("indices", "SCALAR", 5125, 3 * (4 * 16 * 2 + 4));
  // The principal moments of a block, in ascending order, and an orientation of length 1.
  const auto& mass = model["massProperties"];
  EXPECT_NEAR(mass["inertiaDiagonal"][0].get<double>(), 0.5, 1e-12);
  EXPECT_NEAR(mass["inertiaDiagonal"][2].get<double>(), 1.25, 1e-12);
  double length = 0.0;
  for (const auto& q : mass["inertiaOrientation"]) length += q.get<double>() * q.get<double>();
  EXPECT_NEAR(length, 1.0, 1e-12);
  EXPECT_FALSE(document["nodes"][0].contains("extensions"));
  EXPECT_EQ(document["nodes"][1]["extensions"]["KHR_audio_rigid_bodies"]["modalModel"], 0);
}

TEST(AudioGltf, FilesThatBreakTheDraftAreRefusedByName) {
  const std::string bytes = audio_glb_bytes(audible_blocks());
  const auto refused = [&](const std::string& what, const std::string& by) {
    std::string wrong = bytes;
    const std::size_t at = wrong.find(what);
    EXPECT_NE(at, std::string::npos) << what;
    wrong.replace(at, what.size(), by);
    Warnings warnings;
    try {
      (void)audio_models_from_glb(wrong, "test", warnings);
    } catch (const InputError& e) {
      return std::string(e.what());
    }
    return std::string("accepted");
  };
  EXPECT_THAT(refused("\"decayRates\"", "\"decayRatez\""), HasSubstr("decayRates is missing"));
  EXPECT_THAT(refused("\"modalModels\"", "\"modalModelz\""), HasSubstr("modalModels are not there"));
  // Accessors 6 to 10 are frequencies, decay rates, positions, shapes and indices.
  EXPECT_THAT(refused("\"frequencies\":6", "\"frequencies\":8"),
              HasSubstr("frequencies is no accessor of type SCALAR"));
  EXPECT_THAT(refused("\"shapes\":9", "\"shapes\":8"), HasSubstr("shapes has not one vector per mode"));
  EXPECT_THAT(refused("\"decayRates\":7", "\"decayRates\":2"), HasSubstr("decayRates is not of 32-bit floats"));
  Asset silent = audible_blocks();
  silent.sounds.clear();
  EXPECT_THROW(audio_glb_bytes(silent), InvalidArgument);
}

}  // namespace
}  // namespace limber
