#include "limber/core/quaternion.h"
#include "limber/machine/machine.h"
#include "objects.h"

namespace limber::c {

static HandleOptions to_cpp(const limber_handle_options& o) {
  if (o.directions < 0 || o.directions > 3)
    throw InvalidArgument("limber_handle_options: directions is " + std::to_string(o.directions) + ", expected 0 to 3");
  HandleOptions out{.directions = {}, .max_force = o.max_force, .stiffness = o.stiffness, .damping = o.damping};
  for (int i = 0; i < o.directions; ++i) out.directions.push_back(to_cpp(o.direction[i]));
  return out;
}

static JointSpec spec_of(const limber_joint_options& o) {
  const RigidTransform frame = to_cpp(o.frame);
  if (!(std::abs(frame.q.norm() - 1.0) <= 1e-6))
    throw InvalidArgument("limber_joint_options: the frame's quaternion has length " + std::to_string(frame.q.norm()) +
                          ", expected 1");
  return {.type = checked_enum<JointType>(o.type, 6, "joint type"),
          .frame = {.origin = frame.p, .axes = to_matrix(normalized(frame.q))},
          .limits = {.rotation = to_cpp(o.rotation),
                     .translation = {to_cpp(o.translation[0]), to_cpp(o.translation[1])},
                     .cone = o.cone,
                     .euler = {to_cpp(o.euler[0]), to_cpp(o.euler[1]), to_cpp(o.euler[2])}},
          .pitch = o.pitch};
}

static JointAttachment to_cpp(const limber_attachment& a) {
  JointAttachment out{.patch = {}, .radius = a.radius, .surface = to_cpp(a.surface)};
  for (const limber_surface_point& at : array(a.patch, a.patch_count, "patch")) out.patch.push_back(to_cpp(at));
  return out;
}

static JointActuation to_cpp(const limber_actuation& a) {
  return {.motor_velocity = a.motor_velocity,
          .motor_max_force = a.motor_max_force,
          .drive_target = a.drive_target,
          .drive_stiffness = a.drive_stiffness,
          .drive_damping = a.drive_damping,
          .friction = a.friction};
}

static limber_actuation to_c(const JointActuation& a) {
  return {a.motor_velocity, a.motor_max_force, a.drive_target, a.drive_stiffness, a.drive_damping, a.friction};
}

static limber_asset_joint to_c(const AssetJoint& joint) {
  const auto& [type, frame, limits, pitch] = joint.spec;
  limber_asset_joint out{};
  out.a = joint.a, out.b = joint.b;
  out.options = limber_default_joint_options();
  out.options.type = static_cast<limber_joint_type>(type);
  out.options.frame = to_c(RigidTransform{.q = quaternion_from_matrix(frame.axes), .p = frame.origin});
  out.options.rotation = to_c(limits.rotation), out.options.cone = limits.cone, out.options.pitch = pitch;
  for (std::size_t i = 0; i < 2; ++i) out.options.translation[i] = to_c(limits.translation[i]);
  for (std::size_t i = 0; i < 3; ++i) out.options.euler[i] = to_c(limits.euler[i]);
  out.options.on_a.radius = out.options.on_b.radius = joint.patch_radius;
  out.options.collide_connected = joint.collide;
  out.coordinates = freedoms(type).count();
  for (std::size_t c = 0; c < joint.coordinates.size(); ++c) out.actuation[c] = to_c(joint.coordinates[c]);
  return out;
}

static MachinePlacement to_cpp(const limber_machine_placement& p) {
  return {.pose = to_cpp(p.pose),
          .velocity = to_cpp(p.velocity),
          .angular_velocity = to_cpp(p.angular_velocity),
          .tied = p.tied,
          .filter = to_cpp(p.filter)};
}

static limber_joint_state to_c(const JointView& view) {
  limber_joint_state out{};
  out.coordinates = view.coordinates;
  std::ranges::copy(view.position, out.position);
  std::ranges::copy(view.force, out.force);
  out.lock_force = to_c(view.lock_force);
  out.distance_error = view.distance_error, out.angle_error = view.angle_error;
  return out;
}

static limber_constraint_report to_c(const ConstraintReport& r) {
  return {r.islands,
          r.bodies,
          r.rows,
          r.iterations,
          r.statuses[IslandStatus::kSolved],
          r.statuses[IslandStatus::kLimit],
          r.statuses[IslandStatus::kFailed],
          r.residual,
          r.solved,
          r.energy_removed};
}

static std::vector<BodyWish> wishes_of(std::span<const limber_point_direction> places, std::span<const double> wanted) {
  std::vector<BodyWish> out;
  for (std::size_t i = 0; i < places.size(); ++i)
    out.push_back({to_cpp(places[i].body), to_cpp(places[i].at), to_cpp(places[i].direction), wanted[i]});
  return out;
}

static std::vector<BodyForce> forces_of(std::span<const limber_point_direction> places) {
  std::vector<BodyForce> out;
  for (const limber_point_direction& place : places)
    out.push_back({to_cpp(place.body), to_cpp(place.at), to_cpp(place.direction)});
  return out;
}

}  // namespace limber::c

