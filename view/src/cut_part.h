/// @file cut_part.h
/// A part cut in two, with a joint between: a virtual joint [X09 4.4].
#pragma once

#include <span>

#include "limber/posing/jointed_model.h"
#include "limber/view/page_pose.h"

namespace limber::internal {

/// Edges that cross the plane through the eye and the stroke's ends, between the lines of sight to these, are cut, and
/// triangles beside them are split. All pieces at the cut but the largest become the last part, on a ball in the middle
/// of the cut whose first axis points to their middle. @param posed the model's vertices as they are seen
/// @throws InvalidArgument where the stroke does not go right across
JointedModel cut_part(const JointedModel& model, Index part, const PoseStroke& stroke, std::span<const Vec3> posed);

}  // namespace limber::internal
