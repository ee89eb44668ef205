/// @file cut_part.h
/// A part cut in two, with a joint between: a virtual joint [X09 4.4].
#pragma once

#include <span>

#include "limber/posing/jointed_model.h"
#include "limber/view/page_pose.h"

namespace limber::internal {

/// Edges that cross the plane through the eye and the stroke's ends, between the lines of sight to these, are cut, and
/// triangles beside them are split. What lies on the side of the plane with less of the part's area becomes the last
/// part, shells that the cut does not meet too; on a ball in the middle of the cut whose first axis points to its
/// middle. @param posed the model's vertices as they are seen
/// @throws InvalidArgument where the stroke does not go right across
JointedModel cut_part(const JointedModel& model, Index part, const PoseStroke& stroke, std::span<const Vec3> posed);

}  // namespace limber::internal
