// What the page of a posed model drives, without a page.
#include "limber/view/page_pose.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "limber/core/error.h"
#include "limber/core/file.h"

namespace limber {
namespace {

/// Two bars end to end along x, each 1 × 0.2 × 0.2, the second hinged to the first about y at x = 1.
std::string bars() {
  std::string text;
  int first = 1;
  for (const double x : {0.0, 1.02}) {
    for (int i = 0; i < 8; ++i)
      text += "v " + std::to_string(x + (i & 1)) + " " + std::to_string(0.2 * ((i >> 1) & 1)) + " " +
              std::to_string(0.2 * (i >> 2)) + "\n";
    for (const auto& [a, b, c, d] : std::vector<std::array<int, 4>>{
             {0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}})
      text += "f " + std::to_string(first + a) + " " + std::to_string(first + b) + " " + std::to_string(first + c) +
              " " + std::to_string(first + d) + "\n";
    first += 8;
  }
  return text;
}

constexpr const char* kJoints =
    R"({"components": [{"name": "base", "faces": [[0, 6]]}, {"name": "arm", "faces": [[6, 6]]}],
  "joints": [{"a": 0, "b": 1, "type": "revolute", "origin": [1.01, 0.1, 0.1], "axis": [0, 1, 0],
              "limits": {"rotation": [-1, 1]}}]})";

class PagePoseTest : public ::testing::Test {
 protected:
  PagePoseTest() {
    std::filesystem::create_directories(folder_);
    write_file(folder_ / "bars.obj", bars());
    write_file(folder_ / "bars.json", kJoints);
  }
  ~PagePoseTest() override { std::filesystem::remove_all(folder_); }
  PagePose page() const { return PagePose(folder_ / "bars.obj", folder_ / "bars.json"); }

  const std::filesystem::path folder_ =
      std::filesystem::path(::testing::TempDir()) / ::testing::UnitTest::GetInstance()->current_test_info()->name();
};

PoseResult settle(PagePose& page) {
  PoseResult result = page.solve();
  for (int i = 0; i < 50 && result.status == PoseResult::Status::kIterationLimit; ++i) result = page.solve();
  return result;
}
double turn(PagePose& page) { return page.joint_frames()[6]; }
nlohmann::json told(const PagePose& page) { return nlohmann::json::parse(page.description()); }
/// The tip of the arm, from above.
PoseHit tip(const PagePose& page) { return page.cast_ray({1.97, 0.1, 5.0}, {0, 0, -1}); }

TEST_F(PagePoseTest, PullingTurnsThePartWithinItsLimits) {
  PagePose pose = page();
  const PoseHit hit = tip(pose);
  ASSERT_EQ(hit.part, 1);
  EXPECT_NEAR(hit.point.z(), 0.2, 1e-12);
  ASSERT_TRUE(pose.grab(hit));
  pose.drag_to({1.9, 0.1, 0.7});
  const PoseResult found = settle(pose);
  EXPECT_LT(found.joint_error, 1e-9);
  EXPECT_LT(turn(pose), -0.3) << "up is against the axis";
  pose.drag_to({0.8, 0.1, 3.0});
  settle(pose);
  EXPECT_NEAR(turn(pose), -1.0, 1e-6) << "its limit";
  for (int i = 0; i < 24; ++i)
    EXPECT_NEAR(pose.positions()[static_cast<std::size_t>(i)],
                pose.session().model().surface.vertices[static_cast<std::size_t>(i / 3)][i % 3], 1e-6)
        << "the base is pinned";
}

TEST_F(PagePoseTest, HandlesStayAreTakenAgainAndUndone) {
  PagePose pose = page();
  pose.grab(tip(pose));
  pose.drag_to({1.9, 0.1, 0.7});
  settle(pose);
  pose.let_go();
  ASSERT_EQ(pose.handles().size(), 6u);
  pose.take(0);
  pose.drag_to({1.9, 0.1, -0.3});
  settle(pose);
  EXPECT_GT(turn(pose), 0.2);
  EXPECT_EQ(pose.handles().size(), 6u);
  EXPECT_NEAR(pose.handles()[5], -0.3, 1e-12);
  while (pose.undo()) {
  }
  EXPECT_EQ(pose.handles().size(), 0u);
  EXPECT_NEAR(turn(pose), 0.0, 1e-12);
  EXPECT_THROW(pose.take(0), InvalidArgument);
}

