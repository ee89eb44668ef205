#include "objects.h"

namespace limber::c {

static std::size_t drawn_numbers(const World& world, BodyId id) {
  return 3 * static_cast<std::size_t>(world.model(id).render().vertices());
}

static std::span<float> per_mode(const World& world, BodyId id, float* numbers, const char* name) {
  return array(numbers, static_cast<std::size_t>(world.model(id).modes()), name);
}

static DrawTarget to_cpp(const World& world, const limber_draw_target& target) {
  const BodyId id = to_cpp(target.id);
  const std::size_t numbers = drawn_numbers(world, id);
  return {.id = id,
          .positions = array(target.positions, numbers, "positions"),
          .normals = target.normals != nullptr ? std::span(target.normals, numbers) : std::span<float>{},
          .tolerance = target.tolerance};
}

}  // namespace limber::c

using namespace limber;
using namespace limber::c;

extern "C" {

limber_result limber_world_reconstruct_all(const limber_world* world, const limber_draw_target* targets, size_t count,
                                           double interpolation, limber_vec3 origin) {
  return guarded([&] {
    const World& w = world_of(world);
    world->targets.clear();
    for (const limber_draw_target& target : array(targets, count, "targets"))
      world->targets.push_back(to_cpp(w, target));
    w.reconstruct(world->targets, interpolation, to_cpp(origin));
  });
}

limber_result limber_world_reconstruct(const limber_world* world, limber_body_id id, float* positions, float* normals,
                                       double interpolation) {
  const limber_draw_target target{id, positions, normals, 0.0};
  return limber_world_reconstruct_all(world, &target, 1, interpolation, limber_vec3{});
}

limber_result limber_world_interpolated_poses(const limber_world* world, const limber_body_id* ids, size_t count,
                                              double interpolation, limber_transform* poses) {
  return guarded([&] {
    const World& w = world_of(world);
    const auto bodies = array(ids, count, "ids");
    const auto into = array(poses, count, "poses");
    // Whatever fails does so before anything is written.
    for (const limber_body_id id : bodies) w.interpolated_pose(to_cpp(id), interpolation);
    for (std::size_t i = 0; i < count; ++i) into[i] = to_c(w.interpolated_pose(to_cpp(bodies[i]), interpolation));
  });
}

limber_result limber_world_interpolated_amplitudes(const limber_world* world, limber_body_id id, double interpolation,
                                                   float* amplitudes) {
  return guarded([&] {
    const World& w = world_of(world);
    w.interpolated_amplitudes(to_cpp(id), interpolation, per_mode(w, to_cpp(id), amplitudes, "amplitudes"));
  });
}

limber_result limber_world_interpolated_weights(const limber_world* world, limber_body_id id, double interpolation,
                                                float* weights) {
  return guarded([&] {
    const World& w = world_of(world);
    w.interpolated_weights(to_cpp(id), interpolation, per_mode(w, to_cpp(id), weights, "weights"));
  });
}

limber_result limber_world_has_modal_skin(const limber_world* world, limber_body_id id, bool* has) {
  return guarded([&] { required(has, "has") = world_of(world).has_modal_skin(to_cpp(id)); });
}

}  // extern "C"
