#include "limber/machine/machine.h"

namespace limber {
namespace {

void join(World& world, const Asset& asset, const MachinePlacement& placement, Machine& machine) {
  const auto body = [&](Index i) {
    return i == AssetJoint::kWorld ? BodyId{} : machine.bodies[static_cast<std::size_t>(i)];
  };
  for (const AssetJoint& joint : asset.joints) {
    machine.joints.emplace_back();
    if (joint.a == AssetJoint::kWorld && !placement.tied) continue;
    const JointAttachment patch{.radius = joint.patch_radius};
    machine.joints.back() =
        world.add_joint(body(joint.a), body(joint.b), joint.spec.moved_by(placement.pose), patch, patch, joint.collide);
    for (std::size_t c = 0; c < joint.coordinates.size(); ++c)
      world.set_joint_actuation(machine.joints.back(), static_cast<int>(c), joint.coordinates[c]);
  }
  for (const auto& [a, b] : asset.apart) world.ignore_collision(body(a), body(b), true);
}

}  // namespace

BodyPlacement placement_in_machine(const ModalModel& model, const MachinePlacement& placement) {
  const Vec3 arm = placement.pose.q * model.data().origin_in_input;
  BodyPlacement out{.pose = {placement.pose.q, placement.pose.p + arm},
                    .velocity = placement.velocity + placement.angular_velocity.cross(arm),
                    .angular_velocity = placement.angular_velocity};
  out.filter = placement.filter;
  return out;
}

Machine add_machine(World& world, const Asset& asset, const MachinePlacement& placement) {
  Machine machine;
  try {
    for (const auto& model : asset.bodies)
      machine.bodies.push_back(world.add_body(model, placement_in_machine(*model, placement)));
    join(world, asset, placement, machine);
  } catch (...) {
    for (const BodyId id : machine.bodies) world.remove_body(id);
    throw;
  }
  return machine;
}

}  // namespace limber
