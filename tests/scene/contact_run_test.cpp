// Scenes whose bodies touch, hang and are held: what the file says of them acts as it says, against statics and closed
// forms.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>

#include "block_model.h"
#include "constants.h"
#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/scene/run.h"

namespace limber {
namespace {

using testing::block_asset;
using testing::kBlockLength;
using testing::kBlockMass;
using testing::kGravity;

/// A scene of blocks, 2 m × 1 m × 1 m, without modes.
std::string rigid(const std::string& inside, const std::string& steps = "100") {
  return R"({"step": 0.02, "steps": )" + steps + R"(, "assets": {"block": "block.glb"}, )" + inside + "}";
}

/// The same by the exact solver.
std::string exact(const std::string& inside, const std::string& steps = "100") {
  return rigid(R"("solver": "exact", )" + inside, steps);
}

RunResult play(const std::string& text, const std::filesystem::path& folder = "") {
  const Scene scene = parse_scene(text, "\"test.json\"", folder);
  return run_scene(scene, make_models(scene, {{"block", block_asset(0)}}), {.key_rate = 1e6, .keep_contacts = true});
}

const BodyTrack& track(const RunResult& r, const std::string& name) {
  return *std::find_if(r.trajectory.bodies.begin(), r.trajectory.bodies.end(),
                       [&](const BodyTrack& body) { return body.name == name; });
}
Vec3 end_of(const RunResult& r, const std::string& name) { return track(r, name).poses.back().p; }

const std::string kGround = R"("statics": [{"name": "ground", "shape": {"half_space": {}}}])";

std::string block_at(const std::string& name, const std::string& position, const std::string& more = "") {
  return R"({"name": ")" + name + R"(", "asset": "block", "position": )" + position + more + "}";
}
std::string bodies(const std::string& list) { return R"("bodies": [)" + list + "]"; }

TEST(ContactRun, ABlockThatFallsComesToRestOnTheGroundAndTheGroundCarriesItsWeight) {
  const RunResult r = play(exact(kGround + "," + bodies(block_at("b", "[0, 0, 0.7]"))));
  EXPECT_NEAR(end_of(r, "b").z(), 0.5, 1e-7);
  EXPECT_EQ(r.constraints.limit_steps + r.constraints.failed_steps, 0);
  EXPECT_GT(r.constraints.begun, 0);
  Vec3 carried = Vec3::Zero();
  const double last = r.trajectory.times.back();
  for (const ContactRecord& c : r.trajectory.contacts) {
    EXPECT_EQ(r.trajectory.name(c.a), "b");
    EXPECT_EQ(r.trajectory.name(c.b), "ground");
    if (c.time == last) carried += c.impulse;
  }
  // Gaps are closed to 1e-9 of the block's length; what that is as an impulse.
  const double tolerance = kBlockMass * 1e-9 * kBlockLength / 0.02;
  EXPECT_NEAR((carried - Vec3(0, 0, kBlockMass * kGravity * 0.02)).norm(), 0.0, tolerance);
}

TEST(ContactRun, AStackOfBlocksRestsAlikeWhoeverFindsTheContactsAndABuildWithoutFclSaysSo) {
  const auto stack = [](const std::string& finder) {
    const std::string contact = R"("contact": {"finder": ")" + finder + R"("},)";
    return exact(contact + kGround + "," + bodies(block_at("b", "[0, 0, 0.6]") + "," + block_at("c", "[0.3, 0, 1.8]")),
                 "150");
  };
  const RunResult limber = play(stack("limber"));
  std::string refused;
  try {
    const RunResult fcl = play(stack("fcl"));
    // Gaps are closed to 1e-7 m at rest; along the ground each slides where its own contacts let it.
    for (const std::string name : {"b", "c"})
      EXPECT_NEAR(end_of(fcl, name).z(), end_of(limber, name).z(), 1e-6) << name;
    EXPECT_EQ(fcl.constraints.limit_steps + fcl.constraints.failed_steps, 0);
  } catch (const InputError& e) {
    refused = e.what();
  }
  EXPECT_THAT(refused, ::testing::AnyOf("", ::testing::HasSubstr("contact.finder: is \"fcl\", and this build")));
  EXPECT_THROW(play(stack("ode")), InputError);
}

TEST(ContactRun, WithoutContactBodiesPassThroughEachOther) {
  const RunResult r = play(rigid(bodies(block_at("b", "[0, 0, 0.7]") + "," + block_at("c", "[0, 0, 3]"))));
  EXPECT_NEAR(end_of(r, "b").z(), 0.7 - 0.5 * kGravity * 4.0, 1e-9);
  EXPECT_TRUE(r.trajectory.contacts.empty());
}

TEST(ContactRun, BodiesMeetEachOtherAlsoWhereNothingStands) {
  const RunResult r =
      play(exact(R"("gravity": [0, 0, 0], "contact": {},)" +
                 bodies(block_at("b", "[0, 0, 0]", R"(, "velocity": [1, 0, 0])") + "," + block_at("c", "[3, 0, 0]"))));
  // Rigid bodies that absorb the impact go on together at half the speed, from the touch at 1 s on.
  EXPECT_NEAR(end_of(r, "b").x(), 1.5, 0.03);
  EXPECT_NEAR(end_of(r, "c").x() - end_of(r, "b").x(), 2.0, 1e-6);
}

// A slope of 0.3 rad; a pair's friction is the geometric mean of both bodies'.
TEST(ContactRun, FrictionOfEachBodyDecidesWhetherItHoldsOnASlope) {
  const std::string slope =
      R"("contact": {"friction": 0.9},
         "statics": [{"name": "slope", "friction": 0.4, "orientation": {"axis": [0, 1, 0], "degrees": 17.188733853924695},
                      "shape": {"box": {"half_extents": [50, 50, 1]}}}])";
  const double angle = 0.3, mu = std::sqrt(0.1 * 0.4);
  const Vec3 down(std::cos(angle), 0.0, -std::sin(angle)), up(std::sin(angle), 0.0, std::cos(angle));
  const auto lying = [&](const std::string& name, double across, const std::string& more) {
    const Vec3 p = 1.5 * up + Vec3(0.0, across, 0.0);
    return block_at(name, "[" + std::to_string(p.x()) + "," + std::to_string(p.y()) + "," + std::to_string(p.z()) + "]",
                    R"(, "orientation": {"axis": [0, 1, 0], "degrees": 17.188733853924695})" + more);
  };
  const RunResult r =
      play(rigid(slope + "," + bodies(lying("rough", 0.0, "") + "," + lying("smooth", 5.0, R"(, "friction": 0.1)"))));
  const auto slid = [&](const std::string& name) { return down.dot(end_of(r, name) - track(r, name).poses.front().p); };
  EXPECT_NEAR(slid("rough"), 0.0, 1e-4);  // √(0.9 · 0.4) = 0.6 > tan 0.3
  const double expected = 0.5 * kGravity * (std::sin(angle) - mu * std::cos(angle)) * 4.0;
  EXPECT_NEAR(slid("smooth"), expected, 0.03 * expected);  // sliding starts up to a step late
}

TEST(ContactRun, WhatDoesNotMeetALayerFallsThroughIt) {
  const RunResult r = play(
      exact(R"("statics": [{"name": "ground", "layers": [3], "shape": {"half_space": {}}}],)" +
            bodies(block_at("stays", "[0, 0, 0.7]") + "," + block_at("falls", "[5, 0, 0.7]", R"(, "meets": [0])"))));
  EXPECT_NEAR(end_of(r, "stays").z(), 0.5, 1e-7);
  EXPECT_LT(end_of(r, "falls").z(), -10.0);
}

struct Standing {
  std::string shape, position;  ///< of what stands
  double height;                ///< of the block's centre at rest
};

void PrintTo(const Standing& s, std::ostream* out) { *out << s.shape; }

class ContactRunOnShape : public ::testing::TestWithParam<Standing> {};

TEST_P(ContactRunOnShape, ABlockComesToRestOnIt) {
  const auto folder =
      std::filesystem::path(::testing::TempDir()) / ("limber_ContactRunOnShape_" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder);
  write_file(folder / "box.obj",
             "v -3 -3 -1\nv 3 -3 -1\nv 3 3 -1\nv -3 3 -1\nv -3 -3 1\nv 3 -3 1\nv 3 3 1\nv -3 3 1\n"
             "f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n");
  const RunResult r = play(
      rigid(R"("statics": [{"name": "s", "position": )" + GetParam().position + R"(, "shape": )" + GetParam().shape +
            "}]," + bodies(block_at("b", "[0.01, 0.02, " + std::to_string(GetParam().height + 0.1) + "]"))),
      folder);
  EXPECT_NEAR(end_of(r, "b").z(), GetParam().height, 1e-3);
  std::filesystem::remove_all(folder);
}

INSTANTIATE_TEST_SUITE_P(
    Shapes, ContactRunOnShape,
    ::testing::Values(
        Standing{R"({"half_space": {"normal": [0, 0, 2], "offset": -1}})", "[0, 0, 0]", -0.5},
        Standing{R"({"box": {"half_extents": [3, 3, 1]}})", "[0, 0, 0]", 1.5},
        Standing{
            R"({"hull": {"points": [[-3,-3,-1],[3,-3,-1],[3,3,-1],[-3,3,-1],[-3,-3,1],[3,-3,1],[3,3,1],[-3,3,1]]}})",
            "[0, 0, 2]", 3.5},
        Standing{R"({"hull": {"file": "box.obj", "scale": 2}})", "[0, 0, 0]", 2.5},
        Standing{R"({"mesh": {"file": "box.obj"}})", "[0, 0, 0]", 1.5},
        Standing{R"({"height_field": {"spacing": [4, 4], "heights": [[2, 2, 2], [2, 2, 2], [2, 2, 2]]}})",
                 "[-4, -4, 0]", 2.5}));

TEST(ContactRun, ABodyThatWearsAShapeLiesOnThat) {
  const RunResult r =
      play(exact(kGround + "," +
                 bodies(block_at("b", "[0, 0, 2]", R"(, "shape": {"box": {"half_extents": [1, 1, 0.75]}})") + "," +
                        block_at("round", "[9, 0, 2]", R"(, "shape": {"sphere": {"radius": 0.9}})"))));
  EXPECT_NEAR(end_of(r, "b").z(), 0.75, 1e-6);
  EXPECT_NEAR(end_of(r, "round").z(), 0.9, 1e-6);
}

#if LIMBER_HAS_HAUSER
TEST(ContactRun, TheMethodOfTheFileIsTheOneThatActs) {
  // The penalty's springs give way under the weight: n of them by m g/(n k), k = m (2πν)².
  const std::string soft = R"("contact": {"method": "penalty", "penalty_frequency": 5, "recovery_speed": 0},)" +
                           kGround + "," + bodies(block_at("b", "[0, 0, 0.5]"));
  const double indentation = kGravity / (34.0 * std::pow(2.0 * std::numbers::pi * 5.0, 2));
  EXPECT_NEAR(end_of(play(rigid(soft)), "b").z(), 0.5 - indentation, 1e-3 * indentation);
}
#endif

TEST(ContactRun, AHandleLeadsItsPointAlongTheKeysAndLetsGo) {
  const std::string led = R"("handles": [{"body": "b", "start": 0.2, "duration": 1, "at": {"nearest": [1, 0.5, 0.5]},
      "motion": {"keys": [{"time": 0.5, "position": [1, 0.5, 1]}]}}], "gravity": [0, 0, 0],)";
  const RunResult r = play(exact(led + bodies(block_at("b", "[0, 0, 0]"))));
  ASSERT_EQ(r.handles.size(), 1u);
  EXPECT_EQ(r.handles[0].step, 10);
  EXPECT_LT((r.handles[0].point - Vec3(1.0, 0.5, 0.5)).norm(), 1e-6);
  EXPECT_LT(r.handles[0].largest_error, 1e-9);
  EXPECT_GT(r.handles[0].largest_force, 0.1);
  // At the key the point is where the file says.
  const std::size_t key = 10 + 25;
  EXPECT_LT((track(r, "b").poses[key] * Vec3(1.0, 0.5, 0.5) - Vec3(1.0, 0.5, 1.0)).norm(), 1e-6);
  // Once let go nothing acts: the centre of mass goes straight on.
  const auto& poses = track(r, "b").poses;
  EXPECT_LT((poses[100].p - 2.0 * poses[80].p + poses[60].p).norm(), 1e-9);
}

