// Scene files: what they mean, and one clear line for everything that is wrong in one.
#include "limber/scene/scene_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <sstream>

#include "block_model.h"
#include "folders.h"
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
                "orientation": [2, 0, 0, 0], "velocity": [4, 5, 6], "angular_velocity": [7, 8, 9],
                "inertial_coupling": true}],
    "strikes": [{"body": "left", "time": 0.5, "at": {"triangle": 4, "weights": [0.5, 0.25, 0.25]},
                 "impulse": [0, 0, -1], "axes": "body"}],
    "forces": [{"body": "left", "start": 0.1, "duration": 0.2, "at": {"nearest": [0, 0, 1], "frame": "input"},
                "force": [1, 0, 0]}]})");
  EXPECT_EQ(s.step, 0.002);
  EXPECT_TRUE(s.bodies[0].placement.inertial_coupling);
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

TEST(SceneFile, ABodyTouchesItselfIfToldSoAndIfItDeforms) {
  const std::string contact = R"("contact": {})";
  EXPECT_FALSE(parse(scene_with(kBell, contact)).bodies.at(0).placement.filter.self);
  const Scene s = parse(scene_with(R"({"name": "bell", "asset": "bell", "touches_itself": true})", contact));
  EXPECT_TRUE(s.bodies.at(0).placement.filter.self);
  EXPECT_THROW(parse(scene_with(R"({"name": "bell", "asset": "bell", "touches_itself": true,
                                    "shape": {"sphere": {"radius": 1}}})",
                                contact)),
               InputError);
  EXPECT_THROW(parse(scene_with(R"({"name": "bell", "asset": "bell", "touches_itself": true})", "\"time\": 0")),
               InputError);
}

TEST(SceneFile, ABodyMayHaveItsShareOfGravityDampingAndLocks) {
  const std::string with = R"({"name": "bell", "asset": "bell", )";
  const FrameSettings s = parse(scene_with(with + R"("gravity_scale": -0.5, "damping": {"linear": 2, "angular": 3},
                                                     "locks": {"translation": ["x", "z"], "rotation": ["y"]}})"))
                              .bodies.at(0)
                              .placement.frame;
  EXPECT_EQ(s.gravity_scale, -0.5);
  EXPECT_EQ(s.linear_damping, 2.0);
  EXPECT_EQ(s.angular_damping, 3.0);
  EXPECT_EQ(s.locks, (AxisLocks{.translation = {true, false, true}, .rotation = {false, true, false}}));
  for (const char* wrong : {R"("damping": {"linear": -1}})", R"("damping": {"turning": 1}})", R"("locks": ["x"]})",
                            R"("locks": {"translation": ["w"]}})", R"("locks": {"rotation": "x"}})"})
    EXPECT_THROW(parse(scene_with(with + wrong)), InputError) << wrong;
  EXPECT_THROW(parse(scene_with(with + R"("locks": {"rotation": ["x"]}})", R"("solver": "exact")")), InputError);
  EXPECT_THROW(parse(scene_with(with + R"("damping": {"linear": 1}})", R"("solver": "exact")")), InputError);
}

/// [H03]'s rules are read where limber::hauser is built; elsewhere they are refused by name.
TEST(SceneFile, ARuleForContactsIsReadOrRefusedAsTheBuildHasIt) {
  const std::string told = scene_with(R"({"name": "bell", "asset": "bell"})",
                                      R"("contact": {"method": "gap_program", "friction_model": "heuristic_no_slip"})");
#if LIMBER_HAS_HAUSER
  const Scene s = parse(told);
  EXPECT_EQ(s.contacts.rule.method, SceneContactRule::Method::kGapProgram);
  EXPECT_EQ(s.contacts.rule.friction, SceneContactRule::Friction::kHeuristicNoSlip);
  EXPECT_FALSE(s.contacts.rule.is_own());
  EXPECT_EQ(s.contacts.solver, ContactSolver::kExact);
  EXPECT_THROW(parse(scene_with(R"({"name": "bell", "asset": "bell"})",
                                R"("solver": "game", "contact": {"method": "gap_program"})")),
               InputError);
#else
  try {
    parse(told);
    FAIL() << "expected an InputError";
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), ::testing::HasSubstr("contact.method: is \"gap_program\", and this build"));
    EXPECT_THAT(e.what(), ::testing::HasSubstr("LIMBER_BUILD_PAPERS=ON"));
  }
