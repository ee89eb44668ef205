/// @file limber/posing_penalty/penalty_poses.h
/// Poses by [X09]'s energies: cells are affine maps; rigidity, joints and limits are squares with large weights.
///
///   PosingSession session(model, {}, penalty_poses());
///
/// Gauss–Newton with Levenberg's damping. Joints and rigid parts give way, cells may flip if a handle jumps far, and a
/// drag takes hundreds to thousands of iterations. PosingOptions::energy_tolerance is not read. Equations:
/// docs/derivations/posing.md.
#pragma once

#include <memory>

#include "limber/posing/pose_method.h"

namespace limber {

struct PenaltyWeights {
  double rigidity = 1e5;  ///< of rigid parts' and cells' rigidity, [X09]; > 0
  double joints = 1e5;    ///< of joints and limits, [X09]; > 0
  void validate() const;  ///< @throws InvalidArgument naming the field and its value
};

/// @throws InvalidArgument see PenaltyWeights::validate()
std::shared_ptr<const PoseMethod> penalty_poses(const PenaltyWeights& weights = {});

}  // namespace limber
