// Playing scenes: loads act where and when the scene says, against closed forms.
#include "limber/scene/run.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <iomanip>
#include <numbers>
#include <sstream>

#include "block_model.h"
#include "limber/core/error.h"
#include "limber/dynamics/oscillator.h"

namespace limber {
namespace {

using testing::block_asset;
using testing::block_shape;
using ::testing::HasSubstr;
using testing::kBlockMass;

/// Shapes are float32, so modal loads carry its round-off.
constexpr double kFloat = 2e-7;

constexpr Index kModes = 3;

Scene parsed(const std::string& inside) {
  return parse_scene(R"({"gravity": [0, 0, 0], "assets": {"block": "block.glb"}, )" + inside + "}", "\"test.json\"",
                     "");
}

RunResult play(const Scene& scene, const RunOptions& options = {.key_rate = 1e6}) {
  return run_scene(scene, make_models(scene, {{"block", block_asset(kModes)}}), options);
}

Mode block_mode(Index m) {
  const double omega = 2.0 * std::numbers::pi * testing::block_frequency_hz(m);
  return {.lambda = omega * omega, .decay = testing::block_decay(m)};
}

/// One block at the origin, pushed along y at the middle of its upper side: body point (0, ½, 0), a vertex of the
/// surface is at (0, ½, ½).
std::string struck(const std::string& time, const std::string& more = "") {
  return R"("step": 0.01, "steps": 20, "bodies": [{"name": "b", "asset": "block"}],
            "strikes": [{"body": "b", "time": )" +
         time + R"(, "at": {"nearest": [0, 0.5, 0.5]}, "impulse": [0, 0.3, 0])" + more + "}]";
}

double largest_rate_scale(const BodyTrack& track) {
  double scale = 0.0;
  for (const double v : track.rates) scale = std::max(scale, std::abs(v));
  return scale;
}

class StrikeAtTime : public ::testing::TestWithParam<double> {};

TEST_P(StrikeAtTime, RingsAsItsClosedFormFromExactlyThatTime) {
  const double time = GetParam();
  std::ostringstream text;
  text << std::setprecision(17) << time;
  const RunResult r = play(parsed(struck(text.str())));
  const BodyTrack& track = r.trajectory.bodies[0];
  ASSERT_EQ(r.trajectory.times.size(), 21u);
  const double scale = largest_rate_scale(track);
  for (std::size_t key = 0; key < r.trajectory.times.size(); ++key) {
    const double since = r.trajectory.times[key] - time;
    for (Index m = 0; m < kModes; ++m) {
      const double j = block_shape({0.0, 0.5, 0.5}, m).y() * 0.3;
      const bool rings = key > static_cast<std::size_t>(std::floor(time / 0.01 + 1e-9));
      const ModeState expected = rings ? impulse_response(block_mode(m), since, j) : ModeState{};
      const auto i = static_cast<std::size_t>(m);
      EXPECT_NEAR(track.rates_at(key)[i], expected.zdot, kFloat * scale) << "key " << key << " mode " << m;
      EXPECT_NEAR(track.amplitudes_at(key)[i], expected.z, kFloat * scale / std::sqrt(block_mode(m).lambda));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Run, StrikeAtTime, ::testing::Values(0.0, 0.03, 0.0342, 0.0799999, 0.1999));

TEST(Run, AFreeBodyTakesTheMomentumOfAStrikeThroughItsCentre) {
  const RunResult r =
      play(parsed(R"("step": 0.01, "steps": 10, "bodies": [{"name": "b", "asset": "block"}], "strikes": [{
      "body": "b", "time": 0, "at": {"ray": {"from": [0, 5, 0], "direction": [0, -2, 0]}}, "impulse": [0, -0.6, 0]}])"));
  const BodyTrack& track = r.trajectory.bodies[0];
  EXPECT_NEAR((track.poses.back().p - Vec3(0.0, -0.6 / kBlockMass * 0.1, 0.0)).norm(), 0.0, 1e-14);
  EXPECT_NEAR(track.angular_velocities.back().norm(), 0.0, 1e-6);  // the arm is (0, ½, 0), in float32
  ASSERT_EQ(r.strikes.size(), 1u);
  EXPECT_NEAR((r.strikes[0].point - Vec3(0.0, 0.5, 0.0)).norm(), 0.0, 1e-6);
}

TEST(Run, AForceHeldForSomeStepsIsTheResponseToAHeldForce) {
  const RunResult r =
      play(parsed(R"("step": 0.01, "steps": 30, "bodies": [{"name": "b", "asset": "block"}], "forces": [{
      "body": "b", "start": 0.05, "duration": 0.1, "at": {"nearest": [0, 0.5, 0]}, "force": [0, 4, 0]}])"));
  const BodyTrack& track = r.trajectory.bodies[0];
  for (Index m = 0; m < kModes; ++m) {
    // Its end at 0.15 s is a force of the opposite sign from then on.
    const double g = block_shape({0.0, 0.5, 0.0}, m).y() * 4.0;
    const ModeState on = advance(propagator(block_mode(m), 0.25), {}, g);
    const ModeState off = advance(propagator(block_mode(m), 0.15), {}, -g);
    const double scale = std::abs(on.zdot) + std::abs(off.zdot);
    EXPECT_NEAR(track.rates_at(30)[static_cast<std::size_t>(m)], on.zdot + off.zdot, kFloat * scale) << m;
  }
  ASSERT_EQ(r.forces.size(), 1u);
  EXPECT_EQ(r.forces[0].step, 5);
}

TEST(Run, PlacesInBodyInputAndWorldFramesMeetAtTheSamePoint) {
  // The block lies turned by 90° about z at (1, 2, 3); its body point (1, ½, ½) is at world (½, 3, 3½), input
  // (11, 20.5, 30.5).
  for (const char* at : {R"({"nearest": [1, 0.5, 0.5], "frame": "body"})", R"({"nearest": [0.5, 3, 3.5]})",
                         R"({"nearest": [11, 20.5, 30.5], "frame": "input"})", R"({"vertex": 66})",
                         R"({"ray": {"from": [0.5, 3, 9], "direction": [0, 0, -1]}})"}) {
    const RunResult r = play(parsed(R"("step": 0.01, "steps": 1, "bodies": [{"name": "b", "asset": "block",
        "position": [1, 2, 3], "orientation": {"axis": [0, 0, 1], "degrees": 90}}],
        "strikes": [{"body": "b", "time": 0, "impulse": [0, 0, 0.001], "at": )" +
                                    std::string(at) + "}]"));
    ASSERT_EQ(r.strikes.size(), 1u) << at;
    EXPECT_NEAR((r.strikes[0].point - Vec3(0.5, 3.0, 3.5)).norm(), 0.0, 1e-6) << at;
  }
}

TEST(Run, AStrikeOnAGridStrikesEveryCopyAlike) {
  const RunResult r = play(parsed(R"("step": 0.01, "steps": 5, "bodies": [{"name": "b", "asset": "block",
      "copies": {"count": [3, 1, 1], "spacing": [4, 0, 0]}}],
      "strikes": [{"body": "b", "time": 0.011, "at": {"vertex": 3}, "impulse": [0, 0.1, 0]},
                  {"body": "b[1]", "time": 0.02, "at": {"vertex": 3}, "impulse": [0, 0.1, 0]}])"));
  EXPECT_EQ(r.strikes.size(), 4u);
  const auto& bodies = r.trajectory.bodies;
  EXPECT_EQ(bodies[0].rates, bodies[2].rates);
  EXPECT_NE(bodies[0].rates, bodies[1].rates);
}

TEST(Run, KeysAreWholeStepsWithTheStartAndTheEndAlways) {
  const Scene scene = parsed(struck("0"));
  EXPECT_EQ(play(scene, {.key_rate = 30.0}).trajectory.times,
            (std::vector<double>{0, 0.03, 0.06, 0.09, 0.12, 0.15, 0.18, 0.2}));
  EXPECT_EQ(play(scene, {.key_rate = 0.0}).trajectory.times, (std::vector<double>{0, 0.2}));
  const RunResult shorter = play(scene, {.steps = 7, .key_rate = 0.0});
  EXPECT_EQ(shorter.steps, 7);
  EXPECT_EQ(shorter.trajectory.times.back(), 7 * 0.01);
}

TEST(Run, HowOftenKeysAreKeptDoesNotChangeTheMotion) {
  const Scene scene = parsed(struck("0.0342"));
  const RunResult often = play(scene), seldom = play(scene, {.key_rate = 0.0, .reconstruct = true});
  EXPECT_EQ(often.state_hash, seldom.state_hash);
  EXPECT_EQ(often.trajectory.bodies[0].rates_at(20)[0], seldom.trajectory.bodies[0].rates_at(1)[0]);
  EXPECT_NE(often.state_hash, play(parsed(struck("0.0343"))).state_hash);
}

/// Of a block that swings about its origin, where the step's length tells.
TEST(Run, SubstepsAreSmallSteps) {
  auto data = testing::block_data(1);
  data.motion = FrameMotion::kPoint;
  data.center_of_mass = {0.0, 0.0, -0.3};
  Asset asset;
  asset.bodies = {std::make_shared<const ModalModel>(std::move(data))};
  const auto last_pose = [&](const std::string& time) {
    Scene scene = parsed(time + R"(, "bodies": [{"name": "b", "asset": "block",
                                     "orientation": {"axis": [0, 1, 0], "degrees": 40}}])");
    scene.gravity = {0.0, 0.0, -9.80665};
    const RunResult r = run_scene(scene, make_models(scene, {{"block", asset}}), {.key_rate = 0.0});
    return r.trajectory.bodies[0].poses.back().q;
  };
  const auto small = last_pose(R"("step": 0.01, "steps": 40)");
  const auto parts = last_pose(R"("step": 0.04, "steps": 10, "substeps": 4)");
  const auto whole = last_pose(R"("step": 0.04, "steps": 10)");
  EXPECT_EQ(small.w, parts.w);
  EXPECT_EQ(small.y, parts.y);
  EXPECT_GT(std::abs(small.w - whole.w), 1e-6);
}

