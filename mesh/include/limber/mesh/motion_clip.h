/// @file limber/mesh/motion_clip.h
/// Recorded motion of a skeleton: where each of its joints stands, frame by frame.
#pragma once

#include <string>
#include <vector>

#include "limber/core/rigid_transform.h"

namespace limber {

struct MotionClip {
  struct Joint {
    std::string name{};
    Index parent = -1;      ///< before it; −1: the root
    RigidTransform rest{};  ///< in the clip's frame and unit
  };
  std::vector<Joint> joints{};                       ///< the root first
  std::vector<double> times{};                       ///< s, ascending
  std::vector<std::vector<RigidTransform>> poses{};  ///< per frame and joint, in the clip's frame
};

}  // namespace limber