using namespace limber;
using namespace limber::c;

extern "C" {

limber_handle_options limber_default_handle_options(void) {
  const HandleOptions o{};
  return {{}, 0, o.max_force, o.stiffness, o.damping};
}

limber_result limber_world_add_handle(limber_world* world, limber_body_id id, limber_surface_point at,
                                      const limber_handle_options* options, limber_handle_id* handle) {
  return guarded([&] {
    limber_handle_id& out = required(handle, "handle");
    const limber_handle_options chosen = options != nullptr ? *options : limber_default_handle_options();
    out = to_c(world_of(world).add_handle(to_cpp(id), to_cpp(at), to_cpp(chosen)));
  });
}

limber_result limber_world_remove_handle(limber_world* world, limber_handle_id id) {
  return guarded([&] { world_of(world).remove_handle(to_cpp(id)); });
}

bool limber_world_contains_handle(const limber_world* world, limber_handle_id id) {
  return world != nullptr && world->world.contains(to_cpp(id));
}

limber_result limber_world_list_handles(const limber_world* world, limber_handle_id* ids, size_t capacity,
                                        size_t* count) {
  return guarded([&] {
    world_of(world).list(world->handles);
    answer(world->handles, ids, capacity, count, [](HandleId id) { return to_c(id); });
  });
}

limber_result limber_world_set_handle_target(limber_world* world, limber_handle_id id, limber_vec3 position,
                                             limber_vec3 velocity) {
  return guarded([&] {
    world_of(world).set_handle_target(to_cpp(id), {.position = to_cpp(position), .velocity = to_cpp(velocity)});
  });
}

limber_result limber_world_handle_state(const limber_world* world, limber_handle_id id, limber_handle_state* state) {
  return guarded([&] {
    const HandleView h = world_of(world).handle(to_cpp(id));
    required(state, "state") = {to_c(h.target.position), to_c(h.target.velocity), to_c(h.force), h.work, h.error};
  });
}

limber_result limber_world_set_handle_user_data(limber_world* world, limber_handle_id id, uint64_t data) {
  return guarded([&] { world_of(world).set_user_data(to_cpp(id), data); });
}

limber_result limber_world_handle_user_data(const limber_world* world, limber_handle_id id, uint64_t* data) {
  return guarded([&] { required(data, "data") = world_of(world).user_data(to_cpp(id)); });
}

limber_joint_options limber_default_joint_options(void) {
  const JointSpec spec{};
  const limber_interval open{spec.limits.rotation.low, spec.limits.rotation.high};
  limber_joint_options out{};
  out.type = LIMBER_JOINT_FIXED;
  out.frame = limber_identity();
  out.rotation = out.translation[0] = out.translation[1] = open;
  out.euler[0] = out.euler[1] = out.euler[2] = open;
  out.cone = spec.limits.cone;
  out.on_a.surface = out.on_b.surface = LIMBER_SURFACE_COLLISION;
  return out;
}

limber_result limber_world_add_joint(limber_world* world, limber_body_id a, limber_body_id b,
                                     const limber_joint_options* options, limber_joint_id* joint) {
  return guarded([&] {
    limber_joint_id& out = required(joint, "joint");
    const limber_joint_options chosen = options != nullptr ? *options : limber_default_joint_options();
    out = to_c(world_of(world).add_joint(to_cpp(a), to_cpp(b), spec_of(chosen), to_cpp(chosen.on_a),
                                         to_cpp(chosen.on_b), chosen.collide_connected));
  });
}

limber_result limber_world_remove_joint(limber_world* world, limber_joint_id id) {
  return guarded([&] { world_of(world).remove_joint(to_cpp(id)); });
}

bool limber_world_contains_joint(const limber_world* world, limber_joint_id id) {
  return world != nullptr && world->world.contains(to_cpp(id));
}

limber_result limber_world_list_joints(const limber_world* world, limber_joint_id* ids, size_t capacity,
                                       size_t* count) {
  return guarded([&] {
    world_of(world).list(world->joints);
    answer(world->joints, ids, capacity, count, [](JointId id) { return to_c(id); });
  });
}

limber_result limber_world_ignore_collision(limber_world* world, limber_body_id a, limber_body_id b, bool ignore) {
  return guarded([&] { world_of(world).ignore_collision(to_cpp(a), to_cpp(b), ignore); });
}

limber_result limber_world_set_joint_actuation(limber_world* world, limber_joint_id id, int coordinate,
                                               const limber_actuation* actuation) {
  return guarded(
      [&] { world_of(world).set_joint_actuation(to_cpp(id), coordinate, to_cpp(required(actuation, "actuation"))); });
}

limber_result limber_world_joint_state(const limber_world* world, limber_joint_id id, limber_joint_state* state) {
  return guarded([&] { required(state, "state") = to_c(world_of(world).joint(to_cpp(id))); });
}

limber_result limber_world_set_joint_strength(limber_world* world, limber_joint_id id, double newtons) {
  return guarded([&] { world_of(world).set_joint_strength(to_cpp(id), newtons); });
}

limber_result limber_world_joint_strength(const limber_world* world, limber_joint_id id, double* newtons) {
  return guarded([&] { required(newtons, "newtons") = world_of(world).joint_strength(to_cpp(id)); });
}

limber_result limber_world_joint_breaks(const limber_world* world, limber_joint_break* breaks, size_t capacity,
                                        size_t* count) {
  return guarded([&] {
    answer(world_of(world).joint_breaks(), breaks, capacity, count, [](const JointBreak& b) {
      return limber_joint_break{to_c(b.joint), to_c(b.a), to_c(b.b), b.user_data, to_c(b.force)};
    });
  });
}

limber_result limber_world_set_joint_user_data(limber_world* world, limber_joint_id id, uint64_t data) {
  return guarded([&] { world_of(world).set_user_data(to_cpp(id), data); });
}

limber_result limber_world_joint_user_data(const limber_world* world, limber_joint_id id, uint64_t* data) {
  return guarded([&] { required(data, "data") = world_of(world).user_data(to_cpp(id)); });
}

size_t limber_asset_joint_count(const limber_asset* asset) { return asset != nullptr ? asset->asset.joints.size() : 0; }

limber_result limber_asset_get_joint(const limber_asset* asset, size_t joint, limber_asset_joint* data) {
  return guarded([&] {
    const auto& joints = required(asset, "asset").asset.joints;
    if (joint >= joints.size())
      throw InvalidArgument("limber_asset_get_joint: joint " + std::to_string(joint) + " of an asset of " +
                            std::to_string(joints.size()));
    required(data, "data") = to_c(joints[joint]);
  });
}

limber_machine_placement limber_default_machine_placement(void) {
  const MachinePlacement start{};
  limber_machine_placement out{};
  out.pose = to_c(start.pose);
  out.tied = start.tied;
  out.filter = limber_default_filter();
  return out;
}

limber_result limber_world_add_machine(limber_world* world, const limber_asset* asset,
                                       const limber_machine_placement* placement, limber_body_id* bodies,
                                       limber_joint_id* joints) {
  return guarded([&] {
    const Asset& of = required(asset, "asset").asset;
    const auto bodies_out = array(bodies, of.bodies.size(), "bodies");
    const auto joints_out = array(joints, of.joints.size(), "joints");
    const limber_machine_placement start = placement != nullptr ? *placement : limber_default_machine_placement();
    const Machine machine = add_machine(world_of(world), of, to_cpp(start));
    for (std::size_t i = 0; i < machine.bodies.size(); ++i) bodies_out[i] = to_c(machine.bodies[i]);
    for (std::size_t i = 0; i < machine.joints.size(); ++i) joints_out[i] = to_c(machine.joints[i]);
  });
}

limber_result limber_world_constraint_report(const limber_world* world, limber_constraint_report* report) {
  return guarded([&] { required(report, "report") = to_c(world_of(world).constraint_report()); });
}

limber_result limber_world_manipulate(limber_world* world, limber_manipulation_level level,
                                      const limber_point_direction* wishes, const double* wanted, size_t wish_count,
                                      const limber_point_direction* forces, size_t force_count, int max_iterations,
                                      double* impulses, double* residual) {
  return guarded([&] {
    const std::size_t unknowns = force_count > 0 ? force_count : wish_count;
    const auto all_wishes = wishes_of(array(wishes, wish_count, "wishes"), array(wanted, wish_count, "wanted"));
    const auto all_forces = forces_of(array(forces, force_count, "forces"));
    const auto found = world_of(world).manipulate(all_wishes, all_forces, array(impulses, unknowns, "impulses"),
                                                  checked_enum<ManipulationLevel>(level, 4, "level"), max_iterations);
    if (residual != nullptr) *residual = found.residual;
  });
}

}  // extern "C"