TEST_F(PagePoseTest, JointsBecomeOthersAboutTheSameAxis) {
  PagePose pose = page();
  pose.set_joint(0, R"({"type": "planar", "limits": null})");
  EXPECT_EQ(told(pose)["joints"][0]["type"], "planar");
  EXPECT_NEAR(pose.session().model().joints[0].joint.frame.axes.col(2).y(), 1.0, 1e-12) << "its normal was the axis";
  EXPECT_NEAR(pose.session().model().joints[0].joint.frame.axes.determinant(), 1.0, 1e-12);
  pose.set_joint(0, R"({"type": "prismatic", "limits": {"translation": [0, 0.5]}})");
  pose.grab(tip(pose));
  pose.drag_to({1.97, 3.0, 0.2});
  settle(pose);
  EXPECT_NEAR(turn(pose), 0.5, 1e-6) << "slides along it, to its stop";
  EXPECT_TRUE(pose.undo());
  EXPECT_THROW(pose.set_joint(0, R"({"type": "hinge", "limits": null})"), InputError);
  EXPECT_THROW(pose.set_joint(0, R"({"type": "revolute", "limits": {"cone": 1}})"), InputError);
  EXPECT_THROW(pose.set_joint(3, R"({"type": "fixed", "limits": null})"), InvalidArgument);
}

TEST_F(PagePoseTest, ASoftPartBendsAndItsJointHolds) {
  PagePose pose = page();
  pose.set_joint(0, R"({"type": "fixed", "limits": null})");
  pose.set_soft(1, true);
  EXPECT_TRUE(told(pose)["parts"][1]["soft"]);
  pose.grab(tip(pose));
  pose.drag_to({1.9, 0.1, 0.6});
  const PoseResult found = settle(pose);
  EXPECT_LT(found.joint_error, 1e-9);
  EXPECT_GT(pose.handles()[2], 0.4) << "its tip has gone up";
}

/// From above, across the arm at x, from beside to `end`.
PoseStroke across_arm(double x, double end = 0.5) {
  const Vec3 eye(x, 0.1, 5.0);
  return {eye, Vec3(x, -0.3, 0.2) - eye, Vec3(x, end, 0.2) - eye};
}
double area(const SurfaceMesh& surface) {
  double sum = 0.0;
  for (const Triangle& t : surface.triangles) {
    const auto at = [&](std::size_t k) { return surface.vertices[static_cast<std::size_t>(t[k])]; };
    sum += 0.5 * (at(1) - at(0)).cross(at(2) - at(0)).norm();
  }
  return sum;
}

TEST_F(PagePoseTest, ACutMakesAPartOfItsOwnOnABall) {
  PagePose pose = page();
  EXPECT_FALSE(pose.undo()) << "nothing was done yet";
  const double whole = area(pose.session().model().surface);
  const std::string before = pose.description();
  pose.cut(1, across_arm(1.6));
  ASSERT_EQ(told(pose)["parts"].size(), 3u);
  ASSERT_EQ(told(pose)["joints"].size(), 2u);
  EXPECT_EQ(told(pose)["joints"][1]["type"], "ball");
  const JointedModel& model = pose.session().model();
  EXPECT_NEAR(area(model.surface), whole, 1e-12);
  std::set<std::pair<Index, Index>> edges;
  for (const Triangle& t : model.surface.triangles)
    for (std::size_t k = 0; k < 3; ++k) edges.emplace(t[k], t[(k + 1) % 3]);
  EXPECT_EQ(edges.size(), 3 * model.surface.triangles.size());
  for (const auto& [a, b] : edges) EXPECT_TRUE(edges.contains({b, a})) << "closed, " << a << ' ' << b;
  EXPECT_LT((model.joints[1].joint.frame.origin - Vec3(1.6, 0.1, 0.1)).norm(), 1e-9);
  for (std::size_t p = 1; p < 3; ++p)  // one on each side of the cut
    for (const Index t : model.parts[p].triangles)
      for (const Index v : model.surface.triangles[static_cast<std::size_t>(t)])
        EXPECT_GE((p == 1 ? -1.0 : 1.0) * (model.surface.vertices[static_cast<std::size_t>(v)].x() - 1.6), -1e-9);
  EXPECT_EQ(model.joints[0].b, 1) << "the hinge stays with what is beside it";

  ASSERT_TRUE(pose.grab(tip(pose)));
  pose.drag_to({1.6, 0.5, 0.2});
  const PoseResult found = settle(pose);
  EXPECT_LT(found.joint_error, 1e-6);
  EXPECT_LT(found.handle_error, 0.1);
  while (told(pose)["parts"].size() == 3) ASSERT_TRUE(pose.undo());
  EXPECT_EQ(pose.description(), before);
  EXPECT_FALSE(pose.undo());
}

