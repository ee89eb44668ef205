#include "limber/scene/soundtrack.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "block_model.h"
#include "limber/core/error.h"
#include "limber/model/modal_model.h"
#include "limber/scene/blows.h"
#include "limber/sound/contact_time.h"
#include "limber/sound/radiation.h"
#include "limber/sound/synthesizer.h"
#include "thread_jobs.h"

namespace limber {
namespace {

constexpr double kRate = 48e3;

std::map<std::string, Asset> sounding_block() { return {{"block", testing::sounding_block_asset(0)}}; }

Scene heard_scene(const std::string& inside) {
  return parse_scene(R"({"assets": {"block": "block.glb"}, )" + inside + "}", "\"test.json\"", "");
}

RunResult play_heard(const Scene& scene, const std::map<std::string, Asset>& assets) {
  return run_scene(scene, make_models(scene, assets), {.key_rate = 0.0, .keep_blows = true});
}

// The block is turned by a right angle about x, so that body y is world z; (0, ½, ½) of it is a vertex.
TEST(Soundtrack, AStrikeIsHeardFromItsTimeOnAsLoudAsMicrophonesAreNear) {
  const auto assets = sounding_block();
  const Scene scene = heard_scene(R"("step": 0.01, "steps": 30, "gravity": [0, 0, 0],
    "bodies": [{"name": "b", "asset": "block", "orientation": {"axis": [1, 0, 0], "degrees": 90}}],
    "strikes": [{"body": "b", "time": 0.0342, "at": {"nearest": [0, -0.5, 0.5]}, "impulse": [0, 0, -0.3],
                 "contact_time": 0.002}],
    "microphones": [{"position": [0, -0.5, 4.5]}, {"position": [0, -0.5, 8.5]}])");
  const Soundtrack track = make_soundtrack(scene, assets, play_heard(scene, assets));
  EXPECT_EQ(track.channels, 2);
  EXPECT_EQ(track.blows, 1);
  EXPECT_EQ(track.silent_bodies, 0);

  const SoundModes& modes = *assets.at("block").sound(0);
  const ModalSurface& surface = assets.at("block").bodies[0]->collision();
  Synthesizer alone({.sample_rate = kRate, .channels = 1});
  alone.add_body(std::make_shared<ModalSound>(modes, monopole_gains(modes, surface.rest, surface.triangles), kRate));
  Index vertex = 0;
  for (Index v = 0; v < surface.vertices(); ++v)
    if ((surface.rest[v] - Vec3f(0.0f, 0.5f, 0.5f)).norm() < 1e-6f) vertex = v;
  alone.strike(
      {.at = {.vertices = {vertex, vertex, vertex}}, .impulse = {0, -0.3, 0}, .contact_time = 0.002, .delay = 0.0342});
  std::vector<float> expected(track.samples.size() / 2);
  alone.render(expected);
  const double loudest = *std::ranges::max_element(expected);
  constexpr double kSingle = 1e-6;
  for (std::size_t n = 0; n < expected.size(); ++n) {
    ASSERT_NEAR(track.samples[2 * n], expected[n] / 4.0, kSingle * loudest) << n;
    ASSERT_NEAR(track.samples[2 * n + 1], expected[n] / 8.0, kSingle * loudest) << n;
  }
  EXPECT_GT(track.loudest, 0.1 * loudest);
}

TEST(Soundtrack, AFallIsSilentUntilTheBlockTouchesAndLastsAsHertzSays) {
  const auto assets = sounding_block();
  const Scene scene =
      heard_scene(R"("step": 0.005, "steps": 120, "statics": [{"name": "ground", "shape": {"half_space": {}}}],
    "bodies": [{"name": "b", "asset": "block", "position": [0, 0, 1.3]}])");
  const RunResult run = play_heard(scene, assets);
  const double fall = std::sqrt(2.0 * 0.8 / 9.80665), speed = 9.80665 * fall;
  ASSERT_FALSE(run.trajectory.blows.empty());
  for (const BlowRecord& blow : run.trajectory.blows) {
    if (blow.time > fall) continue;  // it may rock
    EXPECT_NEAR(blow.time, fall, scene.step);
    EXPECT_NEAR(blow.approach, speed, 1e-3 * speed);
    EXPECT_NEAR(blow.position.z(), 0.0, 0.05);
    EXPECT_GT(blow.impulse.z(), 0.0);
    // A contact at the corner of a block feels less than its mass.
    EXPECT_GT(blow.mass, 0.1 * testing::kBlockMass);
    EXPECT_LT(blow.mass, testing::kBlockMass);
    EXPECT_NEAR(blow.radius, std::cbrt(3.0 * 2.0 / (4.0 * std::numbers::pi)), 1e-12);
  }
  const Soundtrack track = make_soundtrack(scene, assets, run);
  const auto first = std::ranges::find_if(track.samples, [](float p) { return p != 0.0f; }) - track.samples.begin();
  EXPECT_NEAR(static_cast<double>(first) / track.channels / kRate, fall, scene.step);
  // It rings on after the scene's end, until it is silent.
  EXPECT_GT(track.samples.size(), static_cast<std::size_t>(2 * scene.duration() * kRate));
  EXPECT_LT(std::abs(track.samples.back()), 20e-6);
}

TEST(Soundtrack, TheSameSceneHasTheSameBits) {
  const auto assets = sounding_block();
  const Scene scene =
      heard_scene(R"("step": 0.005, "steps": 100, "statics": [{"name": "ground", "shape": {"half_space": {}}}],
    "bodies": [{"name": "b", "asset": "block", "position": [0, 0, 0.9], "copies": {"count": [2, 1, 1], "spacing": [3, 1, 1]}}])");
  const RunResult run = play_heard(scene, assets);
  EXPECT_TRUE(make_soundtrack(scene, assets, run).samples ==
              make_soundtrack(scene, assets, play_heard(scene, assets)).samples);
}

TEST(Soundtrack, BodiesWithoutASoundAreToldAndSilent) {
  const std::map<std::string, Asset> assets{{"block", testing::block_asset(0)}};
  const Scene scene =
      heard_scene(R"("step": 0.005, "steps": 100, "statics": [{"name": "ground", "shape": {"half_space": {}}}],
    "bodies": [{"name": "b", "asset": "block", "position": [0, 0, 0.9]}])");
  const Soundtrack track = make_soundtrack(scene, assets, play_heard(scene, assets));
  EXPECT_EQ(track.silent_bodies, 1);
  EXPECT_EQ(track.blows, 0);
  EXPECT_EQ(track.loudest, 0.0);
}

RunResult play_slide(const Scene& scene, const std::map<std::string, Asset>& assets, Jobs* jobs = nullptr) {
  RunResult run =
      run_scene(scene, make_models(scene, assets), {.keep_contacts = true, .keep_blows = true, .jobs = jobs});
  std::erase_if(run.trajectory.blows, [](const BlowRecord& b) { return b.other != BlowRecord::kNobody; });
  return run;
}

double loudest_step(const Soundtrack& track, double from, double to) {
  const auto frame = [&](double time) { return static_cast<std::size_t>(time * track.sample_rate); };
  const auto channels = static_cast<std::size_t>(track.channels);
  const std::size_t end = std::min(frame(to), track.samples.size() / channels);
  float most = 0.0f;
  for (std::size_t n = frame(from) + 1; n < end; ++n)
    most = std::max(most, std::abs(track.samples[n * channels] - track.samples[(n - 1) * channels]));
  return static_cast<double>(most);
}

constexpr const char* kSlidingBlock = R"("step": 0.005, "steps": 100, "contact": {"friction": 0.5},
    "statics": [{"name": "ground", "shape": {"half_space": {}}}],
    "bodies": [{"name": "b", "asset": "block", "position": [0, 0, 0.5], "velocity": [1.5, 0, 0]}])";

/// A block that slides on the ground is braked by μ g. Each contact meets a roughness after the other, as often as its
/// speed says; together they give the block its share of the energy that friction takes, and none at rest.
TEST(Soundtrack, ABlockThatSlidesRubsUntilItRests) {
  const auto assets = sounding_block();
  constexpr double kSpeed = 1.5, kBrake = 0.5 * 9.80665, kRest = kSpeed / kBrake, kEnd = 0.8 * kRest;
  const Scene scene = heard_scene(kSlidingBlock);
  const RunResult run = play_slide(scene, assets);
  double expected = 0.0;
  for (const ContactRecord& contact : run.trajectory.contacts)
    if (contact.phase == ContactPhase::kLasting && contact.time <= kEnd)
      expected += (kSpeed - kBrake * contact.time) * scene.step / kRoughness;
  const ModalModelData& block = assets.at("block").bodies[0]->data();
  double count = 0.0, sum = 0.0, squares = 0.0, energy = 0.0, hardest[2] = {};
  for (const BlowRecord& blow : run.trajectory.blows) {
    EXPECT_LT(blow.time, kRest + 2.0 * scene.step);
    double& most = hardest[blow.time > kEnd];
    most = std::max(most, blow.impulse.norm());
    if (blow.time > kEnd) continue;
    EXPECT_NEAR(kRoughness / blow.contact_time, kSpeed - kBrake * blow.time, 2.0 * kBrake * scene.step) << blow.time;
    EXPECT_NEAR(blow.impulse.z(), 0.0, 1e-9);
    const Vec3 turned = block.inertia.inverse() * blow.point.cross(blow.impulse);
    ++count, sum += blow.impulse.x(), squares += blow.impulse.squaredNorm();
    energy += 0.5 * (blow.impulse.squaredNorm() / block.mass + blow.point.cross(blow.impulse).dot(turned));
  }
  ASSERT_GT(expected, 500.0);
  EXPECT_NEAR(count, expected, 0.05 * expected);
  EXPECT_LT(std::abs(sum), 4.0 * std::sqrt(squares)) << "blows in both directions";
  const double lost = 0.5 * block.mass * (kSpeed * kSpeed - std::pow(kSpeed - kBrake * kEnd, 2));
  EXPECT_NEAR(energy, kShareOfFriction * lost, 0.15 * kShareOfFriction * lost);

  const Soundtrack track = make_soundtrack(scene, assets, run);
  EXPECT_GT(loudest_step(track, 0.0, kEnd), 0.0);
  EXPECT_GT(hardest[1], 0.0);
  EXPECT_LT(hardest[1], hardest[0]) << "no click as the block sticks";
  EXPECT_LT(std::abs(track.samples.back()), 20e-6);
}

/// At 10 km/s twenty million roughnesses pass in a second; what they give together is what a bounded number gives.
TEST(Soundtrack, FastSlidingCostsNoMoreThanOneHears) {
  constexpr double kSpeed = 1e4;
  const Scene scene = heard_scene(R"("step": 0.005, "steps": 4, "contact": {"friction": 0.5},
    "statics": [{"name": "ground", "shape": {"half_space": {}}}],
    "bodies": [{"name": "b", "asset": "block", "position": [0, 0, 0.5], "velocity": [10000, 0, 0]}])");
  const auto assets = sounding_block();
  const RunResult run = play_slide(scene, assets);
  double contacts = 0.0, work = 0.0, energy = 0.0;
  for (const ContactRecord& contact : run.trajectory.contacts) {
    if (contact.phase != ContactPhase::kLasting) continue;
    ++contacts, work += kSpeed * std::hypot(contact.impulse.x(), contact.impulse.y());
  }
  const ModalModelData& block = assets.at("block").bodies[0]->data();
  for (const BlowRecord& blow : run.trajectory.blows) {
    const Vec3 turned = block.inertia.inverse() * blow.point.cross(blow.impulse);
    energy += 0.5 * (blow.impulse.squaredNorm() / block.mass + blow.point.cross(blow.impulse).dot(turned));
  }
  ASSERT_GT(contacts, 4.0);
  EXPECT_NEAR(static_cast<double>(run.trajectory.blows.size()), contacts * kMostRoughnesses * scene.step, contacts);
  EXPECT_NEAR(energy, kShareOfFriction * work, 0.15 * kShareOfFriction * work);
}

TEST(Soundtrack, ABlockThatRestsOrRidesOnABeltIsSilent) {
  const auto assets = sounding_block();
  for (const std::string belt : {"0", "1.5"}) {
    const Scene scene = heard_scene(R"("step": 0.005, "steps": 40,
      "statics": [{"name": "ground", "shape": {"half_space": {}}, "surface_velocity": [)" +
                                    belt + R"(, 0, 0]}],
      "bodies": [{"name": "b", "asset": "block", "position": [0, 0, 0.5], "velocity": [)" +
                                    belt + R"(, 0, 0]}])");
    EXPECT_EQ(play_slide(scene, assets).trajectory.blows.size(), 0u) << belt;
  }
}

TEST(Soundtrack, RubbingHasTheSameBitsForAnyNumberOfThreads) {
  const auto assets = sounding_block();
  const Scene scene = heard_scene(kSlidingBlock);
  testing::ThreadJobs jobs(3);
  EXPECT_TRUE(make_soundtrack(scene, assets, play_slide(scene, assets)).samples ==
              make_soundtrack(scene, assets, play_slide(scene, assets, &jobs)).samples);
}

/// By the synthesizer itself, at every vertex; along y, as all modes bend.
TEST(Soundtrack, NoBlowIsLouderThanTheLargestPressureAndSomeAreNearlySo) {
  const Asset asset = testing::sounding_block_asset(0);
  const SoundingBody body(asset.sounds[0], asset.bodies[0]->collision());
  for (const double contact_time : {1e-4, 1e-3, 2e-3}) {
    double loudest = 0.0;
    for (Index v = 0; v < body.modes().vertices; ++v) {
      Synthesizer synthesizer({.sample_rate = kRate, .channels = 1});
      synthesizer.add_body(std::make_shared<ModalSound>(body.modes(), body.gains(), kRate));
      synthesizer.strike({.at = {.vertices = {v, v, v}}, .impulse = {0, 1, 0}, .contact_time = contact_time});
      std::vector<float> samples(2048);
      synthesizer.render(samples);
      for (auto n = static_cast<std::size_t>(contact_time * kRate) + 1; n < samples.size(); ++n)
        loudest = std::max(loudest, std::abs(static_cast<double>(samples[n])));
    }
    constexpr double kSingle = 1e-6;
    EXPECT_LE(loudest, (1.0 + kSingle) * body.largest_pressure(contact_time)) << contact_time;
    EXPECT_GE(loudest, 0.7 * body.largest_pressure(contact_time)) << contact_time;
  }
}

TEST(Soundtrack, MicrophonesAndContactTimesOutOfRangeAreToldWithTheirPlace) {
  const std::string body = R"("step": 0.01, "steps": 10, "bodies": [{"name": "b", "asset": "block"}])";
  EXPECT_EQ(heard_scene(body).microphones.size(), 2u);
  EXPECT_THROW(heard_scene(body + R"(, "microphones": [])"), InputError);
  EXPECT_THROW(heard_scene(body + R"(, "microphones": [[0, 0, 1]])"), InputError);
  EXPECT_THROW(heard_scene(body + R"(, "strikes": [{"body": "b", "time": 0, "at": {"vertex": 0}, "impulse": [0, 0, 1],
                                "contact_time": 0}])"),
               InputError);
}

}  // namespace
}  // namespace limber
