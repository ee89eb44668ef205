// What is around a flat contact, and what all contacts of an assembly tell of it: lines about which surfaces of both
// parts turn into themselves, and flanges that no weight holds together.
#include "types/mechanism.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "grouped_parts.h"
#include "limber/articulation/detect_joints.h"
#include "parts.h"
#include "types/common_line.h"

namespace limber {
namespace {

using internal::bends_of;
using internal::common_line;
using ::testing::HasSubstr;

constexpr int kSegments = 24;

SurfaceMesh together(SurfaceMesh a, const SurfaceMesh& b) {
  const auto first = static_cast<Index>(a.vertices.size());
  a.vertices.insert(a.vertices.end(), b.vertices.begin(), b.vertices.end());
  for (const Triangle& t : b.triangles) a.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  return a;
}

TEST(CommonLine, IsTheAxisOfWhatIsRoundInBothParts) {
  const Vec3 axis = Vec3(1, -2, 0.5).normalized(), at(0.3, 0.2, -0.1);
  const SurfaceMesh housing = together(parts::cylinder(at - axis, axis, 0.7, 1.0, kSegments),
                                       parts::cylinder(at - axis + Vec3(0.6, 0.3, 0), axis, 0.1, 1.0, kSegments)),
                    cover = parts::revolved(at + axis, axis, {{0.0, -0.5}, {0.5, -0.5}, {0.3, 0.5}, {0.0, 0.5}}, 30);
  const auto point = common_line(bends_of(housing, kDefaultCreaseAngle), bends_of(cover, kDefaultCreaseAngle), axis,
                                 at + 0.05 * axis.unitOrthogonal(), 2.0);
  ASSERT_TRUE(point);
  EXPECT_LT((*point - at).cross(axis).norm(), 1e-9);
}

TEST(CommonLine, IsNoneWherePartsAreRoundAboutDifferentOnesOrFlat) {
  const Vec3 axis = Vec3::UnitZ();
  const auto a = bends_of(parts::cylinder({0, 0, 0}, axis, 0.5, 1.0, kSegments), kDefaultCreaseAngle),
             b = bends_of(parts::cylinder({0.1, 0, 1}, axis, 0.5, 1.0, kSegments), kDefaultCreaseAngle),
             flat = bends_of(shapes::box({0, 0, 0}, {1, 1, 1}), kDefaultCreaseAngle);
  EXPECT_TRUE(flat.empty());
  EXPECT_FALSE(common_line(a, b, axis, {0, 0, 0.5}, 2.0));
  EXPECT_FALSE(common_line(a, flat, axis, {0, 0, 0.5}, 2.0));
}

/// Three links with flanges that are neither round nor centred; each housing beside them is. The second flange looks
/// along x or along z.
Assembly links(bool along_x) {
  const parts::Placement second = along_x ? parts::placed({0.8, 0, 1}, {0, std::numbers::pi / 2, 0}, 1.0)
                                          : parts::placed({0, 0, 1.2}, Vec3::Zero(), 1.0);
  const Vec3 z = Vec3::UnitZ();
  GroupedSurface whole;
  append_group(
      together(parts::cylinder({0, 0, -0.6}, z, 0.6, 0.8, kSegments), shapes::box({-0.5, -0.3, -0.2}, {0.9, 0.5, 0})),
      "base", whole);
  append_group(together(together(shapes::box({-0.5, -0.3, 0}, {0.9, 0.5, 0.2}),
                                 parts::cylinder({0, 0, 0.6}, z, 0.4, 0.8, kSegments)),
                        second(together(parts::cylinder({0, 0, -0.2}, z, 0.25, 0.4, kSegments),
                                        shapes::box({-0.3, -0.2, 0}, {0.5, 0.4, 0.2})))),
               "arm", whole);
  append_group(second(together(shapes::box({-0.3, -0.2, 0.2}, {0.5, 0.4, 0.4}),
                               parts::cylinder({0, 0, 0.7}, z, 0.3, 0.6, kSegments))),
               "hand", whole);
  return find_components(whole, {.rule = ComponentRule::kGroups});
}

TEST(Mechanism, FlangesThatLookDifferentWaysTurnAboutTheLineOfTheirHousings) {
  const auto joints = detect_joints(links(true));
  ASSERT_EQ(joints.size(), 2u);
  for (const DetectedJoint& j : joints) {
    EXPECT_EQ(j.joint.type, JointType::kRevolute);
    EXPECT_EQ(j.other_hypotheses.front().joint.type, JointType::kPlanar);
    EXPECT_GT(j.confidence, j.other_hypotheses.front().confidence);
    EXPECT_THAT(j.reasons.back(), HasSubstr("chain: "));
    EXPECT_THAT(j.reasons.back(), HasSubstr("symmetry: "));
  }
  const JointFrame &base = joints[0].joint.frame, &hand = joints[1].joint.frame;
  EXPECT_LT(base.axes.col(0).cross(Vec3::UnitZ()).norm(), 1e-9);
  EXPECT_LT(base.origin.norm(), 1e-6);
  EXPECT_LT(hand.axes.col(0).cross(Vec3::UnitX()).norm(), 1e-9);
  EXPECT_LT((hand.origin - Vec3(1, 0, 1)).norm(), 1e-6);
}

TEST(Mechanism, FlatContactsThatAllLookUpMayRest) {
  const auto joints = detect_joints(links(false));
  ASSERT_EQ(joints.size(), 2u);
  for (const DetectedJoint& j : joints) {
    EXPECT_EQ(j.joint.type, JointType::kPlanar);
    EXPECT_EQ(j.other_hypotheses.front().joint.type, JointType::kRevolute);
    EXPECT_LT(j.other_hypotheses.front().joint.frame.origin.head<2>().norm(), 1e-6);
  }
}

}  // namespace
}  // namespace limber
