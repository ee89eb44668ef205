/// @file limber/machine/machine.h
/// A machine: an asset whose bodies are joined, as limber-precompute bakes it from an assembly (limber/model/asset.h).
///
///   const Asset lamp = read_asset("lamp.glb");
///   const Machine on_desk = add_machine(world, lamp, {.p = {0, 0, 0.7}});
///   world.set_joint_actuation(on_desk.joints[2], 0, {.motor_velocity = 1.0, .motor_max_force = 0.5});
///
/// Scene files place machines by their key `machines` (docs/formats/scene.md).
#pragma once

#include <vector>

#include "limber/engine/world.h"
#include "limber/model/asset.h"

namespace limber {

/// Start of a machine.
struct MachinePlacement {
  RigidTransform pose{};                 ///< of the input's coordinate system, in the world
  Vec3 velocity = Vec3::Zero();          ///< of that system's origin, m/s; bodies move with it as one rigid thing
  Vec3 angular_velocity = Vec3::Zero();  ///< world, rad/s
  bool tied = true;                      ///< by its joints to the world; false: these are left out, and it is free
  CollisionFilter filter{};              ///< of all its bodies
};

/// Bodies and joints of a machine in a world.
struct Machine {
  std::vector<BodyId> bodies{};   ///< per Asset::bodies
  std::vector<JointId> joints{};  ///< per Asset::joints; JointId{} for those to the world where it is not tied
};

/// Place and motion of a body of an asset.
BodyPlacement placement_in_machine(const ModalModel& model, const MachinePlacement& placement);

/// Adds all bodies as they stand to each other in the asset, its joints with their motors, drives and friction, and its
/// pairs without contacts.
/// @throws InvalidArgument as World::add_body() and add_joint(); none of the machine's bodies is in the world then
Machine add_machine(World& world, const Asset& asset, const MachinePlacement& placement = {});

}  // namespace limber
