#include "page_joints.h"

#include <cmath>
#include <string>

#include "limber/core/error.h"

namespace limber::internal {
namespace {

// A joint that is driven goes to its place within some tenths of a second, without swinging.
constexpr double kAngularFrequency = 50.0;  // rad/s, of what hangs on it on the drive's spring
constexpr double kDelay = 0.1;              // s, in which a third of the way is left

/// Numbers of bodies by name; −1: the world.
Index number_of(const std::string& name, const Scene& scene) {
  for (std::size_t i = 0; i < scene.bodies.size(); ++i)
    if (scene.bodies[i].name == name) return static_cast<Index>(i);
  return Linkage::kWorld;
}

Linkage linkage_of(const Scene& scene, const World& world, std::span<const PageBody> bodies) {
  Linkage linkage;
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const ModalModelData& data = world.model(bodies[i].id).data();
    const Vec3 centre = world.body(bodies[i].id).pose * data.center_of_mass;
    linkage.bodies.push_back({centre, data.mass, 0.5 * data.inertia.trace()});
  }
  for (const SceneJoint& joint : scene.joints)
    linkage.joints.push_back({number_of(joint.a, scene), number_of(joint.b, scene), joint.spec.frame.origin});
  for (std::size_t i = 0; i < scene.bodies.size(); ++i)
    if (world.body_type(bodies[i].id) != BodyType::kDynamic)
      linkage.joints.push_back({Linkage::kWorld, static_cast<Index>(i), linkage.bodies[i].centre});
  return linkage;
}

}  // namespace

PageJoints::PageJoints(const Scene& scene, const World& world, std::span<const PageBody> bodies,
                       std::span<const JointId> joints)
    : gravity_(scene.gravity.norm()) {
  const std::vector<JointLoad> loads = joint_loads(linkage_of(scene, world, bodies));
  for (std::size_t i = 0; i < scene.joints.size(); ++i) {
    const SceneJoint& told = scene.joints[i];
    const Index on = number_of(told.a.empty() ? told.b : told.a, scene);  // the world moves as part b's frame does
    const BodyId body = bodies[static_cast<std::size_t>(on)].id;
    const RigidTransform X = world.body(body).pose.inverse();
    joints_.push_back({.id = joints[i],
                       .on = body,
                       .origin = X * told.spec.frame.origin,
                       .axis = X.q * Vec3(told.spec.frame.axes.col(0)),
                       .type = told.spec.type,
                       .own = told.coordinates,
                       .load = loads[i]});
  }
}

void PageJoints::frames(const World& world, std::vector<double>& out) const {
  out.clear();
  for (const Joint& joint : joints_) {
    const RigidTransform X = world.body(joint.on).pose;
    const Vec3 origin = X * joint.origin, axis = X.q * joint.axis;
    for (const Vec3& v : {origin, axis}) out.insert(out.end(), v.begin(), v.end());
    const JointView view = world.joint(joint.id);
    out.insert(out.end(), view.position.begin(), view.position.end());
  }
}

JointActuation PageJoints::actuation(const Joint& joint, int coordinate, const CoordinateWish& wish) const {
  const auto i = static_cast<std::size_t>(coordinate);
  JointActuation acts = i < joint.own.size() ? joint.own[i] : JointActuation{};
  const bool angle = is_rotation(joint.type, coordinate);
  const double inertia = angle ? joint.load.inertia : joint.load.mass;
  if (std::isfinite(wish.place)) {
    acts.drive_target = wish.place;
    acts.drive_stiffness = inertia * kAngularFrequency * kAngularFrequency;
    acts.drive_damping = kDelay * acts.drive_stiffness;
  } else if (std::isfinite(wish.speed)) {
    const double weight = gravity_ * (angle ? joint.load.moment : joint.load.mass);
    acts.drive_stiffness = acts.drive_damping = 0.0;
    acts.motor_velocity = wish.speed;
    acts.motor_max_force = acts.friction + 2.0 * weight + inertia * std::abs(wish.speed) / kDelay;
  }
  return acts;
}

void PageJoints::wish(World& world, JointWishes& wishes, int joint, int coordinate, const CoordinateWish& wish) const {
  if (joint < 0 || static_cast<std::size_t>(joint) >= joints_.size())
    throw InvalidArgument("PageWorld: there is no joint " + std::to_string(joint));
  const Joint& driven = joints_[static_cast<std::size_t>(joint)];
  if (coordinate < 0 || coordinate >= freedoms(driven.type).count())
    throw InvalidArgument("PageWorld: joint " + std::to_string(joint) + " has no coordinate " +
                          std::to_string(coordinate));
  wishes.resize(joints_.size());
  wishes[static_cast<std::size_t>(joint)][static_cast<std::size_t>(coordinate)] = wish;
  world.set_joint_actuation(driven.id, coordinate, actuation(driven, coordinate, wish));
}

}  // namespace limber::internal
