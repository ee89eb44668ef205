/// @file joint_coordinates.h
/// Coordinates of joints, as limber/constraints/joint_constraint.h numbers them.
#pragma once

#include "limber/model/joint_spec.h"

namespace limber::internal {

inline int coordinates(JointType type) { return freedoms(type).rotations + freedoms(type).translations; }

/// Whether a coordinate is an angle: rotations come first, but for planar joints.
inline bool turns(JointType type, int coordinate) {
  return type == JointType::kPlanar ? coordinate == 2 : coordinate < freedoms(type).rotations;
}

}  // namespace limber::internal