#endif
}

TEST(SceneFile, TheSolverIsGameUnlessTheFileChoosesTheExactOne) {
  const std::string bell = R"({"name": "bell", "asset": "bell"})";
  const Scene usual = parse(scene_with(bell));
  EXPECT_EQ(usual.contacts.solver, ContactSolver::kGame);
  EXPECT_EQ(usual.contacts.small_steps.substeps, SmallSteps{}.substeps);
  const Scene chosen = parse(scene_with(bell, R"("solver": "exact", "small_steps": 16)"));
  EXPECT_EQ(chosen.contacts.solver, ContactSolver::kExact);
  EXPECT_EQ(chosen.contacts.small_steps.substeps, 16);
}

TEST(SceneFile, ContactIsReadWhereItBelongs) {
  const Scene s = parse(scene_with(
      R"({"name": "bell", "asset": "bell", "friction": 0.3, "restitution": 0.4, "shape": {"capsule": {"radius": 2, "half_length": 3}},
          "layers": [0, 2], "meets": [1], "copies": {"count": [2, 1, 1], "spacing": [1, 0, 0]}})",
      R"("contact": {"friction": 0.7, "guard": "none", "recovery_speed": 0.2, "rolling_friction": 0.04,
                     "residual_compliance": true, "penalty_frequency": 30, "penalty_damping": 0.5},
         "statics": [{"name": "ground", "shape": {"half_space": {"normal": [0, 3, 4], "offset": 2}}, "friction": 0,
                      "position": [1, 2, 3]},
                     {"name": "hill", "shape": {"height_field": {"spacing": [2, 3], "heights": [[0, 1, 2], [3, 4, 5]]}}},
                     {"name": "rock", "shape": {"mesh": {"file": "rock.obj", "scale": 0.1}}}])"));
  ASSERT_TRUE(s.contacts.options);
  EXPECT_TRUE(s.contacts.rule.is_own());
  EXPECT_EQ(s.contacts.rule.guard, SceneContactRule::Guard::kNone);
  EXPECT_EQ(s.contacts.options->friction, 0.7);
  EXPECT_EQ(s.bodies[0].placement.restitution, 0.4);
  EXPECT_EQ(s.contacts.options->rolling_friction, 0.04);
  EXPECT_EQ(s.contacts.options->recovery_speed, 0.2);
  EXPECT_TRUE(s.contacts.options->residual_compliance);
  EXPECT_EQ(s.contacts.rule.penalty_frequency, 30.0);
  EXPECT_EQ(s.contacts.rule.penalty_damping, 0.5);
  ASSERT_EQ(s.statics.size(), 3u);
  const auto shape_of = [&](int i) { return *std::get<std::shared_ptr<const Shape>>(s.statics[i].shape); };
  EXPECT_LT((std::get<HalfSpace>(shape_of(0)).normal - Vec3(0, 0.6, 0.8)).norm(), kRoundOff);
  EXPECT_EQ(std::get<HalfSpace>(shape_of(0)).offset, 2.0);
  EXPECT_EQ(s.statics[0].friction, 0.0);
  EXPECT_EQ(s.statics[0].pose.p, Vec3(1, 2, 3));
  const auto field = std::get<HeightField>(shape_of(1));
  EXPECT_EQ(field.columns, 3);
  EXPECT_EQ(field.rows, 2);
  EXPECT_EQ(field.spacing_y, 3.0);
  EXPECT_THAT(field.heights, ::testing::ElementsAre(0.f, 1.f, 2.f, 3.f, 4.f, 5.f));
  EXPECT_EQ(std::get<ShapeFile>(s.statics[2].shape), (ShapeFile{"folder/rock.obj", 0.1, false}));
  const SceneBody& copy = s.bodies.at(1);
  EXPECT_EQ(copy.placement.friction, 0.3);
  EXPECT_EQ(copy.placement.filter.layers, 5u);
  EXPECT_EQ(copy.placement.filter.mask, 2u);
  EXPECT_EQ(copy.shape, s.bodies[0].shape);  // one shape for all copies
  EXPECT_EQ(std::get<Capsule>(*std::get<std::shared_ptr<const Shape>>(copy.shape)).half_length, 3.0);
}

