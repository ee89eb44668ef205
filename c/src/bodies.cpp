#include "limber/collision/rigid_model.h"
#include "objects.h"

namespace limber::c {

static std::optional<double> friction_of(const limber_placement& p) {
  return p.friction < 0.0 ? std::nullopt : std::optional(p.friction);
}

static AxisLocks locks_of(const bool* translation, const bool* rotation) {
  AxisLocks out;
  std::copy_n(translation, 3, out.translation.begin());
  std::copy_n(rotation, 3, out.rotation.begin());
  return out;
}

static FrameSettings to_cpp(const limber_frame_settings& s) {
  return {.gravity_scale = s.gravity_scale,
          .linear_damping = s.linear_damping,
          .angular_damping = s.angular_damping,
          .locks = locks_of(s.lock_translation, s.lock_rotation)};
}

static limber_frame_settings to_c(const FrameSettings& s) {
  limber_frame_settings out{s.gravity_scale, s.linear_damping, s.angular_damping, {}, {}};
  std::ranges::copy(s.locks.translation, out.lock_translation);
  std::ranges::copy(s.locks.rotation, out.lock_rotation);
  return out;
}

static BodyPlacement to_cpp(const limber_placement& p) {
  return {.pose = to_cpp(p.pose),
          .velocity = to_cpp(p.velocity),
          .angular_velocity = to_cpp(p.angular_velocity),
          .filter = to_cpp(p.filter),
          .friction = friction_of(p),
          .restitution = p.restitution,
          .shape = p.shape != nullptr ? p.shape->shape : nullptr,
          .user_data = p.user_data,
          .frame = to_cpp(p.frame),
          .modal_skin = p.modal_skin,
          .inertial_coupling = p.inertial_coupling};
}

static MassProperties to_cpp(const limber_mass_properties& m) {
  return {m.mass, to_cpp(m.center_of_mass), Eigen::Map<const Mat3>(m.inertia)};
}

static limber_placement given(const limber_placement* placement) {
  return placement != nullptr ? *placement : limber_default_placement();
}

static const std::shared_ptr<const ModalModel>& model_of(const limber_asset* asset, std::size_t body) {
  const auto& bodies = required(asset, "asset").asset.bodies;
  if (body >= bodies.size())
    throw InvalidArgument("limber_world_add_body: body " + std::to_string(body) + " of an asset of " +
                          std::to_string(bodies.size()));
  return bodies[body];
}

}  // namespace limber::c

using namespace limber;
using namespace limber::c;

