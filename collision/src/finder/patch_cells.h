// How much of a patch each of its contacts stands for: the part of their hull that is nearer to it than to any other.
#pragma once

#include <vector>

#include "convex/convex_polygon.h"

namespace limber::internal {

class PatchCells {
 public:
  /// Areas by point; their sum is the hull's. Points upon each other share theirs. Infinite where all lie on a line,
  /// which has no area to be shared.
  const std::vector<double>& find(const std::vector<PlanePoint>& points);

 private:
  /// Leaves of the cell of p what is nearer to p than to q.
  void cut(const PlanePoint& p, const PlanePoint& q);
  double farthest_corner(const PlanePoint& p) const;  // squared

  std::vector<PlanePoint> scratch_, hull_, cell_, next_;
  std::vector<double> areas_;
};

}  // namespace limber::internal
