/// @file motion_search.h
/// All blocked positions along one path among bodies that are few. Private to the articulation module.
#pragma once

#include <span>

#include "limber/articulation/free_motion.h"
#include "ranges/orbit_faces.h"
#include "ranges/path_frame.h"

namespace limber::internal {

struct Tolerances {
  double across = 0.0;           ///< δ to start with, without what facets add, length
  double facets = 0.0;           ///< what facets that slide on each other add, length
  double largest_overlap = 0.0;  ///< as drawn, length
  double nudge = 0.0;            ///< of round-off, length, far below both
};

/// The free intervals of (1) in free_motion.h. MotionStop::body is a number in `fixed`.
FreeMotion search_motion(const PathFrame& frame, std::span<const OrbitBody> moving, std::span<const OrbitBody> fixed,
                         const Tolerances& t, const FreeMotionOptions& options);

}  // namespace limber::internal
