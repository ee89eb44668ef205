// limber-joints as a user runs it: a lever on a pin, its files, what --keep keeps, and errors in one line.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>

#include "limber/core/file.h"
#include "mesh_files.h"
#include "parts.h"
#include "run_program.h"

namespace limber {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::ProgramResult;

constexpr double kDegree = std::numbers::pi / 180.0;

/// A lever of two shells turns on a pin with heads; a block stops it. Three parts and a lug.
SurfaceMesh lever_on_a_pin() {
  constexpr int kSegments = 48;
  SurfaceMesh all = parts::revolved({0, 0, 0}, Vec3::UnitZ(),
                                    {{0, -2}, {2, -2}, {2, -1}, {1, -1}, {1, 1}, {2, 1}, {2, 2}, {0, 2}}, kSegments);
  shapes::append(parts::tube({0, 0, 0}, Vec3::UnitZ(), 1.01, 2.5, 1.98, kSegments), all);
  shapes::append(shapes::box({4, 7, -1}, {6, 9, 1}), all);
  shapes::append(shapes::box({2.45, -0.5, -0.5}, {10, 0.5, 0.5}), all);
  return all;
}

class JointsProgram : public ::testing::Test {
 protected:
  JointsProgram() {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::path(::testing::TempDir()) / (std::string("limber_joints_") + test->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    testing::write_obj(folder_ / "lever.obj", lever_on_a_pin());
  }
  ~JointsProgram() override { fs::remove_all(folder_); }

  ProgramResult run(const std::vector<std::string>& arguments) const {
    return testing::run_program("limber-joints", arguments, folder_);
  }
  nlohmann::json json(const std::string& name) const { return nlohmann::json::parse(read_file(folder_ / name)); }
  std::set<std::string> files() const {
    std::set<std::string> names;
    for (const auto& entry : fs::recursive_directory_iterator(folder_)) names.insert(entry.path().filename().string());
    return names;
  }
  static void expect_one_line(const ProgramResult& r, int code, const std::string& holds) {
    EXPECT_EQ(r.exit_code, code) << r.err;
    EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << r.err;
    EXPECT_THAT(r.err, ::testing::StartsWith("limber-joints"));
    EXPECT_THAT(r.err, HasSubstr(holds));
  }
  const nlohmann::json* joint_between(const nlohmann::json& file, const std::string& a, const std::string& b) const {
    const auto name = [&](const nlohmann::json& c) {
      return file.at("components").at(c.get<std::size_t>()).at("name");
    };
    for (const auto& j : file.at("joints"))
      if (std::set<std::string>{name(j.at("a")), name(j.at("b"))} == std::set<std::string>{a, b}) return &j;
    return nullptr;
  }

  fs::path folder_;
};

TEST_F(JointsProgram, FindsTheHingeItsAxisAndItsStop) {
  const ProgramResult r =
      run({"lever.obj", "-o", "j.json", "--merge", "part 2,part 4", "--report", "r.json", "--explain"});
  ASSERT_EQ(r.exit_code, 0) << r.err;
  EXPECT_THAT(r.out, HasSubstr("3 components"));
  const auto file = json("j.json");
  const auto* hinge = joint_between(file, "part 1", "part 2");
  ASSERT_NE(hinge, nullptr) << r.out;
  EXPECT_EQ(hinge->at("type"), "revolute");
  EXPECT_NEAR(std::abs(hinge->at("axis").at(2).get<double>()), 1.0, 1e-6);
  EXPECT_EQ(hinge->at("a"), 0);
  // The stop is a part of its own without a joint, which stays.
  const double stop = std::atan2(7, 6) - std::asin(0.5 / std::hypot(7, 6));
  const double sign = hinge->at("axis").at(2).get<double>();
  EXPECT_NEAR(hinge->at("limits").at("rotation").at(sign > 0 ? 1 : 0).get<double>(), sign * stop, 1.0 * kDegree);
  const auto report = json("r.json");
  EXPECT_EQ(report.at("components").size(), 3u);
  EXPECT_EQ(report.at("joints").at(0).at("freedoms").at(0).at("freedom"), "rotation about x");
}

TEST_F(JointsProgram, EqualRunsGiveEqualBytes) {
  ASSERT_EQ(run({"lever.obj", "-o", "1.json", "--glb", "1.glb"}).exit_code, 0);
  ASSERT_EQ(run({"lever.obj", "-o", "2.json", "--glb", "2.glb"}).exit_code, 0);
  EXPECT_EQ(read_file(folder_ / "1.json"), read_file(folder_ / "2.json"));
  EXPECT_EQ(read_file(folder_ / "1.glb"), read_file(folder_ / "2.glb"));
}

TEST_F(JointsProgram, KeepsWhatTheUserWroteOverTheSameFile) {
  ASSERT_EQ(run({"lever.obj", "-o", "j.json", "--merge", "part 2,part 4", "--no-limits"}).exit_code, 0);
  auto file = json("j.json");
  EXPECT_FALSE(file.at("joints").at(0).contains("limits"));
  file["components"][1]["name"] = "lever";
  for (auto& j : file["joints"]) {
    j["type"] = "revolute";
    j["axis"] = {0, 0, 1};
    j["limits"] = {{"rotation", {-0.25, 0.5}}};
  }
  write_file(folder_ / "j.json", file.dump());
  const ProgramResult r = run({"lever.obj", "--keep", "j.json", "-o", "j.json"});
  ASSERT_EQ(r.exit_code, 0) << r.err;
  const auto kept = json("j.json");
  EXPECT_EQ(kept.at("components").size(), 3u);
  const auto* hinge = joint_between(kept, "part 1", "lever");
  ASSERT_NE(hinge, nullptr);
  EXPECT_EQ(hinge->at("type"), "revolute");
  EXPECT_EQ(hinge->at("limits").at("rotation"), (nlohmann::json{-0.25, 0.5}));
}

TEST_F(JointsProgram, WritesRobotsWithTheirMeshesOnce) {
  const ProgramResult r = run({"lever.obj", "--urdf", "l.urdf", "--mjcf", "l.xml", "--unit", "mm"});
  ASSERT_EQ(r.exit_code, 0) << r.err;
  EXPECT_THAT(read_file(folder_ / "l.urdf"), HasSubstr("l_meshes/part_1.stl"));
  EXPECT_THAT(read_file(folder_ / "l.xml"), HasSubstr("meshdir=\"l_meshes\""));
  EXPECT_TRUE(fs::exists(folder_ / "l_meshes" / "part_4.stl"));
}

TEST_F(JointsProgram, WrongUseIsToldInOneLineAndLeavesNothing) {
  const auto before = files();
  expect_one_line(run({"lever.obj"}), 2, "nothing to do");
  expect_one_line(run({"none.obj", "--explain"}), 1, "none.obj");
  expect_one_line(run({"lever.obj", "-o", "j.json", "--merge", "part 1,lid"}), 2, "lid");
  expect_one_line(run({"lever.obj", "-o", "j.json", "--merge", "part 1"}), 2, "--merge");
  expect_one_line(run({"lever.obj", "-o", "lever.obj"}), 2, "lever.obj");
  expect_one_line(run({"lever.obj", "-o", "j.json", "--samples", "3"}), 2, "samples");
  expect_one_line(run({"lever.obj", "-o", "j.json", "--threshold", "2"}), 2, "--threshold: is 2, expected");
  expect_one_line(run({"lever.obj", "-o", "j.json", "--ratio", "0.5"}), 2, "--ratio: is 0.5, expected");
  expect_one_line(run({"lever.obj", "-o", "j.json", "--growth", "1"}), 2, "--growth 1 is more than --search");
  expect_one_line(run({"lever.obj", "-o", "j.json", "--unit", "parsec"}), 2, "parsec");
  write_file(folder_ / "k.json", "{\"components\": [], \"joints\": [{\"a\": 0}]}");
  expect_one_line(run({"lever.obj", "-o", "j.json", "--keep", "k.json"}), 1, "joints[0].a");
  fs::remove(folder_ / "k.json");
  EXPECT_EQ(files(), before);
}

}  // namespace
}  // namespace limber
