/// @file frame_movement.h
/// Pose of a moved frame at a time: the motions of scene_file.h as functions of time.
#pragma once

#include "limber/scene/scene_file.h"

namespace limber::internal {

struct FrameState {
  RigidTransform pose;
  Vec3 velocity = Vec3::Zero();          ///< world, m/s
  Vec3 angular_velocity = Vec3::Zero();  ///< world, rad/s
};

/// @param start the body's pose at t = 0, where the movement does not say otherwise @param t s, ≥ 0
FrameState frame_at(const FrameMovement& movement, const RigidTransform& start, double t);

/// Motion of the frame in the step from t to t + h: its state at the end, and the mean accelerations, which carry the
/// whole change of velocity also where it jumps.
KinematicFrame frame_over_step(const FrameMovement& movement, const RigidTransform& start, double t, double h);

}  // namespace limber::internal