TEST(Run, ABodyAtRestSleepsUntilItIsStruck) {
  const std::string sleep = R"("sleep": {"time": 0.05}, )";
  EXPECT_EQ(play(parsed(sleep + struck("0.1")), {.steps = 10}).asleep, 1);
  EXPECT_EQ(play(parsed(struck("0.1")), {.steps = 10}).asleep, 0);
  const RunResult woken = play(parsed(sleep + struck("0.1"))), awake = play(parsed(struck("0.1")));
  EXPECT_EQ(woken.asleep, 0);
  EXPECT_EQ(woken.trajectory.bodies[0].rates, awake.trajectory.bodies[0].rates);
}

TEST(Run, EnergyOfAnUndisturbedFlightIsKeptButForDamping) {
  const RunResult r = play(parsed(struck("0")));
  const auto& e = r.trajectory.bodies[0].energies;
  EXPECT_EQ(r.energy_before, e.front().total());
  for (std::size_t key = 2; key < e.size(); ++key) {
    EXPECT_NEAR(e[key].kinetic_rigid, e[1].kinetic_rigid, 1e-12 * e[1].kinetic_rigid);
    EXPECT_LE(e[key].kinetic_modal + e[key].elastic, e[key - 1].kinetic_modal + e[key - 1].elastic);
  }
}

