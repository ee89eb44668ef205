// Recordings: what a viewer computes from the file is what the simulation had.
#include "limber/scene/recording.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <numbers>

#include "block_model.h"
#include "glb_view.h"
#include "limber/core/error.h"
#include "limber/core/file.h"

namespace limber {
namespace {

using testing::block_model;
using testing::GlbView;
using ::testing::HasSubstr;

/// Positions are float32 and pass through a few float32 sums; the block is 2 m long.
constexpr double kShown = 2e-5;

/// Two blocks that spin (the second past half a turn, so that quaternions must change sign) and swing in three modes,
/// the third too little to be seen.
Trajectory swinging_blocks(std::size_t keys = 40) {
  Trajectory t;
  t.scene = "swing";
  t.step = 0.005;
  t.key_interval = 0.01;
  const auto model = block_model(3);
  for (int b = 0; b < 2; ++b) {
    BodyTrack track;
    track.name = b == 0 ? "first" : "second";
    track.model = model;
    for (std::size_t i = 0; i < keys; ++i) {
      const double s = 0.01 * static_cast<double>(i);
      const Vec3 omega = Vec3(1.0, 2.0, -2.0) * (b + 1) * 4.0;
      track.poses.push_back({quaternion_from_rotation_vector(omega * s), Vec3(0.3 * s, b, -s * s)});
      track.angular_velocities.push_back(omega);
      for (const double z : {0.2 * std::sin(31.0 * s + b), -0.05 * std::cos(77.0 * s), 1e-12 * s}) {
        track.amplitudes.push_back(z);
        track.rates.push_back(0.0);
      }
      track.energies.push_back({});
    }
    t.bodies.push_back(std::move(track));
  }
  for (std::size_t i = 0; i < keys; ++i) t.times.push_back(0.01 * static_cast<double>(i));
  return t;
}

/// What a glTF viewer shows of the only mesh's vertices for some weights: base + Σ w target, for POSITION or NORMAL.
std::vector<double> morphed(const GlbView& glb, const std::string& attribute, std::span<const float> weights) {
  const auto& primitive = glb.json.at("meshes").at(0).at("primitives").at(0);
  const auto base = glb.floats(primitive.at("attributes").at(attribute));
  std::vector<double> out(base.begin(), base.end());
  for (std::size_t k = 0; k < weights.size(); ++k) {
    const auto target = glb.floats(primitive.at("targets").at(k).at(attribute));
    for (std::size_t i = 0; i < out.size(); ++i)
      out[i] += static_cast<double>(weights[k]) * static_cast<double>(target[i]);
  }
  return out;
}

Vec3 vertex(const std::vector<double>& xyz, std::size_t v) { return {xyz[3 * v], xyz[3 * v + 1], xyz[3 * v + 2]}; }

TEST(Recording, WhatStandsIsThereWhereItStands) {
  Trajectory t = swinging_blocks();
  t.statics = {
      {"ground", std::make_shared<Shape>(HalfSpace{.normal = Vec3::UnitZ(), .offset = -2.0}), {{}, Vec3::Zero()}},
      {"post", std::make_shared<Shape>(Capsule{}), {{}, {1.0, 2.0, 3.0}}}};
  const GlbView glb(make_recording(t).glb);
  const auto& nodes = glb.json.at("nodes");
  const auto node = [&](const std::string& name) {
    return *std::find_if(nodes.begin(), nodes.end(), [&](const auto& n) { return n.at("name") == name; });
  };
  EXPECT_EQ(node("post").at("translation"), nlohmann::json({1.0, 2.0, 3.0}));
  const auto mesh = node("ground").at("mesh").template get<std::size_t>();
  const auto plane = glb.floats(glb.json.at("meshes").at(mesh).at("primitives").at(0).at("attributes").at("POSITION"));
  for (std::size_t i = 2; i < plane.size(); i += 3) EXPECT_FLOAT_EQ(plane[i], -2.0f);
  EXPECT_EQ(nodes.back().at("children").size(), 4u);  // of the root: two bodies, two statics
}

class RecordingOfWeights : public ::testing::TestWithParam<bool> {
 protected:
  RecordingOfWeights()
      : recording_(make_recording(trajectory_, {.unsigned_weights = GetParam()})), glb_(recording_.glb) {}
  Trajectory trajectory_ = swinging_blocks();
  Recording recording_;
  GlbView glb_;
};

TEST_P(RecordingOfWeights, ShowsTheSimulatedShapeAtEveryKey) {
  const ModalSurface& surface = trajectory_.bodies[0].model->render();
  for (const BodyTrack& body : trajectory_.bodies) {
    const auto weights = glb_.channel(body.name, "weights");
    ASSERT_EQ(weights.size(), 2 * trajectory_.times.size());
    for (std::size_t key = 0; key < trajectory_.times.size(); ++key) {
      const auto shown = morphed(glb_, "POSITION", std::span(weights).subspan(2 * key, 2));
      const auto z = body.amplitudes_at(key);
      for (std::size_t v = 0; v < surface.rest.size(); ++v) {
        Vec3 expected = surface.rest[v].cast<double>();
        for (Index m = 0; m < 3; ++m)
          expected += z[static_cast<std::size_t>(m)] * testing::block_shape(surface.rest[v].cast<double>(), m);
        ASSERT_NEAR((vertex(shown, v) - expected).norm(), 0.0, kShown)
            << body.name << " key " << key << " vertex " << v;
      }
    }
  }
}

TEST_P(RecordingOfWeights, StaysInItsRange) {
  const float low = GetParam() ? 0.0f : -1.0f;
  bool reached = false;
  for (const BodyTrack& body : trajectory_.bodies)
    for (const float w : glb_.channel(body.name, "weights")) {
      EXPECT_GE(w, low);
      EXPECT_LE(w, 1.0f);
      reached = reached || w == 1.0f || w == low;
    }
  EXPECT_TRUE(reached);  // scaled to the largest amplitude recorded
}

TEST_P(RecordingOfWeights, RestWeightsShowTheUndeformedBodyWithUnitNormals) {
  const auto weights = glb_.json.at("meshes").at(0).at("weights").get<std::vector<float>>();
  const auto position = morphed(glb_, "POSITION", weights);
  const ModalSurface& surface = trajectory_.bodies[0].model->render();
  for (std::size_t v = 0; v < surface.rest.size(); ++v)
    EXPECT_NEAR((vertex(position, v) - surface.rest[v].cast<double>()).norm(), 0.0, kShown);
  const auto base = morphed(glb_, "NORMAL", {});
  for (std::size_t v = 0; v < surface.rest.size(); ++v) EXPECT_NEAR(vertex(base, v).norm(), 1.0, 1e-6);
}

TEST_P(RecordingOfWeights, TransformsAreThoseOfTheSimulation) {
  for (const BodyTrack& body : trajectory_.bodies) {
    const auto t = glb_.channel(body.name, "translation"), q = glb_.channel(body.name, "rotation");
    for (std::size_t key = 0; key < trajectory_.times.size(); ++key) {
      for (std::size_t a = 0; a < 3; ++a)
        EXPECT_NEAR(static_cast<double>(t[3 * key + a]), body.poses[key].p[static_cast<int>(a)], kShown);
      const Quaternion shown{q[4 * key + 3], q[4 * key], q[4 * key + 1], q[4 * key + 2]};
      for (const Vec3& axis : {Vec3(Vec3::UnitX()), Vec3(Vec3::UnitY())})
        EXPECT_NEAR((shown * axis - body.poses[key].q * axis).norm(), 0.0, kShown);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Recording, RecordingOfWeights, ::testing::Values(false, true),
                         [](const auto& p) { return p.param ? "Unsigned" : "Signed"; });

TEST(Recording, SignedAndUnsignedAreLitAlike) {
  const Trajectory trajectory = swinging_blocks(8);
  const GlbView plain(make_recording(trajectory).glb);
  const GlbView shifted(make_recording(trajectory, {.unsigned_weights = true}).glb);
  for (std::size_t key = 0; key < trajectory.times.size(); ++key) {
    const auto a = plain.channel("second", "weights"), b = shifted.channel("second", "weights");
    const auto na = morphed(plain, "NORMAL", std::span(a).subspan(2 * key, 2));
    const auto nb = morphed(shifted, "NORMAL", std::span(b).subspan(2 * key, 2));
    for (std::size_t v = 0; 3 * v < na.size(); ++v)
      EXPECT_NEAR((vertex(na, v).normalized() - vertex(nb, v).normalized()).norm(), 0.0, kShown) << key << " " << v;
  }
}

TEST(Recording, NeighbouringQuaternionsGoTheShortWay) {
  const GlbView glb(make_recording(swinging_blocks()).glb);
  const auto q = glb.channel("second", "rotation");
  for (std::size_t i = 4; i < q.size(); i += 4)
    EXPECT_GT(q[i] * q[i - 4] + q[i + 1] * q[i - 3] + q[i + 2] * q[i - 2] + q[i + 3] * q[i - 1], 0.0f);
}

TEST(Recording, WorldUpIsUpInTheViewer) {
  const GlbView glb(make_recording(swinging_blocks(2)).glb);
  const auto& root = glb.json.at("nodes").back();
  const auto r = root.at("rotation").get<std::vector<double>>();
  const Quaternion q{r[3], r[0], r[1], r[2]};
  EXPECT_NEAR((q * Vec3::UnitZ() - Vec3::UnitY()).norm(), 0.0, 1e-15);
  EXPECT_EQ(root.at("children").size(), 2u);
  EXPECT_EQ(glb.json.at("scenes").at(0).at("nodes").size(), 1u);
}

TEST(Recording, AModeThatNobodyCanSeeIsLeftOut) {
  const Recording r = make_recording(swinging_blocks());
  ASSERT_EQ(r.models.size(), 1u);
  EXPECT_EQ(r.models[0].recorded, (std::vector<Index>{0, 1}));
  EXPECT_EQ(make_recording(swinging_blocks(), {.invisible = 0.0}).models[0].recorded.size(), 3u);
}

TEST(Recording, SlowMotionStretchesTheShownTimeOnly) {
  const Trajectory t = swinging_blocks(5);
  const auto times = GlbView(make_recording(t, {.slow_motion = 25.0}).glb).times();
  for (std::size_t i = 0; i < times.size(); ++i) EXPECT_FLOAT_EQ(times[i], static_cast<float>(25.0 * t.times[i]));
}

TEST(Recording, AmplitudesComeBackFromTheExtras) {
  const Trajectory t = swinging_blocks(6);
  const GlbView glb(make_recording(t, {.unsigned_weights = true}).glb);
  const auto& told = glb.json.at("extras").at("limber_recording");
  EXPECT_EQ(told.at("weights"), "unsigned");
  const auto scales = told.at("models").at(0).at("scales").get<std::vector<double>>();
  const auto w = glb.channel("first", "weights");
  for (std::size_t key = 0; key < t.times.size(); ++key)
    EXPECT_NEAR(scales[1] * (2.0 * static_cast<double>(w[2 * key + 1]) - 1.0), t.bodies[0].amplitudes_at(key)[1], 1e-7);
}

TEST(Recording, TheSameTrajectoryGivesTheSameBytes) {
  EXPECT_EQ(make_recording(swinging_blocks()).glb, make_recording(swinging_blocks()).glb);
}

TEST(Recording, ModesAndTurnsTooFastForTheKeysAreToldAbout) {
  Trajectory t = swinging_blocks();
  EXPECT_TRUE(make_recording(t).warnings.empty());  // 5 and 20 Hz against keys at 100 Hz
  t.key_interval = 0.05;                            // half the key rate is now 10 Hz
  const Recording r = make_recording(t);
  EXPECT_EQ(r.models[0].too_fast, (std::vector<Index>{1}));
  ASSERT_FALSE(r.warnings.empty());
  EXPECT_THAT(r.warnings[0], HasSubstr("--slow-motion"));
  t.key_interval = 0.14;  // 24 rad/s for 0.14 s is 3.4 rad
  EXPECT_THAT(make_recording(t).warnings.back(), HasSubstr("half a turn"));
}

TEST(Recording, ARigidBodyNeedsNoTargets) {
  Trajectory t = swinging_blocks(3);
  for (BodyTrack& body : t.bodies) {
    body.model = block_model(0);
    body.amplitudes.clear();
    body.rates.clear();
  }
  const GlbView glb(make_recording(t, {.unsigned_weights = true}).glb);
  EXPECT_FALSE(glb.json.at("meshes").at(0).at("primitives").at(0).contains("targets"));
  EXPECT_EQ(glb.json.at("animations").at(0).at("channels").size(), 4u);
}

TEST(Recording, WrongOptionsAndEmptyTrajectoriesAreRefused) {
  EXPECT_THROW(make_recording(swinging_blocks(), {.slow_motion = 0.0}), InvalidArgument);
  EXPECT_THROW(make_recording(swinging_blocks(), {.invisible = std::nan("")}), InvalidArgument);
  EXPECT_THROW(make_recording({}), InvalidArgument);
}

}  // namespace
}  // namespace limber