TEST(SceneFile, NothingTouchesWhereTheSceneSaysNothingOfIt) {
  EXPECT_FALSE(parse(scene_with(kBell)).contacts.options);
  EXPECT_TRUE(parse(scene_with(kBell, R"("contact": {})")).contacts.options);
  EXPECT_TRUE(parse(scene_with(kBell, R"("statics": [{"name": "g", "shape": {"half_space": {}}}])")).contacts.options);
}

TEST(SceneFile, HandlesAndJointsAreReadWhereTheyBelong) {
  const Scene s = parse(scene_with(
      kBell + R"(, {"name": "clapper", "asset": "bell"})",
      R"("handles": [{"body": "bell", "start": 0.5, "duration": 0.25, "at": {"vertex": 3}, "stiffness": 100, "damping": 2,
                      "max_force": 50, "directions": [[0, 0, 2]],
                      "motion": {"keys": [{"time": 0.1, "position": [1, 2, 3]}]}}],
         "joints": [{"b": "bell", "type": "fixed", "origin": [1, 1, 1]},
                    {"a": "bell", "b": "clapper", "type": "cylindrical", "origin": [0, 0, 1], "axis": [0, 0, 2],
                     "limits": {"rotation": [-1, 1], "translation": [null, 0.5]}, "patch_radius": 0.1, "collide": true,
                     "coordinates": [{"motor": {"velocity": 2, "max_force": 3}, "friction": 0.1},
                                     {"drive": {"target": 0.2, "stiffness": 5, "damping": 1}}]}])"));
  ASSERT_EQ(s.handles.size(), 1u);
  EXPECT_EQ(s.handles[0].start, 0.5);
  EXPECT_EQ(s.handles[0].duration, 0.25);
  EXPECT_EQ(s.handles[0].options.stiffness, 100.0);
  EXPECT_EQ(s.handles[0].options.damping, 2.0);
  EXPECT_EQ(s.handles[0].options.max_force, 50.0);
  EXPECT_THAT(s.handles[0].options.directions, ::testing::ElementsAre(Vec3(0, 0, 1)));
  EXPECT_EQ(std::get<std::vector<PoseKey>>(s.handles[0].movement)[0].pose.p, Vec3(1, 2, 3));
  ASSERT_EQ(s.joints.size(), 2u);
  EXPECT_EQ(s.joints[0].a, "");
  const SceneJoint& j = s.joints[1];
  EXPECT_EQ(j.spec.type, JointType::kCylindrical);
  EXPECT_EQ(j.spec.frame.origin, Vec3(0, 0, 1));
  EXPECT_LT((j.spec.frame.axes.col(0) - Vec3::UnitZ()).norm(), kRoundOff);
  EXPECT_EQ(j.spec.limits.rotation, (Interval{-1.0, 1.0}));
  EXPECT_EQ(j.spec.limits.translation[0].high, 0.5);
  EXPECT_EQ(j.patch_radius, 0.1);
  EXPECT_TRUE(j.collide);
  ASSERT_EQ(j.coordinates.size(), 2u);
  EXPECT_EQ(j.coordinates[0].motor_velocity, 2.0);
  EXPECT_EQ(j.coordinates[0].motor_max_force, 3.0);
  EXPECT_EQ(j.coordinates[0].friction, 0.1);
  EXPECT_EQ(j.coordinates[1].drive_target, 0.2);
  EXPECT_EQ(j.coordinates[1].drive_stiffness, 5.0);
  EXPECT_EQ(j.coordinates[1].drive_damping, 1.0);
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

