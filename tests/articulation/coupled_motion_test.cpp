// Gears, a rack with its pinion, a cam with its follower, a slider crank: each keeps its freedom, as the
// other goes along.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <iterator>
#include <numbers>
#include <string>
#include <vector>

#include "assemblies.h"
#include "constants.h"
#include "joint_scores.h"
#include "limber/articulation/detect_joints.h"
#include "limber/jobs_tbb/tbb_jobs.h"
#include "sample_assembly.h"

namespace limber {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

using testing::component_of;
using testing::joint_of;
using testing::kPi;
using Outline = std::vector<Eigen::Vector2d>;

/// Teeth of module 1: flanks at 25° to the pitch line, tips and roots 0.8 and 1 from it.
constexpr double kFlank = 25.0 * kPi / 180.0, kTip = 0.8, kRoot = 1.0;
/// By which each flank stands back.
constexpr double kPlay = 0.05;

/// Of involutes, from the root circle to the tip; tooth 0 points to `turned`.
Outline gear_outline(int teeth, double turned) {
  constexpr int kPoints = 5;
  const double pitch = 0.5 * teeth, base = pitch * std::cos(kFlank);
  const auto involute = [&](double radius) {  // its angle from where it leaves the base circle
    const double tangent = std::sqrt(std::max(0.0, (radius / base) * (radius / base) - 1.0));
    return tangent - std::atan(tangent);
  };
  const double half = 0.5 * kPi / teeth - kPlay / pitch + involute(pitch);  // of a tooth, at the base circle
  Outline out;
  for (int tooth = 0; tooth < teeth; ++tooth)
    for (int flank = 0; flank < 2; ++flank)
      for (int i = 0; i <= kPoints; ++i) {
        const int at = flank == 0 ? i : kPoints - i;
        const double low = std::max(base, pitch - kRoot);
        const double radius = at == 0 ? pitch - kRoot : low + (pitch + kTip - low) * (at - 1) / (kPoints - 1);
        const double angle = half - involute(radius);
        const double to = turned + 2.0 * kPi * tooth / teeth + (flank == 0 ? -angle : angle);
        out.push_back({radius * std::cos(to), radius * std::sin(to)});
      }
  return out;
}

/// A prism over a counter-clockwise outline that is seen whole from a point.
SurfaceMesh prism(const Outline& outline, const Eigen::Vector2d& seen_from, const Vec3& at, double height) {
  SurfaceMesh s;
  for (const double z : {-0.5 * height, 0.5 * height}) {
    for (const Eigen::Vector2d& p : outline) s.vertices.push_back(at + Vec3(p.x(), p.y(), z));
    s.vertices.push_back(at + Vec3(seen_from.x(), seen_from.y(), z));
  }
  const auto n = static_cast<Index>(outline.size());
  for (Index i = 0; i < n; ++i) {
    const Index next = (i + 1) % n, up = n + 1;
    s.triangles.push_back({i, next, up + next});
    s.triangles.push_back({i, up + next, up + i});
    s.triangles.push_back({next, i, n});
    s.triangles.push_back({up + i, up + next, up + n});
  }
  return s;
}

/// A bar with straight teeth towards +y, one of them over the middle.
SurfaceMesh rack(int teeth, double height) {
  const double half = 0.5 * kPi * teeth, slope = std::tan(kFlank), at_pitch = 0.25 * kPi - kPlay, foot = -kRoot - 0.5;
  SurfaceMesh s = shapes::box({-half, -3, -0.5 * height}, {half, -kRoot, 0.5 * height});
  const Outline tooth{{-at_pitch + foot * slope, foot},
                      {at_pitch - foot * slope, foot},
                      {at_pitch - kTip * slope, kTip},
                      {-at_pitch + kTip * slope, kTip}};
  for (int i = -(teeth / 2); i <= teeth / 2; ++i) shapes::append(prism(tooth, {0, 0}, {kPi * i, 0, 0}, height), s);
  return s;
}

TEST(CoupledMotion, GearsTurnEachOther) {
  constexpr int kFirst = 12, kSecond = 18;
  const Vec3 second(0.5 * (kFirst + kSecond), 0, 0);
  Assembly assembly;
  assembly.components = {component_of("plate", shapes::box({-9, -9, -9}, {30, 9, -5})),
                         component_of("small", prism(gear_outline(kFirst, 0.0), {0, 0}, {0, 0, 0}, 2)),
                         component_of("large", prism(gear_outline(kSecond, kPi + kPi / kSecond), {0, 0}, second, 2))};
  ASSERT_TRUE(assembly.components[1].closed);
  const std::vector<DetectedJoint> joints{joint_of(0, 1, JointType::kRevolute, Vec3::UnitZ(), {0, 0, 0}),
                                          joint_of(0, 2, JointType::kRevolute, Vec3::UnitZ(), second)};
  const std::vector<RangeOfMotion> ranges = ranges_of_motion(assembly, joints);
  for (std::size_t j = 0; j < 2; ++j) {
    EXPECT_EQ(ranges[j].joint.type, JointType::kRevolute);
    EXPECT_TRUE(ranges[j].joint.limits.rotation.open());
    ASSERT_EQ(ranges[j].freedoms[0].coupled.size(), 1u);
    const CoupledFreedom& coupled = ranges[j].freedoms[0].coupled[0];
    EXPECT_EQ(coupled.joint, 1 - j);
    EXPECT_EQ(coupled.freedom, 0u);
    const double ratio = j == 0 ? -static_cast<double>(kFirst) / kSecond : -static_cast<double>(kSecond) / kFirst;
    EXPECT_LE(coupled.ratio.low, ratio);
    EXPECT_GE(coupled.ratio.high, ratio);
    EXPECT_LT(coupled.ratio.high - coupled.ratio.low, 0.02);
    EXPECT_NEAR(coupled.as_read, ratio, 0.1);  // within the play corners of facets lead
  }
  const std::vector<JointCoupling> couplings = joint_couplings(ranges);
  ASSERT_EQ(couplings.size(), 1u);
  EXPECT_TRUE(couplings[0].even);
  EXPECT_EQ(couplings[0].first.joint, 0u);
  EXPECT_EQ(couplings[0].second.joint, 1u);
  EXPECT_EQ(couplings[0].ratio, -2.0 / 3.0);
  EXPECT_EQ(ratio_text(couplings[0]), "-0.6667 (-2/3)");
  EXPECT_EQ(overall_kinematics(assembly, joints).mobility, 2);
  EXPECT_EQ(overall_kinematics(assembly, joints, couplings).mobility, 1);
  EXPECT_THAT(ranges[0].reasons, Contains(HasSubstr("coupled with joint 1, \"plate\" - \"large\"")));
  EXPECT_THAT(ranges[0].reasons, Contains(HasSubstr("(-2/3)")));
}

/// The rack is the first of its joint, so that the joint moves all but the rack.
TEST(CoupledMotion, APinionGoesAsFarAsItsRackDoes) {
  constexpr int kTeeth = 12;
  constexpr double kWay = 7.0, kRadius = 0.5 * kTeeth;
  const double half = 4.5 * kPi;
  SurfaceMesh plate = shapes::box({-30, -20, -9}, {30, 20, -5});
  for (const double side : {-1.0, 1.0}) {
    const double from = side * (half + kWay), to = from + side;
    shapes::append(shapes::box({std::min(from, to), -3, -1}, {std::max(from, to), -2, 1}), plate);
  }
  Assembly assembly;
  assembly.components = {
      component_of("rack", rack(9, 2)), component_of("plate", plate),
      component_of("pinion", prism(gear_outline(kTeeth, -0.5 * kPi + kPi / kTeeth), {0, 0}, {0, kRadius, 0}, 2))};
  const std::vector<DetectedJoint> joints{joint_of(0, 1, JointType::kPrismatic, Vec3::UnitX(), {0, 0, 0}),
                                          joint_of(1, 2, JointType::kRevolute, Vec3::UnitZ(), {0, kRadius, 0})};
  const std::vector<RangeOfMotion> ranges = ranges_of_motion(assembly, joints);
  ASSERT_EQ(ranges[1].joint.type, JointType::kRevolute);
  ASSERT_EQ(ranges[1].freedoms[0].coupled.size(), 1u);
  // The pinion rolls on the rack: counter-clockwise it pushes the rack to +x, which takes the plate to −x.
  const Interval ratio = ranges[1].freedoms[0].coupled[0].ratio;
  EXPECT_LE(ratio.low, -kRadius);
  EXPECT_GE(ratio.high, -kRadius);
  EXPECT_LT(ratio.high - ratio.low, 0.1 * kRadius);
  const double play = 2.0 * kPlay / kRadius;
  EXPECT_NEAR(ranges[1].joint.limits.rotation.high, kWay / kRadius, play);
  EXPECT_NEAR(ranges[1].joint.limits.rotation.low, -kWay / kRadius, play);
  ASSERT_EQ(ranges[0].joint.type, JointType::kPrismatic);
  EXPECT_NEAR(ranges[0].joint.limits.translation[0].high, kWay, 1e-3);
  EXPECT_NEAR(ranges[0].joint.limits.translation[0].low, -kWay, 1e-3);
  const std::vector<JointCoupling> couplings = joint_couplings(ranges);
  ASSERT_EQ(couplings.size(), 1u);
  EXPECT_FALSE(couplings[0].first.turns);
  EXPECT_TRUE(couplings[0].second.turns);
  EXPECT_NEAR(couplings[0].ratio, -1.0 / kRadius, 0.05 / kRadius);
  EXPECT_EQ(overall_kinematics(assembly, joints, couplings).mobility, 1);
}

/// An eccentric in a yoke, which goes up and down while the eccentric goes round.
TEST(CoupledMotion, ACamTurnsFullyAndItsFollowerGoesAlong) {
  constexpr double kRadius = 3.0, kThrow = 1.0, kInner = kRadius + 0.05;
  constexpr int kSegments = 24;
  SurfaceMesh yoke;
  for (const double low : {-kInner - 1, kInner}) shapes::append(shapes::box({-5, low, -1}, {5, low + 1, 1}), yoke);
  for (const double low : {-6.0, 5.0})
    shapes::append(shapes::box({low, -kInner - 1, -1}, {low + 1, kInner + 1, 1}), yoke);
  Assembly assembly;
  assembly.components = {component_of("plate", shapes::box({-9, -9, -9}, {9, 9, -5})),
                         component_of("cam", parts::cylinder({kThrow, 0, 0}, Vec3::UnitZ(), kRadius, 2, kSegments)),
                         component_of("yoke", yoke)};
  const std::vector<DetectedJoint> joints{joint_of(0, 1, JointType::kRevolute, Vec3::UnitZ(), {0, 0, 0}),
                                          joint_of(0, 2, JointType::kPrismatic, Vec3::UnitY(), {0, 0, 0})};
  const std::vector<RangeOfMotion> ranges = ranges_of_motion(assembly, joints);
  ASSERT_EQ(ranges[0].joint.type, JointType::kRevolute);
  EXPECT_TRUE(ranges[0].joint.limits.rotation.open());
  ASSERT_EQ(ranges[1].joint.type, JointType::kPrismatic);
  // Half a facet before the dead centre, where the follower's way parts in two, and at most with a facet level.
  const Interval way = ranges[1].joint.limits.translation[0];
  const double least = kInner - kRadius + kThrow, most = kInner - (kRadius - kThrow) * std::cos(kPi / kSegments) + 2e-3;
  for (const double end : {way.high, -way.low}) {
    EXPECT_GE(end, least);
    EXPECT_LE(end, most);
  }
  for (std::size_t j = 0; j < 2; ++j) {
    ASSERT_EQ(ranges[j].freedoms[0].coupled.size(), 1u);
    EXPECT_EQ(ranges[j].freedoms[0].coupled[0].joint, 1 - j);
    EXPECT_NEAR(ranges[j].freedoms[0].coupled[0].as_read, kThrow, 0.3);  // within the play corners of facets lead
    EXPECT_THAT(ranges[j].reasons, Contains(HasSubstr("whose speed changes on the way")));
  }
  const std::vector<JointCoupling> couplings = joint_couplings(ranges);
  ASSERT_EQ(couplings.size(), 1u);
  EXPECT_FALSE(couplings[0].even);
  EXPECT_EQ(overall_kinematics(assembly, joints, couplings).mobility, 1);
}

/// As drawn: a throw of 0.03 at 50°, a rod of 0.12, a block with its bore, crank, rod and piston as files have them.
TEST(CoupledMotion, ASliderCrankKeepsItsFreedomAndItsAxesGoAlong) {
  TbbJobs jobs;
  const Assembly assembly = assemblies::taken_apart(assemblies::make("piston", {.segments = 16, .clearance = 0.005}));
  const std::vector<DetectedJoint> joints = detect_joints(assembly, {}, jobs);
  ASSERT_EQ(joints.size(), 4u);
  EXPECT_EQ(overall_kinematics(assembly, joints).mobility, 1);
  const auto joint_between = [&](const std::string& a, const std::string& b) {
    const auto name = [&](Index c) { return assembly.components[static_cast<std::size_t>(c)].name; };
    return static_cast<std::size_t>(std::distance(
        joints.begin(), std::ranges::find_if(joints, [&](const auto& j) { return name(j.a) == a && name(j.b) == b; })));
  };
  const std::size_t crank = joint_between("block", "crank"), slider = joint_between("block", "piston");
  ASSERT_LT(std::max(crank, slider), joints.size());
  const std::vector<RangeOfMotion> ranges = ranges_of_motion(assembly, joints, {}, jobs);
  EXPECT_TRUE(ranges[crank].joint.limits.rotation.open());
  EXPECT_TRUE(ranges[slider].joint.limits.translation[0].open());
  const std::vector<JointCoupling> couplings = chain_couplings(assembly, joints);
  ASSERT_EQ(couplings.size(), 3u);  // all but the piston's turn in its bore, which the wrist pin holds
  const auto of_slider =
      std::ranges::find_if(couplings, [&](const JointCoupling& c) { return c.second.joint == slider; });
  ASSERT_NE(of_slider, couplings.end());
  EXPECT_EQ(of_slider->first.joint, crank);
  EXPECT_FALSE(of_slider->second.turns);
  constexpr double kThrow = 0.03, kRod = 0.12, kAngle = 50.0 * kPi / 180.0;
  const double aside = kThrow * std::sin(kAngle), along = kThrow * std::cos(kAngle);
  const double speed = aside * (1.0 + along / std::sqrt(kRod * kRod - aside * aside));
  EXPECT_NEAR(std::abs(of_slider->ratio), speed, 1e-3 * speed);
}

TEST(CoupledMotion, WedgesThatStopEachOtherOnOneSideAreNot) {
  // Two levers beside each other: either turns away, and neither is held within a play.
  Assembly assembly;
  assembly.components = {component_of("plate", shapes::box({-9, -9, -9}, {30, 9, -5})),
                         component_of("left", shapes::box({0, -0.5, -1}, {8, 0.5, 1})),
                         component_of("right", shapes::box({7, 0.6, -1}, {15, 1.6, 1}))};
  const std::vector<DetectedJoint> joints{joint_of(0, 1, JointType::kRevolute, Vec3::UnitZ(), {0, 0, 0}),
                                          joint_of(0, 2, JointType::kRevolute, Vec3::UnitZ(), {15, 1.1, 0})};
  for (const RangeOfMotion& range : ranges_of_motion(assembly, joints))
    EXPECT_THAT(range.freedoms[0].coupled, IsEmpty());
}

}  // namespace
}  // namespace limber