TEST(ContactRun, AHandleOfOneDirectionLeavesTheOthers) {
  const RunResult r =
      play(rigid(R"("handles": [{"body": "b", "at": {"nearest": [0, 0, 0.5]}, "directions": [[0, 0, 3]]}],)" +
                 bodies(block_at("b", "[0, 0, 0]", R"(, "velocity": [1, 0, 0])"))));
  EXPECT_NEAR(end_of(r, "b").x(), 2.0, 1e-6);
  EXPECT_GT(end_of(r, "b").z(), -1.0);
}

TEST(ContactRun, AHingeKeepsItsPointAndItsMotorTurnsIt) {
  const std::string hinge = R"("gravity": [0, 0, 0], "joints": [{"b": "b", "type": "revolute", "origin": [-1, 0, 0],
      "axis": [0, 0, 2], "coordinates": [{"motor": {"velocity": 0.5, "max_force": 1000}}]}],)";
  const RunResult r = play(exact(hinge + bodies(block_at("b", "[0, 0, 0]"))));
  ASSERT_EQ(r.joints.size(), 1u);
  EXPECT_EQ(r.joints[0].view.coordinates, 1);
  EXPECT_NEAR(r.joints[0].view.position[0], 0.5 * 2.0, 0.02);  // the first step takes up speed
  EXPECT_LT(r.joints[0].largest_distance_error, 1e-9);
  const double turned = r.joints[0].view.position[0];
  EXPECT_NEAR((end_of(r, "b") - Vec3(std::cos(turned) - 1.0, std::sin(turned), 0.0)).norm(), 0.0, 1e-6);
}

