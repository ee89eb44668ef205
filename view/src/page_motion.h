/// @file page_motion.h
/// How bodies move, to be taken from one world to another with bodies of other stiffness.
#pragma once

#include <span>
#include <vector>

#include "description.h"
#include "limber/engine/world.h"

namespace limber::internal {

struct BodyMotion {
  RigidTransform pose{};
  Vec3 velocity = Vec3::Zero(), angular_velocity = Vec3::Zero();
  std::vector<double> amplitudes{}, rates{};
};

std::vector<BodyMotion> motions(const World& world, std::span<const PageBody> bodies);
/// A body that has another number of modes stays straight.
void set_motions(std::span<const BodyMotion> motions, std::span<const PageBody> bodies, World& world);

}  // namespace limber::internal
