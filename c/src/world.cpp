#include "objects.h"

namespace limber::c {

static WorldOptions to_cpp(const limber_world_options& o) {
  return {.step = o.step,
          .substeps = o.substeps,
          .gravity = to_cpp(o.gravity),
          .max_steps_per_advance = o.max_steps_per_advance,
          .sleep = {.enabled = o.sleep, .time = o.sleep_time, .speed = o.sleep_speed},
          .half_precision = o.half_precision,
          .hit_speed = o.hit_speed};
}

static limber_world_options to_c(const WorldOptions& o, const limber_jobs& jobs) {
  return {o.step,          o.substeps,   to_c(o.gravity), o.max_steps_per_advance,
          o.sleep.enabled, o.sleep.time, o.sleep.speed,   o.half_precision,
          o.hit_speed,     jobs};
}

static limber_stage_times to_c(const StageTimes& times) {
  static_assert(kStages == LIMBER_STAGES);
  limber_stage_times out{};
  for (std::size_t i = 0; i < kStages; ++i) {
    const StageTime& stage = times[static_cast<Stage>(i)];
    out.seconds[i] = stage.seconds, out.units[i] = stage.units;
  }
  return out;
}

}  // namespace limber::c

using namespace limber;
using namespace limber::c;

extern "C" {

limber_world_options limber_default_world_options(void) { return to_c(WorldOptions{}, limber_jobs{}); }

limber_result limber_world_create(const limber_world_options* options, limber_world** world) {
  return guarded([&] {
    limber_world*& place = required(world, "world");
    const limber_world_options chosen = options != nullptr ? *options : limber_default_world_options();
    place = new limber_world(to_cpp(chosen), chosen.jobs);
  });
}

void limber_world_destroy(limber_world* world) { delete world; }

limber_result limber_world_get_options(const limber_world* world, limber_world_options* options) {
  return guarded([&] {
    const WorldOptions& now = world_of(world).options();
    required(options, "options") = to_c(now, world->jobs.lent());
  });
}

limber_result limber_world_step(limber_world* world, int steps) {
  return guarded([&] {
    World& w = world_of(world);
    if (steps < 0) throw InvalidArgument("limber_world_step: " + std::to_string(steps) + " steps, expected at least 0");
    for (int i = 0; i < steps; ++i) w.step();
  });
}

limber_result limber_world_advance(limber_world* world, double seconds, int* steps) {
  return guarded([&] {
    const int taken = world_of(world).advance(seconds);
    if (steps != nullptr) *steps = taken;
  });
}

limber_result limber_world_set_step(limber_world* world, double seconds) {
  return guarded([&] { world_of(world).set_step(seconds); });
}

limber_result limber_world_set_gravity(limber_world* world, limber_vec3 gravity) {
  return guarded([&] { world_of(world).set_gravity(to_cpp(gravity)); });
}

double limber_world_interpolation_factor(const limber_world* world) {
  return world != nullptr ? world->world.interpolation_factor() : 0.0;
}

double limber_world_time(const limber_world* world) { return world != nullptr ? world->world.time() : 0.0; }

uint64_t limber_world_step_count(const limber_world* world) { return world != nullptr ? world->world.step_count() : 0; }

double limber_world_dropped_seconds(const limber_world* world) {
  return world != nullptr ? world->world.dropped_seconds() : 0.0;
}

uint64_t limber_world_state_hash(const limber_world* world) { return world != nullptr ? world->world.state_hash() : 0; }

limber_result limber_snapshot_create(limber_snapshot** snapshot) {
  return guarded([&] { required(snapshot, "snapshot") = new limber_snapshot; });
}

void limber_snapshot_destroy(limber_snapshot* snapshot) { delete snapshot; }

const void* limber_snapshot_bytes(const limber_snapshot* snapshot, size_t* size) {
  const bool holds = snapshot != nullptr && !snapshot->bytes.empty();
  if (size != nullptr) *size = holds ? snapshot->bytes.size() : 0;
  return holds ? snapshot->bytes.data() : nullptr;
}

limber_result limber_world_save_state(const limber_world* world, limber_snapshot* snapshot) {
  return guarded([&] { world_of(world).save_state(required(snapshot, "snapshot").bytes); });
}

limber_result limber_world_restore_state(limber_world* world, const void* bytes, size_t size) {
  return guarded([&] { world_of(world).restore_state(array(static_cast<const std::byte*>(bytes), size, "bytes")); });
}

limber_result limber_world_set_stage_times(limber_world* world, bool on) {
  return guarded([&] {
    World& w = world_of(world);
    world->times = {};
    w.set_stage_times(on ? &world->times : nullptr);
  });
}

limber_result limber_world_get_stage_times(const limber_world* world, limber_stage_times* times) {
  return guarded([&] { required(times, "times") = to_c(required(world, "world").times); });
}

const char* limber_stage_name(int stage) {
  return stage >= 0 && stage < LIMBER_STAGES ? to_string(static_cast<Stage>(stage)).data() : nullptr;
}

}  // extern "C"
