/// @file contact_geometry.h
/// Axes of a contact, and how far bodies turn. Private to the constraints module.
#pragma once

#include "limber/constraints/constraint.h"

namespace limber {

/// A right-handed frame whose first axis is n; the same for the same n. @param n unit
inline Mat3 frame_along(const Vec3& n) {
  Index least = 0;
  n.cwiseAbs().minCoeff(&least);
  Mat3 axes;
  axes.col(0) = n;
  axes.col(1) = n.cross(Vec3::Unit(least)).normalized();
  axes.col(2) = n.cross(axes.col(1));
  return axes;
}

/// By how much a body turns in the step, world, rad, whole turns and all: what it turns by as it turns at the step's
/// end, and what is left from there to where it is. (From its orientations alone only the shortest turn could be told.)
inline Vec3 turn_of_step(const BodyStates& states, Index body, double step) {
  if (states.is_static(body)) return Vec3::Zero();
  const Vec3 turn = step * states.angular_velocity(body, StepTime::kEnd);
  const Quaternion turned = states.pose(body, StepTime::kEnd).q * states.pose(body, StepTime::kStart).q.conjugate();
  return turn + rotation_vector(turned * quaternion_from_rotation_vector(-turn));
}

}  // namespace limber
