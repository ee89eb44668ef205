// Scene files: what they mean, and one clear line for everything that is wrong in one.
#include "limber/scene/scene_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <sstream>

#include "limber/core/error.h"
#include "limber/core/file.h"

namespace limber {
namespace {

constexpr double kRoundOff = 1e-15;

Scene parse(const std::string& text) { return parse_scene(text, "\"test.json\"", "folder"); }

/// A scene with some parts replaced or added.
std::string scene_with(const std::string& bodies, const std::string& more = "") {
  return R"({"step": 0.01, "steps": 100, "assets": {"bell": "bell.glb"}, "bodies": [)" + bodies + "]" +
         (more.empty() ? "" : ", " + more) + "}";
}
const std::string kBell = R"({"name": "bell", "asset": "bell"})";

TEST(SceneFile, EveryFieldIsReadWhereItBelongs) {
  const Scene s = parse(R"({
    "step": 0.002, "duration": 1, "gravity": [0, -1, 0], "substeps": 3, "sleep": {"time": 0.25, "speed": 0.02},
    "assets": {"bell": "sub/bell.glb"},
    "limits": {"max_modes": 7, "max_force": 10, "min_displacement": 1e-4, "frame_rate": 120, "load": "static"},
    "bodies": [{"name": "left", "asset": "bell", "part": "clapper", "position": [1, 2, 3],
                "orientation": [2, 0, 0, 0], "velocity": [4, 5, 6], "angular_velocity": [7, 8, 9]}],
    "strikes": [{"body": "left", "time": 0.5, "at": {"triangle": 4, "weights": [0.5, 0.25, 0.25]},
                 "impulse": [0, 0, -1], "axes": "body"}],
    "forces": [{"body": "left", "start": 0.1, "duration": 0.2, "at": {"nearest": [0, 0, 1], "frame": "input"},
                "force": [1, 0, 0]}]})");
  EXPECT_EQ(s.step, 0.002);
  EXPECT_EQ(s.steps, 500);
  EXPECT_EQ(s.gravity, Vec3(0, -1, 0));
  EXPECT_EQ(s.substeps, 3);
  EXPECT_TRUE(s.sleep.enabled);
  EXPECT_EQ(s.sleep.time, 0.25);
  EXPECT_EQ(s.sleep.speed, 0.02);
  EXPECT_EQ(s.assets.at("bell"), std::filesystem::path("folder/sub/bell.glb"));
  ASSERT_TRUE(s.limits);
  EXPECT_EQ(s.limits->max_modes, 7);
  EXPECT_EQ(s.limits->frame_rate, 120.0);
  EXPECT_EQ(s.limits->load, LoadKind::kStatic);
  ASSERT_EQ(s.bodies.size(), 1u);
  EXPECT_EQ(std::get<std::string>(s.bodies[0].part), "clapper");
  EXPECT_EQ(s.bodies[0].placement.pose.p, Vec3(1, 2, 3));
  EXPECT_EQ(s.bodies[0].placement.pose.q.w, 1.0);
  EXPECT_EQ(s.bodies[0].placement.velocity, Vec3(4, 5, 6));
  EXPECT_EQ(s.bodies[0].placement.angular_velocity, Vec3(7, 8, 9));
  ASSERT_EQ(s.strikes.size(), 1u);
  EXPECT_EQ(std::get<OnTriangle>(s.strikes[0].at).triangle, 4);
  EXPECT_EQ(std::get<OnTriangle>(s.strikes[0].at).weights[1], 0.25);
  EXPECT_EQ(s.strikes[0].axes, Axes::kBody);
  ASSERT_EQ(s.forces.size(), 1u);
  EXPECT_EQ(s.forces[0].start, 0.1);
  EXPECT_EQ(std::get<NearestTo>(s.forces[0].at).frame, PlaceFrame::kInput);
}

TEST(SceneFile, BodiesSleepWhereTheSceneSaysSo) {
  EXPECT_FALSE(parse(scene_with(kBell)).sleep.enabled);
  const SleepOptions sleep = parse(scene_with(kBell, R"("sleep": {})")).sleep;
  EXPECT_TRUE(sleep.enabled);
  EXPECT_EQ(sleep.time, SleepOptions{}.time);
  EXPECT_EQ(sleep.speed, SleepOptions{}.speed);
}

TEST(SceneFile, AxisAndDegreesIsTheSameTurnAsItsQuaternion) {
  const Scene s =
      parse(scene_with(R"({"name": "bell", "asset": "bell", "orientation": {"axis": [0, 0, 5], "degrees": 90}})"));
  const Vec3 turned = s.bodies[0].placement.pose.q * Vec3::UnitX();
  EXPECT_NEAR((turned - Vec3::UnitY()).norm(), 0.0, kRoundOff);
}

TEST(SceneFile, ADurationIsAWholeNumberOfStepsButForRoundOff) {
  const auto steps = [](const std::string& step, const std::string& duration) {
    return parse("{\"step\": " + step + ", \"duration\": " + duration +
                 R"(, "assets": {"bell": "b"}, "bodies": [{"name": "bell", "asset": "bell"}]})")
        .steps;
  };
  EXPECT_EQ(steps("0.1", "0.3"), 3);  // 0.3 / 0.1 = 2.9999999999999996
  EXPECT_EQ(steps("0.1", "0.35"), 4);
  EXPECT_EQ(steps("0.001", "86400"), 86'400'000);
}

TEST(SceneFile, CopiesFillAGridAndKeepTheirGroup) {
  const Scene s = parse(scene_with(
      R"({"name": "bell", "asset": "bell", "position": [1, 0, 0], "copies": {"count": [2, 3, 1], "spacing": [10, 20, 30]}})",
      R"("strikes": [{"body": "bell[5]", "time": 0, "at": {"vertex": 0}, "impulse": [1, 0, 0]},
                     {"body": "bell", "time": 0, "at": {"vertex": 0}, "impulse": [1, 0, 0]}])"));
  ASSERT_EQ(s.bodies.size(), 6u);
  EXPECT_EQ(s.bodies[5].name, "bell[5]");
  EXPECT_EQ(s.bodies[5].group, "bell");
  EXPECT_EQ(s.bodies[5].placement.pose.p, Vec3(11, 40, 0));
}

TEST(SceneFile, ATriangleWithoutWeightsIsItsCentre) {
  const Scene s = parse(
      scene_with(kBell, R"("strikes": [{"body": "bell", "time": 0, "at": {"triangle": 1}, "impulse": [1, 0, 0]}])"));
  for (const double w : std::get<OnTriangle>(s.strikes[0].at).weights) EXPECT_NEAR(w, 1.0 / 3.0, kRoundOff);
}

struct BadScene {
  std::string text;
  std::string place;     ///< what the message must name
  std::string expected;  ///< what it must say
};

std::string strike(const std::string& inside) {
  return scene_with(kBell, R"("strikes": [{"body": "bell", "impulse": [0, 0, 1], )" + inside + "}]");
}

TEST(SceneFile, EveryWrongSceneGetsOneLineThatNamesPlaceAndExpectation) {
  const std::vector<BadScene> scenes = {
      {"", "\"test.json\"", "not valid JSON"},
      {"[]", "\"test.json\"", "expected an object"},
      {"{\"step\": 0.1", "\"test.json\"", "not valid JSON"},
      {"{}", "\"test.json\"", "\"step\" is missing"},
      {R"({"step": 0})", "step", "> 0"},
      {R"({"step": -1})", "step", "> 0"},
      {R"({"step": "fast"})", "step", "a finite number"},
      {R"({"step": 1e999})", "test.json", "not valid JSON"},
      {R"({"step": 0.1})", "neither", "\"duration\""},
      {R"({"step": 0.1, "steps": 1, "duration": 1})", "both", "\"duration\""},
      {R"({"step": 0.1, "steps": 0})", "steps", "an integer from 1"},
      {R"({"step": 0.1, "steps": 2.5})", "steps", "an integer"},
      {R"({"step": 1e-9, "duration": 1e9})", "duration", "steps"},
      {R"({"step": 0.1, "steps": 1, "step": 2})", "\"step\"", "twice"},
      {R"({"step": 0.1, "steps": 1})", "test.json", "\"assets\" is missing"},
      {R"({"step": 0.1, "steps": 1, "assets": {}})", "assets", "at least one"},
      {R"({"step": 0.1, "steps": 1, "assets": {"a": 3}})", "assets.a", "text"},
      {R"({"step": 0.1, "steps": 1, "assets": {"a": ""}})", "assets.a", "a file name"},
      {R"({"step": 0.1, "steps": 1, "assets": {"a": "b"}, "bodies": []})", "bodies", "at least one body"},
      {R"({"step": 0.1, "steps": 1, "assets": {"a": "b"}, "bodies": {}})", "bodies", "an array"},
      {scene_with(kBell, R"("substeps": 0)"), "substeps", "an integer from 1"},
      {scene_with(kBell, R"("substeps": 1.5)"), "substeps", "an integer"},
      {scene_with(kBell, R"("sleep": true)"), "sleep", "an object"},
      {scene_with(kBell, R"("sleep": {"time": -1})"), "sleep.time", ">= 0"},
      {scene_with(kBell, R"("sleep": {"sped": 1})"), "sleep", "did you mean \"speed\""},
      {scene_with(kBell, R"("gravty": [0, 0, 0])"), "gravty", "did you mean \"gravity\""},
      {scene_with(kBell, R"("gravity": [0, 0])"), "gravity", "array of 3 numbers"},
      {scene_with(kBell, R"("gravity": [0, 0, null])"), "gravity[2]", "a finite number"},
      {scene_with(R"({"asset": "bell"})"), "bodies[0]", "\"name\" is missing"},
      {scene_with(R"({"name": "x", "asset": "ball"})"), "bodies[0].asset", "did you mean \"bell\""},
      {scene_with(R"({"name": "x", "asset": "bell", "postion": [0, 0, 0]})"), "bodies[0]", "did you mean \"position\""},
      {scene_with(R"({"name": "x", "asset": "bell", "part": -1})"), "bodies[0].part", "an integer from 0"},
      {scene_with(R"({"name": "x", "asset": "bell", "orientation": [0, 0, 0, 0]})"), "orientation", "a quaternion"},
      {scene_with(R"({"name": "x", "asset": "bell", "orientation": {"axis": [0, 0, 0], "degrees": 3}})"),
       "orientation.axis", "> 0"},
      {scene_with(R"({"name": "x", "asset": "bell", "orientation": {"axis": [0, 0, 1], "radians": 3}})"), "orientation",
       "\"degrees\" is missing"},
      {scene_with(kBell + "," + kBell), "bodies[1].name", "one name each"},
      {scene_with(R"({"name": "x", "asset": "bell", "copies": {"count": [1.5, 1, 1], "spacing": [1, 1, 1]}})"),
       "copies.count", "whole numbers"},
      {scene_with(R"({"name": "x", "asset": "bell", "copies": {"count": [9999, 9999, 9999], "spacing": [1, 1, 1]}})"),
       "copies.count", "at most 100000"},
      {scene_with(R"({"name": "x", "asset": "bell", "motion": {}})"), "bodies[0].motion", "one of \"shake\""},
      {scene_with(R"({"name": "x", "asset": "bell", "motion": {"keys": []}})"), "motion.keys", "at least one key"},
      {scene_with(R"({"name": "x", "asset": "bell", "motion": {"keys": [{"time": 1}, {"time": 1}]}})"), "keys[1].time",
       "after the key before"},
      {scene_with(
           R"({"name": "x", "asset": "bell", "motion": {"shake": {"axis": [1, 0, 0], "amplitude": 1, "frequency": 0}}})"),
       "shake.frequency", "> 0"},
      {scene_with(R"({"name": "x", "asset": "bell", "velocity": [1, 0, 0], "motion": {"keys": [{"time": 1}]}})"),
       "bodies[0]", "\"motion\""},
      {strike(R"("time": 1, "at": {"vertex": 0})"), "strikes[0].time", "[0, 1.0) s"},
      {strike(R"("time": -0.1, "at": {"vertex": 0})"), "strikes[0].time", "within the scene's duration"},
      {strike(R"("time": 0)"), "strikes[0]", "\"at\" is missing"},
      {strike(R"("time": 0, "at": {})"), "strikes[0].at", "exactly one of"},
      {strike(R"("time": 0, "at": {"vertex": 0, "triangle": 1})"), "strikes[0].at", "exactly one of"},
      {strike(R"("time": 0, "at": {"vertex": -1})"), "at.vertex", "an integer from 0"},
      {strike(R"("time": 0, "at": {"vertex": 0, "frame": "body"})"), "strikes[0].at", "\"frame\" is unknown"},
      {strike(R"("time": 0, "at": {"triangle": 0, "weights": [1, 1, 1]})"), "at.weights", "the sum 1"},
      {strike(R"("time": 0, "at": {"triangle": 0, "weights": [2, -1, 0]})"), "at.weights", ">= 0"},
      {strike(R"("time": 0, "at": {"ray": {"from": [0, 0, 0], "direction": [0, 0, 0]}})"), "ray.direction", "> 0"},
      {strike(R"("time": 0, "at": {"nearest": [0, 0, 0], "frame": "wrold"})"), "at.frame", "\"world\""},
      {strike(R"("time": 0, "at": {"vertex": 0}, "axes": "local")"), "strikes[0].axes", "\"body\""},
      {scene_with(kBell, R"("strikes": [{"body": "bel", "time": 0, "at": {"vertex": 0}, "impulse": [1, 0, 0]}])"),
       "strikes[0].body", "did you mean \"bell\""},
      {scene_with(kBell, R"("forces": [{"body": "bell", "at": {"vertex": 0}, "force": [1, 0, 0], "duration": 0.001}])"),
       "forces[0].duration", "at least one step"},
      {scene_with(kBell, R"("forces": [{"body": "bell", "at": {"vertex": 0}, "impulse": [1, 0, 0]}])"), "forces[0]",
       "\"force\" is missing"},
      {scene_with(kBell, R"("limits": {"max_force": 3})"), "limits", "expected both or none"},
      {scene_with(kBell, R"("limits": {"max_modes": -3})"), "limits.max_modes", "an integer from 0"},
      {scene_with(kBell, R"("limits": {"framerate": 3})"), "limits", "did you mean \"frame_rate\""},
  };
  for (const BadScene& bad : scenes) {
    SCOPED_TRACE(bad.text);
    try {
      parse(bad.text);
      ADD_FAILURE() << "was accepted";
    } catch (const InputError& e) {
      const std::string message = e.what();
      EXPECT_THAT(message, ::testing::StartsWith("\"test.json\""));
      EXPECT_THAT(message, ::testing::HasSubstr(bad.place));
      EXPECT_THAT(message, ::testing::HasSubstr(bad.expected));
      EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    }
  }
}

TEST(SceneFile, AMissingFileOrAFolderIsToldByName) {
  for (const std::string& path : {std::string("no-such-scene.json"), std::string(LIMBER_SOURCE_DIR)}) {
    try {
      read_scene(path);
      ADD_FAILURE() << path << " was accepted";
    } catch (const InputError& e) {
      EXPECT_THAT(std::string(e.what()), ::testing::HasSubstr(path));
    }
  }
}

TEST(SceneFile, EveryExampleInItsManualPageIsAScene) {
  const std::string page = read_file(LIMBER_SOURCE_DIR "/docs/formats/scene.md");
  const std::string open = "```json\n", close = "```";
  int examples = 0;
  for (std::size_t at = page.find(open); at != std::string::npos; at = page.find(open, at)) {
    at += open.size();
    const std::string text = page.substr(at, page.find(close, at) - at);
    SCOPED_TRACE(text);
    EXPECT_NO_THROW(parse(text));
    ++examples;
  }
  EXPECT_GE(examples, 2);
}

}  // namespace
}  // namespace limber