std::string error_of(const std::string& inside) {
  try {
    play(parsed(inside));
  } catch (const InputError& e) {
    return e.what();
  }
  return "no error";
}

TEST(Run, PlacesThatTheBodyDoesNotHaveAreToldWithTheirPlaceInTheFile) {
  const auto at = [](const std::string& place) {
    return R"("step": 0.01, "steps": 3, "bodies": [{"name": "b", "asset": "block"}],
              "strikes": [{"body": "b", "time": 0, "impulse": [0, 0, 1], "at": )" +
           place + "}]";
  };
  EXPECT_THAT(error_of(at(R"({"vertex": 68})")), HasSubstr("\"test.json\".strikes[0].at.vertex: is 68"));
  EXPECT_THAT(error_of(at(R"({"triangle": 132})")), HasSubstr("strikes[0].at.triangle: is 132"));
  EXPECT_THAT(error_of(at(R"({"ray": {"from": [0, 5, 0], "direction": [0, 1, 0]}})")), HasSubstr("misses the body"));
  EXPECT_THAT(error_of(R"("step": 1, "steps": 1, "bodies": [{"name": "b", "asset": "block", "part": 1}])"),
              HasSubstr("bodies[0].part: is 1"));
  EXPECT_THAT(error_of(R"("step": 1, "steps": 1, "bodies": [{"name": "b", "asset": "block", "part": "blok"}])"),
              HasSubstr("did you mean \"block\""));
  EXPECT_THAT(error_of(R"("step": 1, "steps": 1, "bodies": [{"name": "b", "asset": "block",
                          "motion": {"keys": [{"time": 1}]}}])"),
              HasSubstr("no fixed nodes"));
}

