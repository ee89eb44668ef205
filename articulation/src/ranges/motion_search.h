/// @file motion_search.h
/// All blocked positions along one path among bodies that are few. Private to the articulation module.
#pragma once

#include <span>

#include "limber/articulation/free_motion.h"
#include "ranges/orbit_faces.h"
#include "ranges/path_frame.h"

namespace limber::internal {

struct Tolerances {
  double least = 0.0;            ///< δ to start with, length
  double facets = 0.0;           ///< what δ is more because of facets, length
  double across = 0.0;           ///< δ, length
  double largest_overlap = 0.0;  ///< length
  double nudge = 0.0;            ///< length, far below both
};

/// The free intervals of (1) in free_motion.h. MotionStop::body is a number in `fixed`.
/// @param t across: to start with, without what facets add; it grows to the overlap found as read
FreeMotion search_motion(const PathFrame& frame, std::span<const OrbitBody> moving, std::span<const OrbitBody> fixed,
                         const Tolerances& t, const FreeMotionOptions& options);

}  // namespace limber::internal