std::string static_of(const std::string& shape) {
  return scene_with(kBell, R"("statics": [{"name": "s", "shape": )" + shape + "}]");
}
std::string contact(const std::string& inside) { return scene_with(kBell, R"("contact": {)" + inside + "}"); }
std::string handle(const std::string& inside) {
  return scene_with(kBell, R"("handles": [{"body": "bell", "at": {"vertex": 0}, )" + inside + "}]");
}
std::string joint(const std::string& inside) {
  return scene_with(kBell + R"(, {"name": "other", "asset": "bell"}, {"name": "two", "asset": "bell",
                               "copies": {"count": [2, 1, 1], "spacing": [1, 0, 0]}})",
                    R"("joints": [{"b": "bell", "origin": [0, 0, 0], )" + inside + "}]");
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
      {scene_with(kBell, R"("limits": {"max_modes": 0})"), "limits.max_modes", "an integer from 1"},
      {scene_with(kBell, R"("limits": {"framerate": 3})"), "limits", "did you mean \"frame_rate\""},
      {contact(R"("method": "lcp")"), "contact.method", "\"gap_program\", \"complementary\""},
      {contact(R"("friction_model": "coulomb")"), "contact.friction_model", "\"cone\""},
      {contact(R"("guard": 1)"), "contact.guard", "text"},
      {scene_with(kBell, R"("solver": "soft")"), "solver", "\"exact\""},
      {scene_with(kBell, R"("small_steps": 0)"), "small_steps", "an integer from 1"},
      {contact(R"("friction": -0.1)"), "contact.friction", ">= 0"},
      {contact(R"("penalty_frequency": 0)"), "contact.penalty_frequency", "> 0"},
      {contact(R"("residual_compliance": 1)"), "contact.residual_compliance", "true or false"},
      {contact(R"("fricton": 1)"), "contact", "did you mean \"friction\""},
      {static_of("{}"), "statics[0].shape", "exactly one of"},
      {static_of("3"), "statics[0].shape", "an object"},
      {static_of(R"({"cube": {}})"), "statics[0].shape", "\"cube\" is unknown"},
      {static_of(R"({"sphere": {"radius": 1}, "box": {"half_extents": [1, 1, 1]}})"), "statics[0].shape",
       "exactly one of"},
      {static_of(R"({"half_space": {"normal": [0, 0, 0]}})"), "half_space.normal", "> 0"},
      {static_of(R"({"sphere": {"radius": 0}})"), "sphere.radius", "> 0"},
      {static_of(R"({"sphere": {"raduis": 1}})"), "shape.sphere", "\"raduis\""},
      {static_of(R"({"capsule": {"radius": 1, "half_length": -1}})"), "capsule.half_length", ">= 0"},
      {static_of(R"({"box": {"half_extents": [1, 0, 1]}})"), "box.half_extents", "> 0"},
      {static_of(R"({"hull": {"points": [[0, 0, 0], [1, 0, 0]]}})"), "shape.hull", "at least 4"},
      {static_of(R"({"hull": {"points": [[0, 0], [1, 0, 0]]}})"), "hull.points[0]", "array of 3 numbers"},
      {static_of(R"({"hull": {}})"), "shape.hull", "\"points\" is missing"},
      {static_of(R"({"mesh": {"file": ""}})"), "mesh.file", "a file name"},
      {static_of(R"({"mesh": {"file": "a.obj", "scale": 0}})"), "mesh.scale", "> 0"},
      {static_of(R"({"height_field": {"spacing": [1, 1], "heights": [[1, 2], [3]]}})"), "heights[1]", "2, as in"},
      {static_of(R"({"height_field": {"spacing": [1, 1], "heights": [[1, 2]]}})"), "height_field", "at least 2"},
      {static_of(R"({"height_field": {"spacing": [1, 1], "heights": [[1, null], [1, 2]]}})"), "heights[0][1]",
       "a finite number"},
      {static_of(R"({"height_field": {"spacing": [1, 0], "heights": []}})"), "height_field.spacing", "> 0"},
      {scene_with(kBell, R"("statics": [{"shape": {"half_space": {}}}])"), "statics[0]", "\"name\" is missing"},
      {scene_with(kBell, R"("statics": [{"name": "bell", "shape": {"half_space": {}}}])"), "statics[0].name",
       "one name each"},
      {scene_with(kBell, R"("sensors": [{"name": "bell", "shape": {"sphere": {"radius": 1}}}])"), "sensors[0].name",
       "the name of another"},
      {scene_with(kBell, R"("sensors": [{"name": "s", "shape": {"half_space": {}}}])"), "sensors[0].shape",
       "a convex shape"},
      {scene_with(kBell, R"("sensors": [{"name": "s", "shape": {"mesh": {"file": "rock.obj"}}}])"), "sensors[0].shape",
       "a convex shape"},
      {scene_with(kBell, R"("sensors": [{"name": "s", "friction": 1, "shape": {"sphere": {"radius": 1}}}])"),
       "sensors[0]", "friction"},
      {scene_with(kBell, R"("statics": [{"name": "s", "layers": [32], "shape": {"half_space": {}}}])"),
       "statics[0].layers[0]", "0 to 31"},
      {scene_with(R"({"name": "x", "asset": "bell", "friction": 0.5})"), "bodies[0].friction", "\"contact\": {}"},
      {scene_with(R"({"name": "x", "asset": "bell", "restitution": 0.5})"), "bodies[0].restitution", "\"contact\": {}"},
      {scene_with(R"({"name": "x", "asset": "bell", "restitution": 1.5})", R"("contact": {})"), "bodies[0].restitution",
       "0 to 1"},
      {scene_with(R"({"name": "x", "asset": "bell", "restitution": 0.5})", R"("contact": {}, "solver": "exact")"),
       "bodies[0].restitution", "\"exact\""},
      {scene_with(R"({"name": "x", "asset": "bell", "shape": {"half_space": {}}})", R"("contact": {})"),
       "bodies[0].shape", "a shape that ends"},
      {handle(R"("start": 1)"), "handles[0].start", "[0, 1.0) s"},
      {handle(R"("duration": 0.001)"), "handles[0].duration", "at least one step"},
      {handle(R"("damping": 1)"), "handles[0]", "without a stiffness"},
      {handle(R"("max_force": 0)"), "handles[0].max_force", "> 0"},
      {handle(R"("directions": [])"), "handles[0].directions", "1 to 3"},
      {handle(R"("directions": [[1, 0, 0], [1, 1, 0]])"), "handles[0]", "orthonormal"},
      {handle(R"("directions": [[1, 0, 0], 3])"), "handles[0].directions[1]", "array of 3 numbers"},
      {handle(R"("motion": {"keys": [{"time": 1}]})"), "handles[0].motion.keys[0]", "\"position\" is missing"},
      {handle(R"("motion": {"keys": [{"time": 1, "position": [0, 0, 0], "orientation": [1, 0, 0, 0]}]})"),
       "handles[0].motion.keys[0]", "\"orientation\" is unknown"},
      {joint(R"("axis": [1, 0, 0])"), "joints[0]", "\"type\" is missing"},
      {joint(R"("type": "hinge")"), "joints[0].type", "\"revolute\""},
      {joint(R"("type": "revolute")"), "joints[0]", "\"axis\" is missing"},
      {joint(R"("type": "ball", "a": "bell")"), "joints[0].b", "another body"},
      {joint(R"("type": "ball", "a": "othr")"), "joints[0].a", "did you mean \"other\""},
      {joint(R"("type": "ball", "a": "two")"), "joints[0].a", "such as \"two[0]\""},
      {joint(R"("type": "ball", "limits": {"rotation": [0, 1]})"), "joints[0].limits.rotation", "no such limit"},
      {joint(R"("type": "fixed", "coordinates": [{}])"), "joints[0].coordinates", "at most 0"},
      {joint(R"("type": "ball", "coordinates": [{"motor": {"velocity": 1}}])"), "joints[0].coordinates[0].motor",
       "\"max_force\" is missing"},
      {joint(R"("type": "ball", "patch_radius": -1)"), "joints[0].patch_radius", ">= 0"},
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