TEST_F(PagePoseTest, ACutKeepsThePoseItsHandlesAndPins) {
  PagePose pose = page();
  pose.grab(tip(pose));
  pose.drag_to({1.9, 0.1, 0.5});
  settle(pose);
  const std::vector<float> before(pose.positions().begin(), pose.positions().end());
  const double turned = turn(pose);
  pose.cut(1, across_arm(1.6));
  ASSERT_GE(pose.positions().size(), before.size());
  for (std::size_t i = 0; i < before.size(); ++i) EXPECT_NEAR(pose.positions()[i], before[i], 1e-6);
  EXPECT_NEAR(turn(pose), turned, 1e-12);
  ASSERT_EQ(pose.handles().size(), 6u);
  EXPECT_NEAR(pose.handles()[2], pose.handles()[5], 0.02) << "the point is still near its target";
  pose.take(0);
  pose.drag_to({1.9, 0.1, 0.3});
  settle(pose);
  EXPECT_TRUE(told(pose)["parts"][0]["pinned"]);
  EXPECT_TRUE(pose.undo() && pose.undo());
  ASSERT_EQ(pose.positions().size(), before.size());
  for (std::size_t i = 0; i < before.size(); ++i) EXPECT_NEAR(pose.positions()[i], before[i], 1e-6);
}

TEST_F(PagePoseTest, ShellsGoToTheSideWhereTheyLie) {
  write_file(folder_ / "all.json", R"({"components": [{"name": "all", "faces": [[0, 12]]}], "joints": []})");
  PagePose pose(folder_ / "bars.obj", folder_ / "all.json");
  pose.cut(0, across_arm(0.5));  // the first bar alone
  ASSERT_EQ(told(pose)["parts"].size(), 2u);
  const JointedModel& model = pose.session().model();
  for (std::size_t p = 0; p < 2; ++p)
    for (const Index t : model.parts[p].triangles)
      for (const Index v : model.surface.triangles[static_cast<std::size_t>(t)])
        EXPECT_GE((p == 0 ? 1.0 : -1.0) * (model.surface.vertices[static_cast<std::size_t>(v)].x() - 0.5), -1e-9);
}

TEST_F(PagePoseTest, APartIsRenamedInWhatIsSaved) {
  PagePose pose = page();
  pose.set_name(1, "boom");
  EXPECT_EQ(told(pose)["joints"][0]["b"], "boom");
  EXPECT_THAT(pose.joints_text(), ::testing::HasSubstr("\"boom\""));
  EXPECT_THROW(pose.set_name(1, "base"), InvalidArgument);
  EXPECT_THROW(pose.set_name(1, ""), InvalidArgument);
  EXPECT_THROW(pose.set_name(2, "stick"), InvalidArgument);
  EXPECT_TRUE(pose.undo());
  EXPECT_EQ(told(pose)["parts"][1]["name"], "arm");
}

TEST_F(PagePoseTest, ACutThatEndsInsideIsRefused) {
  PagePose pose = page();
  const std::string before = pose.description();
  try {
    pose.cut(1, across_arm(1.6, 0.1));
    FAIL();
  } catch (const InvalidArgument& e) {
    EXPECT_THAT(e.what(),
                ::testing::ContainsRegex("meets [1-9][0-9]* edges of part \"arm\".*expected a line right across"));
  }
  EXPECT_THROW(pose.cut(1, across_arm(9.0)), InvalidArgument);
  EXPECT_THROW(pose.cut(7, across_arm(1.6)), InvalidArgument);
  EXPECT_EQ(pose.description(), before);
}

TEST_F(PagePoseTest, APoseIsSavedAsAModelOfItsOwn) {
  PagePose pose = page();
  pose.grab(tip(pose));
  pose.drag_to({1.9, 0.1, 0.7});
  settle(pose);
  const std::filesystem::path folder = std::filesystem::path(::testing::TempDir()) / "page_pose_saved";
  std::filesystem::create_directories(folder);
  write_file(folder / "m.obj", pose.model_text());
  write_file(folder / "m.json", pose.joints_text());
  PagePose again(folder / "m.obj", folder / "m.json");
  for (std::size_t i = 0; i < pose.positions().size(); ++i)
    EXPECT_NEAR(again.positions()[i], pose.positions()[i], 1e-6);
  EXPECT_NEAR(again.session().model().joints[0].joint.limits.rotation.low, -1.0 - turn(pose), 1e-9);
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace limber
