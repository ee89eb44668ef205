// make_assembly as a user runs it: what it writes is the assembly and its truth, and limber-joints finds that truth.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "assemblies.h"
#include "limber/articulation/joints_file.h"
#include "limber/core/file.h"
#include "limber/mesh/grouped_surface.h"
#include "run_program.h"

namespace limber {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::ProgramResult;

class MakeAssembly : public ::testing::Test {
 protected:
  MakeAssembly() {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::path(::testing::TempDir()) / (std::string("limber_make_assembly_") + test->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~MakeAssembly() override { fs::remove_all(folder_); }

  void run(const std::string& program, const std::vector<std::string>& arguments) const {
    const ProgramResult r = testing::run_program(program, arguments, folder_);
    ASSERT_EQ(r.exit_code, 0) << r.err;
    EXPECT_EQ(r.err, "");
  }
  GroupedSurface surface(const std::string& name) const {
    Warnings warnings;
    GroupedSurface out = read_grouped_surface(folder_ / name, warnings);
    EXPECT_TRUE(warnings.empty()) << warnings.front();
    return out;
  }
  JointsFile joints(const std::string& name) const { return read_joints(folder_ / name); }
  std::set<std::string> files() const {
    std::set<std::string> names;
    for (const auto& entry : fs::recursive_directory_iterator(folder_)) names.insert(entry.path().filename().string());
    return names;
  }

  fs::path folder_;
};

/// The joint of these two parts, whichever of them moves.
const JointRecord* joint_of(const JointsFile& file, const std::string& a, const std::string& b) {
  const auto name = [&](Index i) { return file.components[static_cast<std::size_t>(i)].name; };
  for (const JointRecord& j : file.joints)
    if (std::minmax(name(j.a), name(j.b)) == std::minmax(a, b)) return &j;
  return nullptr;
}

int axis_column(const JointSpec& joint) { return joint.type == JointType::kPlanar ? 2 : 0; }

void expect_same_interval(const Interval& found, Interval expected, bool reversed, double tolerance) {
  if (reversed) expected = {-expected.high, -expected.low};
  for (const auto& [a, b] : {std::pair(found.low, expected.low), {found.high, expected.high}})
    if (std::isfinite(b))
      EXPECT_NEAR(a, b, tolerance);
    else
      EXPECT_EQ(a, b);
}

/// Within half a degree and a thousandth of `size`.
void expect_same_joint(const JointRecord& found, const JointRecord& truth, bool swapped, double size) {
  constexpr double kHalfADegree = 0.5 * std::numbers::pi / 180.0;
  ASSERT_EQ(found.joint.type, truth.joint.type);
  const int column = axis_column(truth.joint);
  const Vec3 axis = truth.joint.frame.axes.col(column), other = found.joint.frame.axes.col(column);
  if (truth.joint.type != JointType::kBall) {
    EXPECT_LT(std::asin(std::min(1.0, axis.cross(other).norm())), kHalfADegree);
  }
  const Vec3 off = found.joint.frame.origin - truth.joint.frame.origin;
  if (truth.joint.type == JointType::kBall) {
    EXPECT_LT(off.norm(), 1e-3 * size);
  }
  EXPECT_NEAR(found.joint.pitch, truth.joint.pitch, 0.02 * std::abs(truth.joint.pitch));
  if (!truth.limits_known) return;
  const bool reversed = (axis.dot(other) < 0.0) != swapped;
  const JointLimits &got = found.joint.limits, &right = truth.joint.limits;
  expect_same_interval(got.rotation, right.rotation, reversed, 2.0 * kHalfADegree);
  expect_same_interval(got.translation[0], right.translation[0], reversed, 1e-3 * size);
  if (std::isfinite(right.cone)) {
    EXPECT_NEAR(got.cone, right.cone, 2.0 * kHalfADegree);
  }
}

TEST_F(MakeAssembly, WhatIsReadFromItsFileHasTheJointsWrittenBesideIt) {
  for (const std::string name : {"gate", "latch", "lamp", "chair", "screw"}) {
    SCOPED_TRACE(name);
    run("make_assembly", {name, "--clearance", "0.005", "--out", name + ".obj"});
    run("limber-joints", {name + ".obj", "--components", "groups", "-o", "found.json"});
    const JointsFile truth = joints(name + ".joints.json"), found = joints("found.json");
    ASSERT_EQ(found.components.size(), truth.components.size());
    EXPECT_EQ(found.joints.size(), truth.joints.size());
    const double size = assemblies::make(name).diagonal;
    for (const JointRecord& joint : truth.joints) {
      const auto part = [&](Index i) { return truth.components[static_cast<std::size_t>(i)].name; };
      SCOPED_TRACE(part(joint.a) + " - " + part(joint.b));
      const JointRecord* same = joint_of(found, part(joint.a), part(joint.b));
      ASSERT_NE(same, nullptr);
      const bool swapped = found.components[static_cast<std::size_t>(same->a)].name != part(joint.a);
      expect_same_joint(*same, joint, swapped, size);
    }
  }
}

TEST_F(MakeAssembly, JointsAndPartsThatItWritesAreKept) {
  run("make_assembly", {"gate", "--out", "gate.obj"});
  run("limber-joints", {"gate.obj", "--keep", "gate.joints.json", "-o", "kept.json"});  // shells become parts
  const JointsFile truth = joints("gate.joints.json"), kept = joints("kept.json");
  ASSERT_EQ(kept.components.size(), 2u);
  const JointRecord* joint = joint_of(kept, "post", "arm");
  ASSERT_NE(joint, nullptr);
  EXPECT_EQ(joint->joint.limits, truth.joints.front().joint.limits);
  EXPECT_EQ(joint->joint.frame.axes, truth.joints.front().joint.frame.axes);
}

TEST_F(MakeAssembly, EveryAssemblyComesWithAJointsFileOfItsOwnParts) {
  run("make_assembly", {"--all", "--segments", "8", "--out", "all"});
  std::size_t known = 0;
  for (const auto& names : {assemblies::tuning_names(), assemblies::held_out_names()})
    for (std::string name : names) {
      SCOPED_TRACE(name);
      const auto made = assemblies::make(name, {.segments = 8});
      std::replace(name.begin(), name.end(), ' ', '_');
      const GroupedSurface read = surface("all/" + name + ".obj");
      EXPECT_EQ(read.surface.vertices, made.surface.surface.vertices);
      EXPECT_EQ(read.surface.triangles, made.surface.surface.triangles);
      const JointsFile truth = joints("all/" + name + ".joints.json");
      ASSERT_EQ(truth.components.size(), read.groups.size());
      for (std::size_t i = 0; i < read.groups.size(); ++i) {
        const SurfaceGroup& group = read.groups[i];
        EXPECT_EQ(truth.components[i].name, group.name);
        EXPECT_EQ(truth.components[i].faces, (std::vector<FaceRange>{{group.first, group.count}}));
      }
      EXPECT_EQ(truth.joints.size(), made.joints.size());
      known += static_cast<std::size_t>(
          std::count_if(truth.joints.begin(), truth.joints.end(), [](const JointRecord& j) { return j.limits_known; }));
    }
  EXPECT_EQ(known, 55u);  // of 67: the lamp's arms, the humanoid's legs, plates that slide, the Cardan joint: not known
}

TEST_F(MakeAssembly, OptionsDrawTheVariantTheyName) {
  const auto bytes = [&](const std::vector<std::string>& options) {
    std::vector<std::string> arguments{"latch", "--out", "x.obj"};
    arguments.insert(arguments.end(), options.begin(), options.end());
    run("make_assembly", arguments);
    return read_file(folder_ / "x.obj");
  };
  bytes({});
  const GroupedSurface plain = surface("x.obj");
  bytes({"--soup", "--swapped", "--scale", "1000"});
  const GroupedSurface soup = surface("x.obj");
  EXPECT_EQ(soup.surface.vertices.size(), 3 * plain.surface.triangles.size());
  EXPECT_EQ(soup.groups.front().name, plain.groups.back().name);
  EXPECT_NEAR(joints("x.joints.json").joints.front().joint.limits.translation[0].low, -20.0, 1e-9);  // 0.025 − 0.045
  const std::string noisy = bytes({"--jitter", "0.001"});
  EXPECT_EQ(bytes({"--jitter", "0.001"}), noisy);
  EXPECT_NE(bytes({"--jitter", "0.001", "--seed", "2"}), noisy);
}

TEST_F(MakeAssembly, BadInputIsOneLineAndNoFile) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> bad{
      {{"lump", "--out", "x.obj"}, "there is no assembly \"lump\""},
      {{"lamp"}, "--out"},
      {{"--out", "x.obj"}, "which assembly"},
      {{"--all", "--out", "x.obj"}, "expected a folder"},
      {{"lamp", "--out", "x.stl"}, "expected FILE.obj or a folder"},
      {{"lamp", "--out", "missing/folder"}, "cannot make the folder"},
      {{"lamp", "--out", "missing/x.obj"}, "missing/x.obj"},
      {{"lamp", "--segments", "12", "--out", "x.obj"}, "a multiple of 8"},
      {{"lamp", "--clearance", "nan", "--out", "x.obj"}, "--clearance"},
      {{"lamp", "--scale", "0", "--out", "x.obj"}, "--scale"}};
  for (const auto& [arguments, holds] : bad) {
    const ProgramResult r = testing::run_program("make_assembly", arguments, folder_);
    EXPECT_NE(r.exit_code, 0) << holds;
    EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << r.err;
    EXPECT_THAT(r.err, HasSubstr(holds));
  }
  // A disk that fills after the OBJ has been written leaves neither file.
  const ProgramResult full =
      testing::run_program("make_assembly", {"humanoid", "--out", "x.obj"}, folder_, rlim_t{100'000});
  EXPECT_EQ(full.exit_code, 1);
  EXPECT_EQ(files(), std::set<std::string>{});
}

}  // namespace
}  // namespace limber
