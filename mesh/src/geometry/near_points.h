// Points that lie on one another, within a tolerance.
#pragma once

#include <span>
#include <vector>

#include "limber/core/types.h"

namespace limber::internal {

/// Per point, the index of the point that stands for it: the nearest of those before it that stand for themselves and
/// are no farther than `tolerance`, or itself. Takes time linear in the points where few lie within the tolerance.
/// @param tolerance ≥ 0, m; 0: equal coordinates @pre the points are finite
std::vector<Index> representatives(std::span<const Vec3> points, double tolerance);

}  // namespace limber::internal
