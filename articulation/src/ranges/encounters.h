/// @file encounters.h
/// Which bodies come together along a path, and how soon at the earliest. Private to the articulation module.
#pragma once

#include <span>
#include <vector>

#include "ranges/orbit_faces.h"

namespace limber::internal {

/// Pairs of a moving and a fixed body whose boxes may meet somewhere along a path.
class Encounters {
 public:
  /// @param margin by which all boxes are grown, length
  Encounters(const PathFrame& frame, std::span<const OrbitBody> moving, std::span<const OrbitBody> fixed,
             double margin);

  /// Some of the bodies on either side, ascending, and up to where along the path they are all that matters.
  struct Nearest {
    std::vector<Index> moving, fixed;
    double low = 0.0, high = 0.0;  ///< t; ∓∞: all that may meet are among them
  };
  /// The bodies whose boxes meet as read, and those that come next in either sense: as many pairs of them.
  Nearest nearest(std::size_t pairs) const;

 private:
  struct Pair {
    Index moving = 0, fixed = 0;
    /// t ≥ 0 before which the boxes do not meet with t rising and falling; ∞: never. Both 0: they meet as read.
    double rising = 0.0, falling = 0.0;
  };
  std::vector<Pair> pairs_;
};

}  // namespace limber::internal