TEST(ContactRun, JoinedBodiesMeetOnlyWhereTheFileSaysSo) {
  const auto folded = [](const std::string& collide) {
    // A hinge at a's end; b starts above a and comes down onto it.
    return play(rigid(R"("contact": {}, "joints": [{"a": "a", "b": "b", "type": "revolute", "origin": [-1, 0, 0.55],
        "axis": [0, 1, 0], "collide": )" +
                      collide + R"(}],
        "handles": [{"body": "a", "at": {"nearest": [1, 0.5, -0.5]}}, {"body": "a", "at": {"nearest": [1, -0.5, -0.5]}},
                    {"body": "a", "at": {"nearest": [-1, 0.5, -0.5]}}],)" +
                      bodies(block_at("a", "[0, 0, 0]") + "," + block_at("b", "[0, 0, 1.1]"))));
  };
  EXPECT_GT(end_of(folded("true"), "b").z(), 0.9);
  EXPECT_LT(end_of(folded("false"), "b").z(), 0.9);
}

TEST(ContactRun, TheCsvHasARowForEachContact) {
  const RunResult r = play(rigid(kGround + "," + bodies(block_at(R"(a, \"b\")", "[0, 0, 0.51]")), "10"));
  const std::string csv = contacts_csv(r.trajectory);
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), static_cast<std::ptrdiff_t>(1 + r.trajectory.contacts.size()));
  EXPECT_THAT(csv, ::testing::StartsWith("time_s,phase,a,b,x_m,"));
  EXPECT_THAT(csv, ::testing::HasSubstr(",begun,\"a, \"\"b\"\"\",ground,"));
}

