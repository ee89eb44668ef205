/// @file limber/posing/pose_method.h
/// Other ways to find poses than a session's own.
#pragma once

#include "limber/posing/posing_options.h"

namespace limber {
namespace internal {
struct PoseProblem;
struct AffinePose;
}  // namespace internal

/// Given to a PosingSession it finds all its poses. Cells are affine maps, which may stretch and shear; the session
/// takes joints, limits and the motions of rigid parts from the nearest rotations. Implementations see the private
/// headers of limber::posing (posing/src/pose_problem.h).
class PoseMethod {
 public:
  virtual ~PoseMethod() = default;
  /// @param pose in: where to begin; out: no worse @return what is not of joints, limits and handles
  virtual PoseResult solve(const internal::PoseProblem& problem, internal::AffinePose& pose) const = 0;
};

}  // namespace limber
