/// @file kinematic_tree.h
/// An assembly as robot formats see it: a tree of links, joints of one freedom each. Private to the articulation
/// module.
#pragma once

#include <string>
#include <vector>

#include "limber/articulation/robot_files.h"

namespace limber::internal {

/// One freedom, about or along an axis through the joint's origin.
struct AxisFreedom {
  bool turns = true;
  Vec3 axis = Vec3::UnitX();  ///< input frame
  Interval range{};           ///< rad or m
  std::string suffix{};       ///< "rx", "tz": of names
  /// The freedom of the tree that it goes along with, as a screw's advance with its turn
  struct Leader {
    int link = -1;  ///< −1: it leads itself
    std::size_t freedom = 0;
    double ratio = 0.0;  ///< of its speed to the leader's, rad or m
  } leader{};
};

/// A component in the tree.
struct TreeLink {
  Index component = 0;
  int parent = -1;                      ///< link, −1: a root
  std::size_t joint = 0;                ///< to the parent
  Vec3 origin = Vec3::Zero();           ///< of its frame, m
  std::vector<AxisFreedom> freedoms{};  ///< from the parent outward; none: fixed
  std::vector<int> children{};
};

struct KinematicTree {
  std::vector<TreeLink> links;  ///< parents first
  std::vector<int> roots;
  std::vector<std::size_t> closed;     ///< joints that close a chain and are not in the tree
  std::vector<std::size_t> uncoupled;  ///< couplings that the tree has not
};

KinematicTree kinematic_tree(const Assembly& assembly, const std::vector<DetectedJoint>& joints,
                             const RobotOptions& options);

/// Freedoms of part b in the frame of a, or of a in that of b if `reversed`.
std::vector<AxisFreedom> axis_freedoms(const JointSpec& joint, bool reversed, double metres_per_unit);

}  // namespace limber::internal
