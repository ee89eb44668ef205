// Motions of many linkages at once, which can be counted on fingers.
#include <gtest/gtest.h>

#include "limber/articulation/detect_joints.h"
#include "limber/core/error.h"

namespace limber {
namespace {

/// Planar four-bar linkages, each of three links on one ground, 100 apart: four hinges about z, one closed chain and
/// one motion each.
struct FourBars {
  explicit FourBars(Index count) {
    assembly.components.resize(static_cast<std::size_t>(1 + 3 * count));
    assembly.components[0].diagonal = 100.0 * count;
    for (Index i = 0; i < count; ++i) {
      const Vec3 at(100.0 * i, 7.0 * i, 0.0);
      const Index first = 1 + 3 * i;
      hinge(0, first, at);
      hinge(first, first + 1, at + Vec3(0.2, 1.0, 0.0));
      hinge(first + 1, first + 2, at + Vec3(1.7, 1.3, 0.0));
      hinge(0, first + 2, at + Vec3(2.0, 0.0, 0.0));
      for (Index link = first; link < first + 3; ++link)
        assembly.components[static_cast<std::size_t>(link)].diagonal = 1.5;
    }
  }
  void hinge(Index a, Index b, const Vec3& origin) {
    DetectedJoint j;
    j.a = a, j.b = b;
    j.joint.type = JointType::kRevolute;
    j.joint.frame.origin = origin;
    j.joint.frame.axes << 0, 1, 0, 0, 0, 1, 1, 0, 0;  // x of the frame is z
    joints.push_back(j);
  }
  Assembly assembly;
  std::vector<DetectedJoint> joints;
};

// Few columns and many are counted in two ways.
TEST(Kinematics, FourBarLinkagesMoveOneByOneHoweverMany) {
  for (const Index count : {1, 20, 120}) {
    const FourBars bars(count);
    const Kinematics all = overall_kinematics(bars.assembly, bars.joints);
    EXPECT_EQ(all.groups, 1);
    EXPECT_EQ(all.loops, count);
    EXPECT_EQ(all.kutzbach, -2 * count);  // 4 − 6 for each
    EXPECT_EQ(all.mobility, count);
  }
}

/// Speeds of a four-bar linkage's angles by the closed chain of its three vectors: Σ lᵢ ωᵢ n × eᵢ = 0.
TEST(Kinematics, AFourBarLinkagesAxesGoAlongWithItsCrank) {
  const FourBars bars(2);
  const std::vector<JointCoupling> couplings = chain_couplings(bars.assembly, bars.joints);
  ASSERT_EQ(couplings.size(), 6u);  // of each linkage three, with its crank
  Eigen::Matrix2d across;
  across << -0.3, 0.0, 1.5, 0.0;  // of the coupler (1.5, 0.3), then of the rocker (−0.3, 1.3), turned by a right angle
  across.col(1) = -Eigen::Vector2d(-1.3, -0.3);
  const Eigen::Vector2d turns = across.inverse() * -Eigen::Vector2d(-1.0, 0.2);
  const double expected[3] = {turns[0] - 1.0, turns[1] - turns[0], turns[1]};
  for (std::size_t i = 0; i < couplings.size(); ++i) {
    const JointCoupling& c = couplings[i];
    EXPECT_EQ(c.first.joint, 4 * (i / 3));
    EXPECT_EQ(c.second.joint, 4 * (i / 3) + 1 + i % 3);
    EXPECT_TRUE(c.first.turns && c.second.turns);
    EXPECT_FALSE(c.even);
    EXPECT_NEAR(c.ratio, expected[i % 3], 1e-9);
  }
}

// Gears in a row turn together; in a ring they do if their number is even.
TEST(Kinematics, GearsInARingTurnIfTheirNumberIsEven) {
  for (const std::size_t gears : {3u, 4u, 5u, 6u}) {
    Assembly assembly;
    assembly.components.resize(1 + gears);
    for (Component& c : assembly.components) c.diagonal = 1.0;
    std::vector<DetectedJoint> joints(gears);
    std::vector<JointCoupling> couplings;
    const auto teeth = [&](std::size_t gear) { return static_cast<double>(10 + 3 * (gear % gears)); };
    for (std::size_t i = 0; i < gears; ++i) {
      joints[i].a = 0, joints[i].b = static_cast<Index>(1 + i);
      joints[i].joint.type = JointType::kRevolute;
      joints[i].joint.frame.origin = Vec3(5.0 * static_cast<double>(i), 1.0, 0.0);
      couplings.push_back({{i, true}, {(i + 1) % gears, true}, -teeth(i) / teeth(i + 1), true});
    }
    const std::span<const JointCoupling> all = couplings;
    EXPECT_EQ(overall_kinematics(assembly, joints).mobility, static_cast<Index>(gears));
    EXPECT_EQ(overall_kinematics(assembly, joints, all.first(gears - 1)).mobility, 1);
    EXPECT_EQ(overall_kinematics(assembly, joints, all).mobility, gears % 2 == 0 ? 1 : 0);
    EXPECT_EQ(overall_kinematics(assembly, joints, all).kutzbach, 0);
  }
}

TEST(Kinematics, CouplingsOfAxesThatJointsLackAreRefused) {
  FourBars bars(1);
  const JointCoupling slide{{0, true}, {1, false}, 2.0, true}, none{{0, true}, {9, true}, 2.0, true};
  for (const JointCoupling& c : {slide, none})
    EXPECT_THROW(overall_kinematics(bars.assembly, bars.joints, {&c, 1}), InvalidArgument);
}

}  // namespace
}  // namespace limber
