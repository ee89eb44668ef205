// limber-pose as a user runs it: the files of a drag, and errors in one line that leave nothing behind.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "assemblies.h"
#include "limber/core/file.h"
#include "mesh_files.h"
#include "run_program.h"
#include "true_joints.h"

namespace limber {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::ProgramResult;
using Json = nlohmann::json;

class PoseProgram : public ::testing::Test {
 protected:
  PoseProgram() {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::path(::testing::TempDir()) / (std::string("limber_pose_") + test->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    const auto made = assemblies::make("door", {.segments = 8});
    surface_ = made.surface.surface;
    testing::write_obj(folder_ / "door.obj", surface_);
    write_file(folder_ / "door.json", joints_text(assemblies::true_joints(made)));
    const auto& leaf = made.surface.groups.back();
    grip_ = surface_.vertices[static_cast<std::size_t>(surface_.triangles[static_cast<std::size_t>(leaf.first)][0])];
    part_ = leaf.name;
    handles_ = {
        {"pinned", {made.surface.groups.front().name}},
        {"handles", {{"hand", {{"part", part_}, {"point", list(grip_)}}}}},
        {"frames", {{{"targets", Json::object()}}, {{"targets", {{"hand", list(grip_ + Vec3(0.1, 0.1, 0.0))}}}}}}};
  }
  ~PoseProgram() override { fs::remove_all(folder_); }

  static Json list(const Vec3& p) { return {p.x(), p.y(), p.z()}; }
  ProgramResult run(const Json& handles, std::vector<std::string> more = {"-o", "drag.glb"}) const {
    write_file(folder_ / "handles.json", handles.dump());
    std::vector<std::string> arguments{"door.obj", "--joints", "door.json", "--handles", "handles.json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return testing::run_program("limber-pose", arguments, folder_);
  }
  void expect_refused(const Json& handles, int code, const std::string& holds) const {
    const ProgramResult r = run(handles);
    EXPECT_EQ(r.exit_code, code) << r.err;
    EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << r.err;
    EXPECT_THAT(r.err, HasSubstr(holds));
    EXPECT_FALSE(fs::exists(folder_ / "drag.glb"));
  }

  fs::path folder_;
  SurfaceMesh surface_;
  Vec3 grip_;
  std::string part_;
  Json handles_;
};

TEST_F(PoseProgram, WritesEachFrame) {
  const ProgramResult r = run(handles_, {"-o", "drag.glb", "--obj", "drag", "--report", "r.json"});
  ASSERT_EQ(r.exit_code, 0) << r.err;
  EXPECT_THAT(r.out, HasSubstr("2 frames, 2 converged"));
  Warnings warnings;
  const SurfaceMesh first = read_surface_mesh(folder_ / "drag_0000.obj", warnings),
                    second = read_surface_mesh(folder_ / "drag_0001.obj", warnings);
  ASSERT_EQ(first.vertices.size(), surface_.vertices.size());
  double still = 0.0, moved = 0.0;
  for (std::size_t v = 0; v < surface_.vertices.size(); ++v) {
    still = std::max(still, (first.vertices[v] - surface_.vertices[v]).norm());
    moved = std::max(moved, (second.vertices[v] - surface_.vertices[v]).norm());
  }
  EXPECT_LT(still, 1e-12);
  EXPECT_GT(moved, 0.01);
  const Json report = Json::parse(read_file(folder_ / "r.json"));
  ASSERT_EQ(report.at("frames").size(), 2u);
  EXPECT_LT(report.at("frames").at(1).at("joint_error").get<double>(), 1e-9);
  EXPECT_EQ(read_file(folder_ / "drag.glb").substr(0, 4), "glTF");
}

TEST_F(PoseProgram, TheLastPoseIsAModelThatCanBePosedAgain) {
  ASSERT_EQ(run(handles_, {"--rest", "open"}).exit_code, 0);
  Json still = handles_;
  still["handles"]["hand"]["point"] = list(grip_ + Vec3(0.1, 0.1, 0.0));
  still["frames"] = {{{"targets", Json::object()}}};
  write_file(folder_ / "handles.json", still.dump());
  const ProgramResult r = testing::run_program(
      "limber-pose",
      {"open.obj", "--joints", "open.joints.json", "--handles", "handles.json", "--obj", "again", "--report", "r.json"},
      folder_);
  ASSERT_EQ(r.exit_code, 0) << r.err;
  Warnings warnings;
  const SurfaceMesh open = read_surface_mesh(folder_ / "open.obj", warnings),
                    again = read_surface_mesh(folder_ / "again_0000.obj", warnings);
  ASSERT_EQ(open.vertices.size(), again.vertices.size());
  double apart = 0.0;
  for (std::size_t v = 0; v < open.vertices.size(); ++v)
    apart = std::max(apart, (open.vertices[v] - again.vertices[v]).norm());
  EXPECT_LT(apart, 1e-12);
}

TEST_F(PoseProgram, EqualRunsGiveEqualBytes) {
  ASSERT_EQ(run(handles_, {"-o", "1.glb"}).exit_code, 0);
  ASSERT_EQ(run(handles_, {"-o", "2.glb"}).exit_code, 0);
  EXPECT_EQ(read_file(folder_ / "1.glb"), read_file(folder_ / "2.glb"));
}

TEST_F(PoseProgram, ThePenaltyFormPosesTheSameDrag) {
  EXPECT_EQ(run(handles_, {"-o", "drag.glb", "--penalty"}).exit_code, 0);
}

TEST_F(PoseProgram, AClipNeedsAMappingAndTakesThePlaceOfHandles) {
  for (const std::vector<std::string>& more : {std::vector<std::string>{"-o", "drag.glb", "--clip", "a.bvh"},
                                               {"-o", "drag.glb", "--mapping", "a.json"},
                                               {"-o", "drag.glb", "--clip", "a.bvh", "--mapping", "a.json"}}) {
    const ProgramResult r = run(handles_, more);
    EXPECT_NE(r.exit_code, 0);
    EXPECT_THAT(r.err, HasSubstr("either --handles or both --clip and --mapping"));
    EXPECT_FALSE(fs::exists(folder_ / "drag.glb"));
  }
}

TEST_F(PoseProgram, WrongFilesAreToldInOneLineAndLeaveNothing) {
  Json wrong = handles_;
  wrong["handles"]["hand"]["part"] = "leaves";
  expect_refused(wrong, 1, "handles.hand: there is no part \"leaves\"");
  wrong = handles_;
  wrong["handles"]["hand"]["point"] = {9, 9, 9};
  expect_refused(wrong, 1, "from the surface of");
  wrong = handles_;
  wrong["frames"][1]["targets"] = {{"hands", {0, 0, 0}}};
  expect_refused(wrong, 1, "there is no handle \"hands\"; the nearest is \"hand\"");
  wrong = handles_;
  wrong["frames"][1]["targets"]["hand"] = {0, nullptr, 0};
  expect_refused(wrong, 1, "expected three finite numbers");
  wrong = handles_;
  wrong["frames"][1]["time"] = 0.0;
  expect_refused(wrong, 1, "frames[1].time");
  wrong = handles_;
  wrong["pinned"] = {"wall"};
  expect_refused(wrong, 1, "there is no part \"wall\"");
  wrong = handles_;
  wrong["frames"] = Json::array();
  expect_refused(wrong, 1, "at least one frame");
  wrong = handles_;
  wrong["parts"] = {{part_, {{"cells", "voxels"}}}};
  expect_refused(wrong, 1, "\"rigid\", \"uniform\" or \"octree\"");

  Json joints = Json::parse(read_file(folder_ / "door.json"));
  joints["components"].back()["faces"][0][1] = 100000;
  write_file(folder_ / "door.json", joints.dump());
  expect_refused(handles_, 1, "is it another model's file?");
}

TEST_F(PoseProgram, SaysWhatIsMissing) {
  EXPECT_EQ(run(handles_, {}).exit_code, 2);
  EXPECT_THAT(run(handles_, {}).err, HasSubstr("nothing to do"));
}

}  // namespace
}  // namespace limber
