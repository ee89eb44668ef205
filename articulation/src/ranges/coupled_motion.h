/// @file coupled_motion.h
/// Two parts that engage, each free along one path: where the first one goes, the other goes along. Private to the
/// articulation module.
#pragma once

#include <optional>
#include <vector>

#include "limber/articulation/free_motion.h"
#include "ranges/orbit_faces.h"

namespace limber::internal {

/// A part, or some that move together, with its one freedom.
struct EngagedPart {
  std::vector<OrbitBody> bodies;
  MotionPath path;
  Interval limits;  ///< of the path with the other part away
};

/// How far one part goes while the other stands as drawn, if that stops it both ways.
std::optional<FreeMotion> stopped_both_ways(const EngagedPart& moving, const EngagedPart& standing,
                                            const FreeMotionOptions& options);

struct CoupledMotion {
  bool engaged = false;  ///< as drawn, either part stops the other both ways
  Interval reachable;    ///< of the first, while the second goes along
  /// Of the second's t to the first's: all at which both may run evenly, from the middle of their play, without contact
  /// over the reachable interval. low > high: at none
  Interval ratio;
  double as_read = 0.0;  ///< that of their speeds where they start, within the play
};

/// Follows the free interval of the second part while the first one goes on, step by step, up to a full turn. Steps are
/// so short that the interval's middle is foreseen to a part of its width. Where the parts come apart the first one's
/// own limits hold. @param options of each look; `within` and `reachable_only` are not read
CoupledMotion coupled_motion(const EngagedPart& first, const EngagedPart& second, const FreeMotionOptions& options);

}  // namespace limber::internal
