// Motions of many linkages at once, which can be counted on fingers.
#include <gtest/gtest.h>

#include "limber/articulation/detect_joints.h"

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

}  // namespace
}  // namespace limber
