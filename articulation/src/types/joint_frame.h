/// @file joint_frame.h
/// The frame that a joint gets from its axis and contact points. Private to the articulation module.
#pragma once

#include <span>

#include "limber/model/joint_spec.h"

namespace limber::internal {

/// As documented at DetectedJoint. @param axis unit; without meaning for ball and fixed @param origin a point of the
/// axis or the centre @pre points is not empty
JointFrame joint_frame(JointType type, const Vec3& axis, const Vec3& origin, std::span<const Vec3> points);

}  // namespace limber::internal
