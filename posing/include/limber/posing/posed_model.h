/// @file limber/posing/posed_model.h
/// A pose as a model of its own: the rest shape for what comes after, such as bodies that are baked and joined
/// (limber-precompute --joints takes the files of it).
#pragma once

#include "limber/posing/posing_session.h"

namespace limber {

/// The surface as it is posed, the same parts, and the joints where they now stand: their coordinates are 0 there, and
/// limits count from there. Influence regions are left out.
/// @param warnings where a ball has turned: its limits, told of a frame that both parts share at rest, cannot be told
/// from a turned one and are left open
JointedModel posed_model(const PosingSession& session, Warnings& warnings);

/// The joints file of a model whose surface is written as its triangles stand (obj_text()).
JointsFile joints_file(const JointedModel& model);

}  // namespace limber
