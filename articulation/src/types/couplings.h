/// @file couplings.h
#pragma once

#include <span>
#include <vector>

#include "limber/articulation/detect_joints.h"

namespace limber::internal {

/// @throws InvalidArgument if a coupling names a joint that there is not, or an axis that its joint has not
void check_couplings(const std::vector<DetectedJoint>& joints, std::span<const JointCoupling> couplings);

}  // namespace limber::internal