/// A body with fixed nodes shaken by A sin ωt along y. With p = ∫ρ w_y dV,
///   z̈ + λz = −p ẍ = p A ω² sin ωt:    z(t) = p A ω²/(λ − ω²) (sin ωt − (ω/√λ) sin √λt),
/// and the velocity Aω that the shake begins with is reached evenly within the first step:
///   −p A ω/(λh) (cos √λ(t−h) − cos √λt).
/// What remains is the mean acceleration held over each step: second order.
TEST(Run, AShakenBodyFollowsTheForcedOscillationWithSecondOrderInTheStep) {
  auto data = testing::block_data(1);
  data.motion = FrameMotion::kKinematic;
  data.decays = {0.0};
  data.participation = {Vec3(0.0, 1.2, 0.0)};
  Asset asset;
  asset.bodies = {std::make_shared<const ModalModel>(std::move(data))};
  const double root = std::sqrt(block_mode(0).lambda), omega = 2.0 * std::numbers::pi * 3.0, end = 0.44,
               pA = 1.2 * 0.01;
  const double forced = pA * omega * omega / (root * root - omega * omega) *
                        (std::sin(omega * end) - omega / root * std::sin(root * end));
  const auto begun = [&](double h) {
    return -pA * omega / (root * root * h) * (std::cos(root * (end - h)) - std::cos(root * end));
  };
  const auto error = [&](int steps) {
    const Scene scene = parsed("\"step\": " + std::to_string(end / steps) + ", \"steps\": " + std::to_string(steps) +
                               R"(, "bodies": [{"name": "b", "asset": "block",
                              "motion": {"shake": {"axis": [0, 1, 0], "amplitude": 0.01, "frequency": 3}}}])");
    const RunResult r = run_scene(scene, make_models(scene, {{"block", asset}}), {.key_rate = 0.0});
    return std::abs(r.trajectory.bodies[0].amplitudes_at(1)[0] - forced - begun(end / steps));
  };
  const double coarse = error(440), fine = error(880);  // step lengths that six decimals hold
  EXPECT_LT(fine, 1e-3 * pA);
  EXPECT_NEAR(std::log2(coarse / fine), 2.0, 0.1);
}

TEST(Run, EnergiesAreTabledForEveryKeyAndBody) {
  const RunResult r = play(parsed(struck("0")), {.key_rate = 10.0});
  const std::string bodies = energies_csv(r.trajectory), modes = mode_energies_csv(r.trajectory);
  EXPECT_EQ(std::count(bodies.begin(), bodies.end(), '\n'), 1 + 3);
  EXPECT_EQ(std::count(modes.begin(), modes.end(), '\n'), 1 + 3);
  const std::string header = modes.substr(0, modes.find('\n'));
  EXPECT_EQ(header, "time_s,b all modes,b mode00_5Hz,b mode01_20Hz,b mode02_45Hz");
}

TEST(Run, WrongOptionsAreRefused) {
  const Scene scene = parsed(struck("0"));
  EXPECT_THROW(play(scene, {.steps = -2}), InvalidArgument);
  EXPECT_THROW(play(scene, {.key_rate = std::nan("")}), InvalidArgument);
  EXPECT_THROW(run_scene(scene, {}), InvalidArgument);
}

}  // namespace
}  // namespace limber
