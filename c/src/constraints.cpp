#include "limber/core/quaternion.h"
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