extern "C" {

limber_filter limber_default_filter(void) {
  const CollisionFilter all{};
  return {all.layers, all.mask, all.self};
}

limber_frame_settings limber_default_frame_settings(void) { return to_c(FrameSettings{}); }

limber_placement limber_default_placement(void) {
  const BodyPlacement start{};
  limber_placement out{};
  out.pose = to_c(start.pose);
  out.filter = limber_default_filter();
  out.friction = -1.0;
  out.frame = to_c(start.frame);
  out.modal_skin = start.modal_skin;
  out.inertial_coupling = start.inertial_coupling;
  return out;
}

limber_result limber_world_add_body(limber_world* world, const limber_asset* asset, size_t body,
                                    const limber_placement* placement, limber_body_id* id) {
  return guarded([&] {
    limber_body_id& out = required(id, "id");
    out = to_c(world_of(world).add_body(model_of(asset, body), to_cpp(given(placement))));
  });
}

limber_result limber_world_add_rigid(limber_world* world, const limber_shape* shape, double density,
                                     const limber_placement* placement, limber_body_id* id) {
  return guarded([&] {
    limber_body_id& out = required(id, "id");
    out = to_c(world_of(world).add_rigid(shape_of(shape), density, to_cpp(given(placement))));
  });
}

limber_result limber_world_add_rigid_with_mass(limber_world* world, const limber_shape* shape,
                                               const limber_mass_properties* mass, const limber_placement* placement,
                                               limber_body_id* id) {
  return guarded([&] {
    limber_body_id& out = required(id, "id");
    const MassProperties properties = to_cpp(required(mass, "mass"));
    out = to_c(world_of(world).add_rigid(shape_of(shape), properties, to_cpp(given(placement))));
  });
}

limber_result limber_world_add_compound(limber_world* world, const limber_shape_part* parts, size_t count,
                                        double density, const limber_placement* placement, limber_body_id* id) {
  return guarded([&] {
    limber_body_id& out = required(id, "id");
    out = to_c(world_of(world).add_rigid(parts_of(parts, count), density, to_cpp(given(placement))));
  });
}

limber_result limber_world_add_compound_with_mass(limber_world* world, const limber_shape_part* parts, size_t count,
                                                  const limber_mass_properties* mass, const limber_placement* placement,
                                                  limber_body_id* id) {
  return guarded([&] {
    limber_body_id& out = required(id, "id");
    const MassProperties properties = to_cpp(required(mass, "mass"));
    out = to_c(world_of(world).add_rigid(parts_of(parts, count), properties, to_cpp(given(placement))));
  });
}

limber_result limber_world_add_kinematic(limber_world* world, const limber_shape* shape,
                                         const limber_placement* placement, limber_body_id* id) {
  return guarded([&] {
    limber_body_id& out = required(id, "id");
    out = to_c(world_of(world).add_kinematic(shape_of(shape), to_cpp(given(placement))));
  });
}

limber_result limber_world_add_kinematic_compound(limber_world* world, const limber_shape_part* parts, size_t count,
                                                  const limber_placement* placement, limber_body_id* id) {
  return guarded([&] {
    limber_body_id& out = required(id, "id");
    out = to_c(world_of(world).add_kinematic(parts_of(parts, count), to_cpp(given(placement))));
  });
}

limber_result limber_world_add_static(limber_world* world, const limber_shape* shape, const limber_placement* placement,
                                      limber_body_id* id) {
  return guarded([&] {
    limber_body_id& out = required(id, "id");
    const limber_placement p = given(placement);
    out = to_c(world_of(world).add_static(shape_of(shape), to_cpp(p.pose), to_cpp(p.filter), friction_of(p)));
  });
}

limber_result limber_world_remove_body(limber_world* world, limber_body_id id) {
  return guarded([&] { world_of(world).remove_body(to_cpp(id)); });
}

bool limber_world_contains_body(const limber_world* world, limber_body_id id) {
  return world != nullptr && world->world.contains(to_cpp(id));
}

size_t limber_world_body_count(const limber_world* world) { return world != nullptr ? world->world.body_count() : 0; }

limber_result limber_world_list_bodies(const limber_world* world, limber_body_id* ids, size_t capacity, size_t* count) {
  return guarded([&] {
    world_of(world).list(world->bodies);
    answer(world->bodies, ids, capacity, count, [](BodyId id) { return to_c(id); });
  });
}

limber_body_id limber_world_body_at(const limber_world* world, uint32_t index) {
  const bool may_be = world != nullptr && index <= static_cast<std::uint32_t>(std::numeric_limits<Index>::max());
  return may_be ? to_c(world->world.id_of(static_cast<Index>(index))) : limber_body_id{};
}

limber_result limber_world_set_body_user_data(limber_world* world, limber_body_id id, uint64_t data) {
  return guarded([&] { world_of(world).set_user_data(to_cpp(id), data); });
}

limber_result limber_world_body_user_data(const limber_world* world, limber_body_id id, uint64_t* data) {
  return guarded([&] { required(data, "data") = world_of(world).user_data(to_cpp(id)); });
}

limber_result limber_world_body_model(const limber_world* world, limber_body_id id, const limber_model** model) {
  return guarded([&] { required(model, "model") = to_c(world_of(world).model(to_cpp(id))); });
}

limber_result limber_world_body_type(const limber_world* world, limber_body_id id, limber_body_type* type) {
  return guarded(
      [&] { required(type, "type") = static_cast<limber_body_type>(world_of(world).body_type(to_cpp(id))); });
}

limber_result limber_world_set_gravity_scale(limber_world* world, limber_body_id id, double scale) {
  return guarded([&] { world_of(world).set_gravity_scale(to_cpp(id), scale); });
}

limber_result limber_world_set_damping(limber_world* world, limber_body_id id, double linear, double angular) {
  return guarded([&] { world_of(world).set_damping(to_cpp(id), linear, angular); });
}

limber_result limber_world_set_locks(limber_world* world, limber_body_id id, const bool translation[3],
                                     const bool rotation[3]) {
  return guarded([&] {
    world_of(world).set_locks(to_cpp(id),
                              locks_of(&required(translation, "translation"), &required(rotation, "rotation")));
  });
}

limber_result limber_world_frame_settings(const limber_world* world, limber_body_id id,
                                          limber_frame_settings* settings) {
  return guarded([&] { required(settings, "settings") = to_c(world_of(world).frame_settings(to_cpp(id))); });
}

limber_result limber_world_is_asleep(const limber_world* world, limber_body_id id, bool* asleep) {
  return guarded([&] { required(asleep, "asleep") = world_of(world).is_asleep(to_cpp(id)); });
}

limber_result limber_world_wake(limber_world* world, limber_body_id id) {
  return guarded([&] { world_of(world).wake(to_cpp(id)); });
}

limber_result limber_world_apply_force(limber_world* world, limber_body_id id, limber_surface_point at,
                                       limber_vec3 force, limber_axes axes) {
  return guarded([&] { world_of(world).apply_force(to_cpp(id), to_cpp(at), to_cpp(force), to_cpp(axes)); });
}

limber_result limber_world_apply_impulse(limber_world* world, limber_body_id id, limber_surface_point at,
                                         limber_vec3 impulse, limber_axes axes, double delay) {
  return guarded([&] { world_of(world).apply_impulse(to_cpp(id), to_cpp(at), to_cpp(impulse), to_cpp(axes), delay); });
}

limber_result limber_world_set_kinematic_frame(limber_world* world, limber_body_id id,
                                               const limber_kinematic_frame* target) {
  return guarded([&] {
    const limber_kinematic_frame& t = required(target, "target");
    world_of(world).set_kinematic_frame(to_cpp(id), {.pose = to_cpp(t.pose),
                                                     .velocity = to_cpp(t.velocity),
                                                     .acceleration = to_cpp(t.acceleration),
                                                     .angular_velocity = to_cpp(t.angular_velocity),
                                                     .angular_acceleration = to_cpp(t.angular_acceleration)});
  });
}

limber_result limber_world_body_state(const limber_world* world, limber_body_id id, limber_body_state* state) {
  return guarded([&] {
    const BodyView b = world_of(world).body(to_cpp(id));
    required(state, "state") = {to_c(b.pose),        to_c(b.velocity), to_c(b.angular_velocity),
                                b.amplitudes.data(), b.rates.data(),   static_cast<std::int32_t>(b.amplitudes.size())};
  });
}

limber_result limber_world_set_pose(limber_world* world, limber_body_id id, limber_transform pose) {
  return guarded([&] { world_of(world).set_pose(to_cpp(id), to_cpp(pose)); });
}

limber_result limber_world_set_velocity(limber_world* world, limber_body_id id, limber_vec3 velocity,
                                        limber_vec3 angular_velocity) {
  return guarded([&] { world_of(world).set_velocity(to_cpp(id), to_cpp(velocity), to_cpp(angular_velocity)); });
}

limber_result limber_world_set_amplitudes(limber_world* world, limber_body_id id, const double* amplitudes,
                                          const double* rates, int32_t modes) {
  return guarded([&] {
    if (modes < 0) throw InvalidArgument("limber_world_set_amplitudes: modes is " + std::to_string(modes));
    const auto k = static_cast<std::size_t>(modes);
    world_of(world).set_amplitudes(to_cpp(id), array(amplitudes, k, "amplitudes"), array(rates, k, "rates"));
  });
}

limber_result limber_world_set_node_displacements(limber_world* world, limber_body_id id, const double* displacements,
                                                  const double* velocities, size_t numbers) {
  return guarded([&] {
    world_of(world).set_node_displacements(to_cpp(id), array(displacements, numbers, "displacements"),
                                           array(velocities, numbers, "velocities"));
  });
}

limber_result limber_world_energy(const limber_world* world, limber_body_id id, limber_energy* energy) {
  return guarded([&] {
    const BodyEnergy e = world_of(world).energy(to_cpp(id));
    required(energy, "energy") = {e.kinetic_rigid, e.potential, e.kinetic_modal, e.elastic};
  });
}

limber_result limber_world_linear_momentum(const limber_world* world, limber_body_id id, limber_vec3* momentum) {
  return guarded([&] { required(momentum, "momentum") = to_c(world_of(world).linear_momentum(to_cpp(id))); });
}

limber_result limber_world_angular_momentum(const limber_world* world, limber_body_id id, limber_vec3* momentum) {
  return guarded([&] { required(momentum, "momentum") = to_c(world_of(world).angular_momentum(to_cpp(id))); });
}

limber_result limber_world_point_position(const limber_world* world, limber_body_id id, limber_surface_point at,
                                          limber_vec3* position) {
  return guarded([&] { required(position, "position") = to_c(world_of(world).position(to_cpp(id), to_cpp(at))); });
}

limber_result limber_world_point_velocity(const limber_world* world, limber_body_id id, limber_surface_point at,
                                          limber_vec3* velocity) {
  return guarded([&] { required(velocity, "velocity") = to_c(world_of(world).velocity(to_cpp(id), to_cpp(at))); });
}

limber_result limber_world_point_indentation(const limber_world* world, limber_body_id id, limber_surface_point at,
                                             limber_vec3* displacement) {
  return guarded(
      [&] { required(displacement, "displacement") = to_c(world_of(world).indentation(to_cpp(id), to_cpp(at))); });
}

}  // extern "C"
