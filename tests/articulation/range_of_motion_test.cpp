// Limits of joints whose geometry is known on paper, and which parts move with a joint.
#include "limber/articulation/range_of_motion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

#include "asked.h"
#include "constants.h"
#include "limber/core/error.h"
#include "sample_assembly.h"

namespace limber {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

using testing::component_of;
using testing::joint_of;
using testing::kDegree;
using testing::kInfinity;
using testing::kPi;

/// What limits are held to: 1 degree, 1e-3 of the diagonal.
constexpr double kAngle = 1.0 * kDegree;
constexpr double kLength = 1e-3;

Assembly assembly_of(const std::vector<SurfaceMesh>& parts) {
  Assembly assembly;
  Eigen::AlignedBox3d box;
  for (const SurfaceMesh& part : parts) {
    assembly.components.push_back(component_of("part " + std::to_string(assembly.components.size() + 1), part));
    for (const Vec3& p : part.vertices) box.extend(p);
  }
  assembly.diagonal = box.diagonal().norm();
  return assembly;
}

std::vector<DetectedJoint> links(const std::vector<std::pair<Index, Index>>& pairs) {
  std::vector<DetectedJoint> joints;
  for (const auto& [a, b] : pairs) joints.push_back(joint_of(a, b, JointType::kRevolute));
  return joints;
}

TEST(JointSides, BehindTheJointOfATreeAllMoves) {
  const JointSides s = joint_sides(6, links({{0, 1}, {1, 2}, {2, 3}, {1, 4}}), 1);
  EXPECT_THAT(s.moving, ElementsAre(2, 3));
  EXPECT_THAT(s.fixed, ElementsAre(0, 1, 4, 5));
  EXPECT_THAT(s.left_out, IsEmpty());
}

TEST(JointSides, TheRestOfAClosedChainIsLeftOutWithWhatHangsOnIt) {
  // frame 0, crank 1, rod 2, piston 3; a knob 4 on the crank, a nut 5 on the rod, a foot 6 on the frame
  const JointSides s = joint_sides(7, links({{0, 1}, {1, 2}, {2, 3}, {0, 3}, {1, 4}, {2, 5}, {0, 6}}), 0);
  EXPECT_THAT(s.moving, ElementsAre(1, 4));
  EXPECT_THAT(s.fixed, ElementsAre(0, 6));
  EXPECT_THAT(s.left_out, ElementsAre(2, 3, 5));
}

TEST(JointSides, FixedJointsHoldTogether) {
  // A door (1) on a frame (0) with two hinges: leaves 2 and 4 fixed to the frame, 3 and 5 to the door.
  auto joints = links({{2, 3}, {4, 5}, {0, 2}, {0, 4}, {1, 3}, {1, 5}});
  for (std::size_t j = 2; j < 6; ++j) joints[j].joint.type = JointType::kFixed;
  const JointSides s = joint_sides(6, joints, 0);
  EXPECT_THAT(s.moving, ElementsAre(1, 3, 5));
  EXPECT_THAT(s.fixed, ElementsAre(0, 2, 4));
  EXPECT_THAT(s.left_out, IsEmpty());
}

/// A lever on a pin along z, between two posts at right angles; the pin has heads.
struct Lever {
  explicit Lever(int segments) {
    SurfaceMesh base = parts::revolved({0, 0, 0}, Vec3::UnitZ(),
                                       {{0, -2}, {2, -2}, {2, -1}, {1, -1}, {1, 1}, {2, 1}, {2, 2}, {0, 2}}, segments);
    shapes::append(shapes::box({-9, 4, -1}, {-7, 6, 1}), base);
    shapes::append(shapes::box({4, 7, -1}, {6, 9, 1}), base);
    SurfaceMesh lever = parts::tube({0, 0, 0}, Vec3::UnitZ(), 1.0, 2.5, 2.0, segments);
    shapes::append(shapes::box({2, -0.5, -0.5}, {10, 0.5, 0.5}), lever);
    assembly = assembly_of({base, lever});
    joints = {joint_of(0, 1, JointType::kCylindrical, Vec3::UnitZ())};
    for (int i = 0; i < segments; ++i)
      joints[0].contact_points.push_back(
          {std::cos(2 * kPi * i / segments), std::sin(2 * kPi * i / segments), i % 2 * 2.0 - 1.0});
  }
  Assembly assembly;
  std::vector<DetectedJoint> joints;
};

TEST(RangeOfMotion, PinWithHeadsMakesACylindricalJointRevolute) {
  for (const int segments : {8, 16, 32, 64}) {
    const Lever lever(segments);
    const RangeOfMotion r = range_of_motion(lever.assembly, lever.joints, 0);
    EXPECT_EQ(r.joint.type, JointType::kRevolute) << segments;
    // Upper face, 0.5 from the axis, meets the corner (6, 7); lower face meets (−9, 4) after the long way round.
    EXPECT_NEAR(r.joint.limits.rotation.high, std::atan2(7, 6) - std::asin(0.5 / std::hypot(7, 6)), kAngle);
    EXPECT_NEAR(r.joint.limits.rotation.low, std::atan2(4, -9) + std::asin(0.5 / std::hypot(4, 9)) - 2 * kPi, kAngle);
    EXPECT_THAT(r.reasons, Contains(HasSubstr("the cylindrical joint is revolute")));
    EXPECT_THAT(r.reasons, Contains(HasSubstr("\"part 1\"")));
  }
}

TEST(RangeOfMotion, WhatHangsOnThePartIsStoppedToo) {
  // A short arm carries a long one, which meets the wall that the arm itself would miss.
  const SurfaceMesh base = shapes::box({-1, -1, -9}, {1, 1, -5}), wall = shapes::box({-5, 6, -1}, {12, 8, 1});
  const SurfaceMesh arm = shapes::box({0, -0.5, -0.5}, {4, 0.5, 0.5}),
                    longer = shapes::box({4, -0.5, -0.5}, {10, 0.5, 0.5});
  const Assembly assembly = assembly_of({base, arm, longer, wall});
  const std::vector<DetectedJoint> joints{joint_of(0, 1, JointType::kRevolute, Vec3::UnitZ()),
                                          joint_of(1, 2, JointType::kFixed)};
  const RangeOfMotion r = range_of_motion(assembly, joints, 0);
  // the far corner (10, 0.5) reaches y = 6
  EXPECT_NEAR(r.joint.limits.rotation.high, std::asin(6 / std::hypot(10, 0.5)) - std::atan2(0.5, 10), kAngle);
  ASSERT_EQ(r.freedoms.size(), 1u);
  EXPECT_EQ(r.freedoms[0].motion.high.body, 3);
}

TEST(RangeOfMotion, BallInASocketSwingsUntilItsNeckMeetsTheRim) {
  // Ball of radius 1 on a neck of radius 0.3; the socket's rim lies at 50° from the axis on the ball.
  for (const int segments : testing::all_or_first<int>({16, 32})) {
    const double rim = 50 * kDegree;
    SurfaceMesh ball = shapes::sphere(Vec3::Zero(), 1.0, segments == 16 ? 2 : 3);
    shapes::append(parts::cylinder({3, 0, 0}, Vec3::UnitX(), 0.3, 5.0, segments), ball);
    std::vector<std::pair<double, double>> profile;  // height along −x, from the rim to the pole, and back outside
    for (int i = 0; i <= segments / 2; ++i) {
      const double angle = rim + (kPi - rim) * i / (segments / 2);
      profile.emplace_back(i == segments / 2 ? 0.0 : std::sin(angle), std::cos(angle));
    }
    profile.emplace_back(0.0, -2.0);
    profile.emplace_back(2.0, -2.0);
    profile.emplace_back(2.0, std::cos(rim));
    std::reverse(profile.begin(), profile.end());
    const SurfaceMesh socket = parts::revolved(Vec3::Zero(), Vec3::UnitX(), profile, 2 * segments);
    ASSERT_TRUE(surface_quality(socket).closed_manifold());
    const Assembly assembly = assembly_of({socket, ball});
    std::vector<DetectedJoint> joints{joint_of(0, 1, JointType::kBall)};
    joints[0].contact_points = {Vec3(-1, -1, -1), Vec3(std::cos(rim), 1, 1)};
    const RangeOfMotion r = range_of_motion(assembly, joints, 0);
    ASSERT_EQ(r.joint.type, JointType::kBall);
    // The neck's side, 0.3 from its axis, meets the rim's edge at distance 1 and the flat ring beyond it.
    const double angle = rim - std::asin(0.3);
    EXPECT_NEAR(r.joint.limits.cone, angle, 1.5 * kAngle) << segments;
    EXPECT_TRUE(r.joint.limits.euler[0].open());
    EXPECT_NEAR(r.joint.limits.euler[1].high, angle, 1.5 * kAngle);
    EXPECT_NEAR(r.joint.limits.euler[2].low, -angle, 1.5 * kAngle);
  }
}

TEST(RangeOfMotion, PuckOnATableWithARimSlidesBothWays) {
  SurfaceMesh table = shapes::box({-10, -8, -1}, {10, 8, 0});
  for (const auto& [low, high] : {std::pair{Vec3(-11, -9, -1), Vec3(-10, 9, 1)},
                                  {Vec3(10, -9, -1), Vec3(11, 9, 1)},
                                  {Vec3(-10, -9, -1), Vec3(10, -8, 1)},
                                  {Vec3(-10, 8, -1), Vec3(10, 9, 1)}})
    shapes::append(shapes::box(low, high), table);
  const Assembly assembly = assembly_of({table, parts::cylinder({1, 2, 0.5}, Vec3::UnitZ(), 2.0, 1.0, 32)});
  std::vector<DetectedJoint> joints{joint_of(0, 1, JointType::kPlanar, Vec3::UnitX(), {1, 2, 0})};
  joints[0].joint.frame.axes.setIdentity();
  const RangeOfMotion r = range_of_motion(assembly, joints, 0);
  ASSERT_EQ(r.joint.type, JointType::kPlanar);
  const double rounding = 2.0 * (1.0 - std::cos(kPi / 32));  // the puck's flats
  EXPECT_NEAR(r.joint.limits.translation[0].low, -9.0, kLength + rounding);
  EXPECT_NEAR(r.joint.limits.translation[0].high, 7.0, kLength + rounding);
  EXPECT_NEAR(r.joint.limits.translation[1].low, -8.0, kLength + rounding);
  EXPECT_NEAR(r.joint.limits.translation[1].high, 4.0, kLength + rounding);
  EXPECT_TRUE(r.joint.limits.rotation.open());
}

TEST(RangeOfMotion, NarrowFreedomsGo) {
  std::vector<std::string> reasons;
  JointSpec planar{.type = JointType::kPlanar};
  planar.limits.translation = {Interval{-1e-5, 0}, Interval{-2, 3}};
  planar.limits.rotation = {-0.01, 0.01};
  const JointSpec slider = without_narrow_freedoms(planar, 0.03, 1e-3, reasons);
  EXPECT_EQ(slider.type, JointType::kPrismatic);
  EXPECT_EQ(slider.frame.axes.col(0), Vec3::UnitY());
  EXPECT_GT(slider.frame.axes.determinant(), 0.0);
  EXPECT_EQ(slider.limits.translation[0], (Interval{-2, 3}));

  planar.limits.translation[1] = {0, 0};
  planar.limits.rotation = {};
  const JointSpec turntable = without_narrow_freedoms(planar, 0.03, 1e-3, reasons);
  EXPECT_EQ(turntable.type, JointType::kRevolute);
  EXPECT_EQ(turntable.frame.axes.col(0), Vec3::UnitZ());
  EXPECT_TRUE(turntable.limits.rotation.open());

  JointSpec hinge{.type = JointType::kRevolute};
  hinge.limits.rotation = {-0.01, 0.01};
  EXPECT_EQ(without_narrow_freedoms(hinge, 0.03, 1e-3, reasons).type, JointType::kFixed);
  EXPECT_EQ(without_narrow_freedoms(hinge, 0.01, 1e-3, reasons).type, JointType::kRevolute);
  EXPECT_EQ(reasons.size(), 3u);
}

TEST(RangesOfMotion, ProgressIsToldPathByPathAndRisesToOne) {
  const Lever lever(8);
  std::vector<double> told;
  RangeOptions options;
  options.progress = [&](double part) { told.push_back(part); };
  const std::vector<RangeOfMotion> ranges = ranges_of_motion(lever.assembly, lever.joints, options);
  EXPECT_EQ(ranges.at(0).joint.limits, range_of_motion(lever.assembly, lever.joints, 0).joint.limits);
  EXPECT_THAT(told, ElementsAre(0.5, 1.0));  // turning, then sliding
}

TEST(RangeOfMotion, WrongArgumentsAreTold) {
  const Lever lever(8);
  EXPECT_THROW(range_of_motion(lever.assembly, lever.joints, 1), InvalidArgument);
  EXPECT_THROW(range_of_motion(lever.assembly, lever.joints, 0, {.min_rotation = -1.0}), InvalidArgument);
  EXPECT_THROW(range_of_motion(lever.assembly, lever.joints, 0, {.cone_directions = 2}), InvalidArgument);
}

}  // namespace
}  // namespace limber
