/// @file joint_loads.h
/// What hangs on the joints of linked bodies.
#pragma once

#include <array>
#include <vector>

#include "limber/core/types.h"

namespace limber::internal {

/// Bodies and joints as they stand, in any one frame.
struct Linkage {
  static constexpr Index kWorld = -1;
  struct Body {
    Vec3 centre = Vec3::Zero();  ///< of mass, m
    double mass = 0.0;           ///< kg
    double turning = 0.0;        ///< at least its moment of inertia about any axis through the centre, kg·m²
  };
  struct Joint {
    Index a = kWorld, b = 0;  ///< a may be the world
    Vec3 origin = Vec3::Zero();
  };
  std::vector<Body> bodies{};
  std::vector<Joint> joints{};
};

/// Upper bounds over all poses of the links, which may stretch out.
struct JointLoad {
  double mass = 0.0;     ///< kg
  double moment = 0.0;   ///< Σ mass × distance from the joint, kg·m
  double inertia = 0.0;  ///< about the joint, kg·m²
  bool held = false;     ///< by the world: the other side of the joint, or both in a closed chain; else it is free
};

/// One per joint. On a joint hangs the side of it that nothing else ties to the world; the heavier side where both are
/// tied, the lighter one where none is.
std::vector<JointLoad> joint_loads(const Linkage& linkage);

}  // namespace limber::internal