/// A block, 1 m high, falls through a gate of 1 m without contact: its lower face comes in after 2 m, its upper one
/// leaves after 4 m.
TEST(ContactRun, SensorsTellWhoComesAndGoes) {
  constexpr double kStep = 0.002;
  const std::string sensors = R"("sensors": [
    {"name": "gate, low", "shape": {"box": {"half_extents": [2, 2, 0.5]}}, "position": [0, 0, -3], "meets": [1]},
    {"name": "aside", "shape": {"sphere": {"radius": 1}}, "position": [9, 0, -3]}],)";
  const RunResult r =
      play(R"({"step": 0.002, "steps": 500, "assets": {"block": "block.glb"}, )" + sensors +
           bodies(block_at("seen", "[0, 0, 0]", R"(, "layers": [1])") + "," + block_at("unseen", "[0, 0, 0]")) + "}");
  const auto& events = r.trajectory.sensor_events;
  ASSERT_EQ(events.size(), 2u);
  EXPECT_TRUE(events[0].began);
  EXPECT_FALSE(events[1].began);
  const auto fall_time = [](double height) { return std::sqrt(2.0 * height / kGravity); };
  EXPECT_NEAR(events[0].time, fall_time(2.0), kStep);
  EXPECT_NEAR(events[1].time, fall_time(4.0), kStep);
  EXPECT_THAT(sensors_csv(r.trajectory), ::testing::StartsWith("time_s,event,sensor,body\n"));
  EXPECT_THAT(sensors_csv(r.trajectory), ::testing::HasSubstr(",left,\"gate, low\",seen\n"));
}

TEST(ContactRun, FilesOfShapesAreReadOnceAndToldWhereTheyAreWrong) {
  const auto folder = std::filesystem::path(::testing::TempDir()) / "limber_ContactRunFiles";
  std::filesystem::create_directories(folder);
  write_file(folder / "flat.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  const auto models = [&](const std::string& shape) {
    const Scene scene =
        parse_scene(rigid(R"("statics": [{"name": "s", "shape": )" + shape + R"(}, {"name": "t", "shape": )" + shape +
                          "}]," + bodies(block_at("b", "[0, 0, 1]"))),
                    "\"test.json\"", folder);
    EXPECT_EQ(files_of(scene).size(), 2u);  // the asset and the shape
    return make_models(scene, {{"block", block_asset(1)}});
  };
  const SceneModels good = models(R"({"mesh": {"file": "flat.obj"}})");
  EXPECT_EQ(good.shape_of_static[0], good.shape_of_static[1]);
  const auto message = [&](const std::string& shape) -> std::string {
    try {
      models(shape);
    } catch (const InputError& e) {
      return e.what();
    }
    return "accepted";
  };
  EXPECT_THAT(message(R"({"mesh": {"file": "none.obj"}})"), ::testing::HasSubstr("none.obj"));
  EXPECT_THAT(message(R"({"hull": {"file": "flat.obj"}})"), ::testing::HasSubstr("statics[0].shape"));
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace limber
