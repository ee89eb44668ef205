// limber-precompute on assemblies, as a user runs it: a drawn lamp becomes a machine that moves by its joints.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "asked.h"
#include "limber/core/file.h"
#include "limber/mesh/grouped_surface.h"
#include "limber/model/asset.h"
#include "limber/scene/run.h"
#include "limber/scene/scene_player.h"
#include "run_program.h"

namespace limber {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::ProgramResult;

class AssemblyProgram : public ::testing::Test {
 protected:
  AssemblyProgram() {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::path(::testing::TempDir()) / (std::string("limber_assembly_") + test->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    EXPECT_EQ(testing::run_program("make_assembly", {"lamp", "--out", "lamp.obj"}, folder_).exit_code, 0);
  }
  ~AssemblyProgram() override { fs::remove_all(folder_); }

  ProgramResult precompute(std::vector<std::string> more) const {
    std::vector<std::string> arguments{"lamp.obj",        "--components", "groups", "--modes", "4",
                                       "--damping-ratio", "0.03@50,500",  "-o",     "lamp.glb"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return testing::run_program("limber-precompute", arguments, folder_);
  }
  void bake(const std::vector<std::string>& more) const {
    const ProgramResult result = precompute(more);
    ASSERT_EQ(result.exit_code, 0) << result.err;
  }
  double mass(const std::string& part) const {
    for (const auto& body : read_asset(folder_ / "lamp.glb").bodies)
      if (body->name() == part) return body->data().mass;
    return 0.0;
  }

  fs::path folder_;
};

/// How far a coordinate is beyond what a revolute joint allows.
double beyond(const SceneJoint& joint, const JointView& at) {
  if (joint.spec.type != JointType::kRevolute) return 0.0;
  return std::max(
      {joint.spec.limits.rotation.low - at.position[0], at.position[0] - joint.spec.limits.rotation.high, 0.0});
}

/// From triangles to a machine: flexible parts fall in their joints for ten seconds.
TEST_F(AssemblyProgram, ALampSwingsByTheJointsFoundInIt) {
  bake({"--auto-joints", "--material", "nylon", "--scene", "lamp.json"});
  Scene scene = read_scene(folder_ / "lamp.json");
  scene.contacts.solver = ContactSolver::kExact;
  const SceneModels models = load_models(scene);
  ASSERT_EQ(scene.bodies.size(), 5u);
  ASSERT_EQ(scene.joints.size(), 5u) << "three hinges, a ball, and the base on the ground";
  for (const auto& model : models.of_body) EXPECT_GE(model->modes(), 4);
  ScenePlayer player(scene, models, scene.steps);
  const World& world = player.world();
  const auto energy = [&] {
    double sum = 0.0;
    for (const BodyId body : player.bodies()) sum += world.energy(body).total();
    return sum;
  };
  const double start = energy();
  double drift = 0.0, passed = 0.0, highest = start, swing = 0.0;
  for (int step = 0; step < 600; ++step) {
    player.step();
    ASSERT_TRUE(world.constraint_report().solved) << "step " << step;
    highest = std::max(highest, energy());
    for (std::size_t j = 0; j < scene.joints.size(); ++j) {
      const JointView at = world.joint(player.joints()[j]);
      drift = std::max(drift, at.distance_error);
      passed = std::max(passed, beyond(scene.joints[j], at));
      if (at.coordinates == 1) swing = std::max(swing, std::abs(at.position[0]));
    }
  }
  constexpr double kSize = 0.5;  // m, of the lamp, about
  EXPECT_LT(drift, 1e-9 * kSize);
  EXPECT_LT(passed, 1e-9);
  EXPECT_LE(highest, start + 1e-9 * std::abs(start));
  EXPECT_GT(swing, 0.3) << "it moves";
}

struct Machine {
  const char* name;
  double size;  // m, about
  std::vector<std::string> ground;
};

class BakedMachine : public ::testing::TestWithParam<Machine> {};

double total_energy(const Trajectory& trajectory, std::size_t key) {
  double sum = 0.0;
  for (const BodyTrack& body : trajectory.bodies) sum += body.energies[key].total();
  return sum;
}

/// Open and closed chains of bending parts, by the joints and limits found in their triangles.
TEST_P(BakedMachine, HoldsTogetherWithinItsLimitsAndGainsNoEnergy) {
  const Machine& machine = GetParam();
  const fs::path folder = fs::path(::testing::TempDir()) / (std::string("limber_machine_") + machine.name);
  fs::remove_all(folder);
  fs::create_directories(folder);
  ASSERT_EQ(testing::run_program("make_assembly", {machine.name, "--out", "m.obj"}, folder).exit_code, 0);
  std::vector<std::string> arguments{
      "m.obj", "--auto-joints", "--components", "groups",          "--material", "nylon", "-o", "m.glb", "--modes",
      "3",     "--scene",       "m.json",       "--damping-ratio", "0.03@50,500"};
  for (const std::string& name : machine.ground) arguments.insert(arguments.end(), {"--ground", name});
  const ProgramResult baked = testing::run_program("limber-precompute", arguments, folder);
  ASSERT_EQ(baked.exit_code, 0) << baked.err;
  EXPECT_THAT(baked.err, ::testing::Not(HasSubstr("hangs on nothing")));
  Scene scene = read_scene(folder / "m.json");
  scene.contacts.solver = ContactSolver::kExact;
  const RunResult result = run_scene(scene, load_models(scene), {.steps = 120, .key_rate = 60.0});
  fs::remove_all(folder);

  EXPECT_EQ(result.constraints.limit_steps + result.constraints.failed_steps, 0);
  double moved = 0.0;
  for (const JointReport& joint : result.joints) {
    EXPECT_LT(joint.largest_distance_error, 1e-6 * machine.size) << joint.a << " to " << joint.b;
    EXPECT_LT(joint.largest_angle_error, 1e-6) << joint.a << " to " << joint.b;
    EXPECT_LT(joint.largest_limit_excess, 1e-6) << joint.a << " to " << joint.b;
    for (const double q : joint.view.position) moved = std::max(moved, std::abs(q));
  }
  EXPECT_GT(moved, 0.02) << "rad or m: it moves";
  const Trajectory& t = result.trajectory;
  const double start = total_energy(t, 0);
  for (std::size_t key = 0; key < t.times.size(); ++key)
    EXPECT_LE(total_energy(t, key), start * (1.0 + 1e-9)) << t.times[key] << " s";
}

INSTANTIATE_TEST_SUITE_P(Assemblies, BakedMachine,
                         ::testing::ValuesIn(testing::all_or_first<Machine>({{"brush arm", 0.7, {"base", "board"}},
                                                                             {"piston", 0.3, {}},
                                                                             {"humanoid", 1.7, {}},
                                                                             {"four-bar", 0.2, {}}})));

TEST_F(AssemblyProgram, TheTrueJointsOfAFileAreTaken) {
  bake({"--joints", "lamp.joints.json", "--material", "nylon", "--rigid", "*"});
  const auto told = nlohmann::json::parse(read_file(folder_ / "lamp.joints.json"));
  const Asset made = read_asset(folder_ / "lamp.glb");
  ASSERT_EQ(made.joints.size(), told.at("joints").size() + 1) << "and the ground's";
  for (std::size_t i = 0; i < told.at("joints").size(); ++i) {
    const auto& a = told["joints"][i];
    const AssetJoint& b = made.joints[i];
    EXPECT_EQ(a.at("type"), to_string(b.spec.type));
    for (int k = 0; k < 3; ++k) EXPECT_EQ(a.at("origin")[static_cast<std::size_t>(k)], b.spec.frame.origin[k]);
    EXPECT_EQ(told["components"][a["a"].get<std::size_t>()]["name"],
              made.bodies[static_cast<std::size_t>(b.a)]->name());
    EXPECT_EQ(told["components"][a["b"].get<std::size_t>()]["name"],
              made.bodies[static_cast<std::size_t>(b.b)]->name());
  }
  EXPECT_EQ(made.joints.back().a, AssetJoint::kWorld);
  for (const auto& body : made.bodies) EXPECT_EQ(body->modes(), 0) << body->name();
}

/// Six modes more for each joint, but not for those that are found in others' span.
TEST_F(AssemblyProgram, PartsAnswerWhatTheirJointsDoByFurtherModes) {
  bake({"--joints", "lamp.joints.json", "--material", "nylon"});
  const Asset asset = read_asset(folder_ / "lamp.glb");
  for (std::size_t i = 0; i < asset.bodies.size(); ++i) {
    const auto joints = std::ranges::count_if(asset.joints, [&](const AssetJoint& joint) {
      return joint.a != AssetJoint::kWorld && (joint.a == static_cast<Index>(i) || joint.b == static_cast<Index>(i));
    });
    EXPECT_EQ(asset.bodies[i]->modes(), 4 + 6 * joints) << asset.bodies[i]->name();
  }
  bake({"--joints", "lamp.joints.json", "--material", "nylon", "--no-joint-modes"});
  for (const auto& body : read_asset(folder_ / "lamp.glb").bodies) EXPECT_EQ(body->modes(), 4) << body->name();
}

/// One machine of steel and rubber, by its asset alone.
TEST_F(AssemblyProgram, SteelAndRubberMoveInOneMachine) {
  write_file(folder_ / "m.json", R"({"shade": "rubber", "*": "steel"})");
  bake({"--auto-joints", "--materials", "m.json", "--scene", "lamp.json"});
  Scene scene = read_scene(folder_ / "lamp.json");
  scene.contacts.solver = ContactSolver::kExact;
  const RunResult result = run_scene(scene, load_models(scene), {.steps = 120, .key_rate = 60.0});
  for (const JointReport& joint : result.joints) {
    EXPECT_LT(joint.largest_distance_error, 1e-9) << joint.a << joint.b;
    EXPECT_LT(joint.largest_limit_excess, 1e-9) << joint.a << joint.b;
  }
  double bend = 0.0;  // of the rubber shade
  const Trajectory& t = result.trajectory;
  for (const BodyTrack& body : t.bodies)
    if (body.name == "lamp/shade")
      for (const BodyEnergy& energy : body.energies) bend = std::max(bend, energy.elastic);
  EXPECT_GT(bend, 1e-6) << "J";
}

TEST_F(AssemblyProgram, MaterialsAreNamedByComponentsAndScaleIsOfLengths) {
  bake({"--joints", "lamp.joints.json", "--material", "nylon", "--rigid", "*"});
  const double shade = mass("shade"), base = mass("base");
  write_file(folder_ / "m.json", R"({"shade": "steel", "*": "nylon"})");
  bake({"--joints", "lamp.joints.json", "--materials", "m.json", "--rigid", "*", "--scale", "2", "--scene",
        "lamp.json"});
  constexpr double kSteel = 7850.0, kNylon = 1140.0;  // kg/m³, of the presets
  constexpr double kRounding = 1e-6;                  // cells are placed by the same steps at twice the size
  EXPECT_NEAR(mass("base"), 8.0 * base, kRounding * 8.0 * base);
  EXPECT_NEAR(mass("shade"), 8.0 * shade * kSteel / kNylon, 0.01 * 8.0 * shade * kSteel / kNylon);
  const auto told = nlohmann::json::parse(read_file(folder_ / "lamp.joints.json"));
  const Asset made = read_asset(folder_ / "lamp.glb");
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_DOUBLE_EQ(made.joints[0].spec.frame.origin[static_cast<Index>(i)],
                     2.0 * told["joints"][0]["origin"][i].get<double>());
}

/// The lamp's groups are its five parts, drawn in more shells; rigid ones are as their surfaces bound them.
TEST_F(AssemblyProgram, TheFirstCommandTakesTheFilesGroupsAndMeshesNoRigidPart) {
  const ProgramResult r = testing::run_program(
      "limber-precompute",
      {"lamp.obj", "--auto-joints", "--material", "nylon", "--rigid", "*", "-o", "lamp.glb", "--report", "r.json"},
      folder_);
  ASSERT_EQ(r.exit_code, 0) << r.err;
  EXPECT_THAT(r.err, ::testing::Not(HasSubstr("falls")));
  const Asset lamp = read_asset(folder_ / "lamp.glb");
  EXPECT_EQ(lamp.bodies.size(), 5u);
  EXPECT_EQ(lamp.joints.size(), 5u) << "and the ground's";
  const auto report = nlohmann::json::parse(read_file(folder_ / "r.json"));
  EXPECT_EQ(report["tets"], 0);
  EXPECT_EQ(report["frequencies_hz"].size(), 0u);
  Warnings warnings;
  const GroupedSurface drawn = read_grouped_surface(folder_ / "lamp.obj", warnings);
  double volume = 0.0;
  for (const SurfaceGroup& group : drawn.groups)
    if (group.name == "base") {
      const auto first = drawn.surface.triangles.begin() + group.first;
      volume += enclosed_volume({drawn.surface.vertices, {first, first + group.count}});
    }
  EXPECT_NEAR(mass("base"), 1140.0 * volume, 1e-9 * mass("base")) << "kg, of nylon";
}

// Two blocks that share an edge enclose what they do; a box without a lid is wrapped, and tells no frequencies.
TEST_F(AssemblyProgram, RigidPartsOfShellsThatTouchAreNotMeshedAndOpenOnesTellNoFrequencies) {
  using Face = std::array<int, 4>;
  const auto vertices = [](double x, double z) {
    std::string text;
    for (int i = 0; i < 8; ++i)
      text += "v " + std::to_string(x + (i & 1)) + " " + std::to_string((i >> 1) & 1) + " " +
              std::to_string(z + ((i >> 2) & 1)) + "\n";
    return text;
  };
  const auto faces = [](const std::array<int, 8>& number, bool lid) {
    std::vector<Face> all{{0, 2, 3, 1}, {0, 1, 5, 4}, {1, 3, 7, 5}, {3, 2, 6, 7}, {2, 0, 4, 6}};
    if (lid) all.push_back({4, 5, 7, 6});
    std::string text;
    for (const Face& face : all) {
      text += "f";
      for (const int corner : face) text += " " + std::to_string(number[static_cast<std::size_t>(corner)]);
      text += "\n";
    }
    return text;
  };
  write_file(folder_ / "m.obj", vertices(0, 0) + vertices(1, 1) + vertices(5, 0) + "g pair\n" +
                                    faces({1, 2, 3, 4, 5, 6, 7, 8}, true) +
                                    faces({6, 10, 8, 12, 13, 14, 15, 16}, true) + "g pot\n" +
                                    faces({17, 18, 19, 20, 21, 22, 23, 24}, false));
  const ProgramResult r = testing::run_program(
      "limber-precompute", {"m.obj", "--auto-joints", "--material", "nylon", "--rigid", "*", "-o", "lamp.glb"},
      folder_);
  ASSERT_EQ(r.exit_code, 0) << r.err;
  EXPECT_THAT(r.err, HasSubstr("wrapped, since it has 4 boundary edges"));
  EXPECT_EQ(r.err.find("wrapped"), r.err.rfind("has been wrapped") + 9) << "once: " << r.err;
  EXPECT_THAT(r.err, ::testing::Not(HasSubstr("frequencies are too high")));
  EXPECT_NEAR(mass("pair"), 2.0 * 1140.0, 1e-9 * 1140.0) << "kg, of nylon";
}

TEST_F(AssemblyProgram, TrianglesWithTwoCornersAtOnePlaceAreDroppedWithAWarning) {
  const std::string lamp = read_file(folder_ / "lamp.obj");
  const std::size_t first = lamp.starts_with("v ") ? 0 : lamp.find("\nv ") + 1, end = lamp.find('\n', first);
  // A vertex at the first one's place, the last of the file, in a triangle of the last part.
  write_file(folder_ / "lamp.obj", lamp + lamp.substr(first, end - first) + "\nf 1 -1 2\n");
  const ProgramResult r = testing::run_program("limber-precompute",
                                               {"lamp.obj", "--auto-joints", "--components", "connectivity",
                                                "--material", "nylon", "--rigid", "*", "-o", "lamp.glb"},
                                               folder_);
  ASSERT_EQ(r.exit_code, 0) << r.err;
  EXPECT_THAT(r.err, HasSubstr("1 triangles have two corners at one place"));
}

TEST_F(AssemblyProgram, LinearElementsThatAreTooStiffAreToldWithTheError) {
  write_file(folder_ / "bar.obj",
             "v 0 0 0\nv .3 0 0\nv .3 .04 0\nv 0 .04 0\nv 0 0 .01\nv .3 0 .01\nv .3 .04 .01\nv 0 .04 .01\n"
             "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n");
  const auto warnings = [&](const std::string& elements) {
    const ProgramResult r = testing::run_program(
        "limber-precompute",
        {"bar.obj", "--material", "steel", "--modes", "3", "--elements", elements, "-o", "bar.glb"}, folder_);
    EXPECT_EQ(r.exit_code, 0) << r.err;
    return r.err;
  };
  EXPECT_THAT(warnings("linear"), HasSubstr("\"bar\" by 3"));  // 34 %, of a frequency that is 77 % too high
  EXPECT_EQ(warnings("quadratic"), "");
}

/// A carriage in a rail without stops, and a wheel on an axle that nothing holds.
TEST_F(AssemblyProgram, OpenSlidesAndPartsThatHangOnNothingAreToldInALineEach) {
  ASSERT_EQ(testing::run_program("make_assembly", {"dovetail", "--out", "m.obj"}, folder_).exit_code, 0);
  const ProgramResult r = testing::run_program(
      "limber-precompute", {"m.obj", "--auto-joints", "--material", "nylon", "--rigid", "*", "-o", "m.glb"}, folder_);
  ASSERT_EQ(r.exit_code, 0) << r.err;
  EXPECT_THAT(r.err, HasSubstr("nothing stops \"carriage\" on \"rail\""));
  EXPECT_THAT(r.err, HasSubstr("components \"axle\" and \"wheel\" hang on nothing"));
  EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 2) << r.err;
}

TEST_F(AssemblyProgram, WhatIsWrongIsOneLineAndNothingIsWritten) {
  const auto refused = [&](const std::vector<std::string>& arguments, int code, const std::string& holds) {
    const ProgramResult r = precompute(arguments);
    EXPECT_EQ(r.exit_code, code) << r.err;
    EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << r.err;
    EXPECT_THAT(r.err, HasSubstr(holds));
    EXPECT_FALSE(fs::exists(folder_ / "lamp.glb"));
  };
  refused({"--auto-joints", "--joints", "lamp.joints.json", "--material", "nylon"}, 2, "twice");
  refused({"--scene", "lamp.json", "--material", "nylon"}, 2, "--auto-joints");
  refused({"--joints", "none.json", "--material", "nylon"}, 1, "none.json");
  write_file(folder_ / "m.json", R"({"wing": "steel", "*": "nylon"})");
  refused({"--joints", "lamp.joints.json", "--materials", "m.json"}, 1, "no component \"wing\"");
  refused({"--joints", "lamp.joints.json", "--material", "nylon", "--rigid", "wing"}, 2, "wing");
  refused({"--joints", "lamp.joints.json", "--material", "nylon", "--ground", "base", "--ground", "wing"}, 2, "wing");
}

}  // namespace
}  // namespace limber
