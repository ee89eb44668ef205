// A caller that deforms on its GPU: what a glTF viewer makes of the asset and of interpolated_weights() is what
// reconstruct() draws.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "glb_view.h"
#include "limber/core/error.h"
#include "limber/engine/world.h"
#include "limber/model/asset.h"
#include "sample_models.h"

namespace limber {
namespace {

using testing::GlbView;
using ::testing::HasSubstr;
using testing::sample_model_data;

constexpr Index kModes = 7;
constexpr double kRoundOff = 4 * std::numeric_limits<float>::epsilon();

/// An asset's only mesh as a viewer has it: base, targets, and weights of its own.
class ViewedMesh {
 public:
  explicit ViewedMesh(const std::string& bytes) : glb_(bytes) {
    const auto& primitive = glb_.json.at("meshes").at(0).at("primitives").at(0);
    base_ = numbers(primitive.at("attributes"));
    for (const auto& target : primitive.at("targets")) targets_.push_back(numbers(target));
  }

  std::size_t size() const { return base_.size(); }

  /// pose · (base + Σ weight · target), 3 numbers per vertex.
  std::vector<double> shown(std::span<const float> weights, const RigidTransform& pose) const {
    std::vector<double> out;
    for (std::size_t i = 0; i < base_.size(); i += 3) {
      Vec3 p(base_[i], base_[i + 1], base_[i + 2]);
      for (std::size_t k = 0; k < targets_.size(); ++k)
        p += static_cast<double>(weights[k]) * Vec3(targets_[k][i], targets_[k][i + 1], targets_[k][i + 2]);
      const Vec3 placed = pose * p;
      out.insert(out.end(), {placed.x(), placed.y(), placed.z()});
    }
    return out;
  }

 private:
  std::vector<float> numbers(const nlohmann::json& attributes) const {
    return glb_.floats(attributes.at("POSITION").get<std::size_t>());
  }

  GlbView glb_;
  std::vector<float> base_;
  std::vector<std::vector<float>> targets_;
};

class MorphWeights : public ::testing::Test {
 protected:
  MorphWeights() {
    // Scales of another writer than ours: only the file can tell them.
    ModalModelData data = sample_model_data({.modes = kModes});
    for (Index i = 0; i < kModes; ++i) data.mode_scales.push_back(i % 2 == 0 ? 4.0 : 0.25);
    bytes_ = asset_bytes({.bodies = {std::make_shared<const ModalModel>(std::move(data))}, .provenance = {}});
    body_ = world_.add_body(asset_from_bytes(bytes_, "test").bodies[0]);
    std::vector<double> z, rates;
    for (Index i = 0; i < kModes; ++i) z.push_back(0.02 / (1.0 + i)), rates.push_back(i % 2 == 0 ? 0.5 : -0.4);
    world_.set_amplitudes(body_, z, rates);
  }

  void expect_viewer_shows_what_is_drawn(double interpolation) {
    const ViewedMesh mesh(bytes_);
    std::vector<float> weights(static_cast<std::size_t>(kModes)), drawn(mesh.size());
    world_.interpolated_weights(body_, interpolation, weights);
    world_.reconstruct(body_, drawn, {}, interpolation);
    const auto shown = mesh.shown(weights, world_.interpolated_pose(body_, interpolation));
    double size = 0.0, moved = 0.0;
    const auto rest = mesh.shown(std::vector<float>(weights.size()), world_.interpolated_pose(body_, interpolation));
    for (std::size_t i = 0; i < shown.size(); ++i) {
      size = std::max(size, std::abs(shown[i]));
      moved = std::max(moved, std::abs(shown[i] - rest[i]));
    }
    EXPECT_GT(moved, 1e-3) << "nothing to compare: the modes are still";
    for (std::size_t i = 0; i < shown.size(); ++i)
      EXPECT_NEAR(static_cast<double>(drawn[i]), shown[i], kRoundOff * size);
  }

  World world_{{.step = 0.01}};
  BodyId body_;
  std::string bytes_;
};

TEST_F(MorphWeights, ViewersShowABodyAtItsRestPoseAsItIsDrawn) { expect_viewer_shows_what_is_drawn(1.0); }

TEST_F(MorphWeights, ViewersShowAMovingBodyAsItIsDrawn) {
  world_.set_pose(body_, {.q = quaternion_from_rotation_vector({0.7, -0.4, 1.1}), .p = {0.2, -0.1, 0.3}});
  world_.set_velocity(body_, {1.0, 0.5, 2.0}, {3.0, -1.0, 2.0});
  for (int step = 0; step < 5; ++step) world_.step();
  for (const double interpolation : {0.0, 0.25, 1.0}) expect_viewer_shows_what_is_drawn(interpolation);
}

TEST_F(MorphWeights, ArgumentsAreChecked) {
  std::vector<float> weights(static_cast<std::size_t>(kModes));
  const auto said = [&](double interpolation, std::size_t count) -> std::string {
    try {
      world_.interpolated_weights(body_, interpolation, std::span(weights).first(count));
    } catch (const InvalidArgument& e) {
      return e.what();
    }
    return "no error";
  };
  EXPECT_EQ(said(0.5, weights.size()), "no error");
  EXPECT_THAT(said(1.5, weights.size()), HasSubstr("interpolated_weights: interpolation is 1.5"));
  EXPECT_THAT(said(0.5, weights.size() - 1), HasSubstr("interpolated_weights"));
  world_.remove_body(body_);
  EXPECT_THAT(said(0.5, weights.size()), HasSubstr("interpolated_weights"));
}

}  // namespace
}  // namespace limber