TEST(SceneFile, EverySceneThatIsShippedIsOne) {
  int scenes = 0;
  for (const auto& entry : std::filesystem::directory_iterator(LIMBER_SOURCE_DIR "/assets/scenes")) {
    if (entry.path().extension() != ".json") continue;
    EXPECT_NO_THROW(read_scene(entry.path())) << entry.path();
    ++scenes;
  }
  EXPECT_GE(scenes, 2);
}

TEST(SceneFile, EveryExampleInItsManualPageIsAScene) {
  const std::string page = read_file(LIMBER_SOURCE_DIR "/docs/formats/scene.md");
  const std::string open = "```json\n", close = "```";
  // The one with a machine reads its asset.
  const std::filesystem::path folder = std::filesystem::path(::testing::TempDir()) / "scene_manual_page";
  std::filesystem::create_directories(folder);
  write_asset(folder / "lamp.glb", {.bodies = {testing::block_model(1, "arm 1"), testing::block_model(1, "arm 2")},
                                    .joints = {{.a = 0, .b = 1, .spec = {.type = JointType::kRevolute}}}});
  int examples = 0;
  for (std::size_t at = page.find(open); at != std::string::npos; at = page.find(open, at)) {
    at += open.size();
    const std::string text = page.substr(at, page.find(close, at) - at);
    SCOPED_TRACE(text);
    EXPECT_NO_THROW(parse_scene(text, "\"test.json\"", folder));
    ++examples;
  }
  std::filesystem::remove_all(folder);
  EXPECT_GE(examples, 2);
}

}  // namespace
}  // namespace limber
