// What a scene adds to the C interface, in its way: what scene.js calls, beside limber's own functions. Lists are left
// as the scene's answer until the next call.
#include <emscripten.h>

#include "limber/view/live_scene.h"
#include "objects.h"

using limber::Vec3;
using limber::c::guarded;
using limber::c::required;

struct limber_scene {
  explicit limber_scene(const char* path) : live(path) {}

  limber::LiveScene live;
  limber::LiveSettings settings;        // that it begins with
  std::unique_ptr<limber_world> world;  // is gone before the scene, which finds its contacts
  std::string text;
  std::vector<double> numbers;
  std::vector<std::uint32_t> ids;
  struct {
    const void* data = nullptr;
    std::uint32_t count = 0;
  } answer;

  template <class Items>
  void say(const Items& items) {
    answer = {std::data(items), static_cast<std::uint32_t>(std::size(items))};
  }
};

namespace {

/// From 10 numbers: gravity, step, substeps, modes, damping, friction, solver, joint_friction; then stiffness.
limber::LiveSettings settings_of(const double* n, std::size_t count) {
  constexpr std::size_t kFirst = 10;
  return {.gravity = {n[0], n[1], n[2]},
          .step = n[3],
          .substeps = static_cast<int>(n[4]),
          .modes = static_cast<limber::Index>(n[5]),
          .damping = n[6],
          .friction = n[7],
          .solver = limber::c::checked_enum<limber::ContactSolver>(static_cast<int>(n[8]), 2, "solver"),
          .joint_friction = n[9],
          .stiffness = {n + kFirst, n + count}};
}

void say_sound(limber_scene& scene, const limber::SoundingBody& body, int what) {
  const std::vector<double>* numbers[] = {&body.modes().eigenvalues, &body.modes().decays};
  if (what < 2)
    scene.say(*numbers[what]);
  else if (what == 2)
    scene.say(body.gains());
  else
    scene.say(body.modes().shapes);
}

}  // namespace

extern "C" {

EMSCRIPTEN_KEEPALIVE limber_result scene_open(const char* path, limber_scene** scene) {
  return guarded([&] { *scene = new limber_scene(path); });
}
EMSCRIPTEN_KEEPALIVE void scene_destroy(limber_scene* scene) { delete scene; }
EMSCRIPTEN_KEEPALIVE const void* scene_answer(const limber_scene* scene) { return &scene->answer; }

EMSCRIPTEN_KEEPALIVE limber_result scene_description(limber_scene* scene) {
  return guarded([&] { scene->say(scene->text = scene->live.description()); });
}
EMSCRIPTEN_KEEPALIVE const limber_model* scene_model(const limber_scene* scene, std::size_t model) {
  return limber::c::to_c(*scene->live.models()[model]);
}

EMSCRIPTEN_KEEPALIVE limber_result scene_set(limber_scene* scene, const double* numbers, std::size_t count) {
  return guarded([&] {
    limber::LiveSettings settings = settings_of(numbers, count);
    settings.validate();
    scene->settings = std::move(settings);
  });
}
/// The world of before is gone, whatever comes of this. @param world out: the scene's
EMSCRIPTEN_KEEPALIVE limber_result scene_begin(limber_scene* scene, limber_world** world) {
  return guarded([&] {
    scene->world.reset();
    scene->live.prepare(scene->settings);
    auto made = std::make_unique<limber_world>(scene->live.world_options(), limber_jobs{});
    scene->live.begin(made->world);
    scene->world = std::move(made);
    *world = scene->world.get();
  });
}
// Index and generation of each: 0 bodies, 1 statics, 2 sensors, 3 joints.
EMSCRIPTEN_KEEPALIVE limber_result scene_ids(limber_scene* scene, int what) {
  return guarded([&] {
    scene->ids.clear();
    const auto add = [&](const auto& id) { scene->ids.insert(scene->ids.end(), {id.index, id.generation}); };
    if (what == 0)
      for (const auto& body : scene->live.bodies()) add(body.id);
    else if (what == 3)
      for (const limber::JointId id : scene->live.joints()) add(id);
    else
      for (const limber::BodyId id : what == 1 ? scene->live.statics() : scene->live.sensors()) add(id);
    scene->say(scene->ids);
  });
}
EMSCRIPTEN_KEEPALIVE limber_result scene_add_body(limber_scene* scene, std::size_t model, double x, double y, double z,
                                                  const char* name) {
  return guarded([&] { scene->live.add_body(model, {x, y, z}, name); });
}
EMSCRIPTEN_KEEPALIVE limber_result scene_step(limber_scene* scene) {
  return guarded([&] { scene->live.step(); });
}
EMSCRIPTEN_KEEPALIVE double scene_steps_taken(const limber_scene* scene) {
  return scene->world ? static_cast<double>(scene->live.steps_taken()) : 0.0;
}
EMSCRIPTEN_KEEPALIVE limber_result scene_save_state(const limber_scene* scene, limber_snapshot* snapshot) {
  return guarded([&] { scene->live.save_state(required(snapshot, "snapshot").bytes); });
}
EMSCRIPTEN_KEEPALIVE limber_result scene_restore_state(limber_scene* scene, const std::byte* state, std::size_t size) {
  return guarded([&] { scene->live.restore_state({state, size}); });
}

EMSCRIPTEN_KEEPALIVE limber_result scene_frame(limber_scene* scene) {
  return guarded([&] { scene->say(scene->live.frame()); });
}
/// @param normals out: of the answer, which is positions
EMSCRIPTEN_KEEPALIVE limber_result scene_bent(limber_scene* scene, std::size_t body, double tolerance, bool touching,
                                              const float** normals) {
  return guarded([&] {
    const limber::BentSurface bent = scene->live.bent(body, tolerance, touching);
    *normals = bent.normals.data();
    scene->say(bent.positions);
  });
}
EMSCRIPTEN_KEEPALIVE limber_result scene_sums(limber_scene* scene) {
  return guarded([&] {
    const limber::LiveSums sums = scene->live.sums();
    scene->numbers = {sums.energy.kinetic_rigid,        sums.energy.potential,
                      sums.energy.kinetic_modal,        sums.energy.elastic,
                      static_cast<double>(sums.asleep), static_cast<double>(sums.pressing)};
    scene->say(scene->numbers);
  });
}
EMSCRIPTEN_KEEPALIVE limber_result scene_contacts(limber_scene* scene) {
  return guarded([&] { scene->say(scene->live.contacts()); });
}
EMSCRIPTEN_KEEPALIVE limber_result scene_record(limber_scene* scene) {
  return guarded([&] { scene->live.record(); });
}
EMSCRIPTEN_KEEPALIVE limber_result scene_recording(limber_scene* scene) {
  return guarded([&] { scene->say(scene->text = scene->live.recording()); });
}

// Of a model that sounds: 0 eigenvalues, 1 decays, 2 gains (doubles), 3 shapes (floats).
EMSCRIPTEN_KEEPALIVE limber_result scene_sound(limber_scene* scene, std::size_t model, int what) {
  return guarded([&] { say_sound(*scene, required(scene->live.sounding(model), "the sound of this model"), what); });
}
EMSCRIPTEN_KEEPALIVE double scene_loudness(limber_scene* scene, std::size_t model, double contact_time) {
  const limber::SoundingBody* body = scene->live.sounding(model);
  return body != nullptr ? body->largest_pressure(contact_time) * scene->live.models()[model]->data().mass : 0.0;
}
EMSCRIPTEN_KEEPALIVE void scene_listen(limber_scene* scene, bool on) { scene->live.listen(on); }
/// @param numbers 6: place and impulse
EMSCRIPTEN_KEEPALIVE limber_result scene_note_blow(limber_scene* scene, std::size_t body, const double* numbers,
                                                   double contact_time) {
  return guarded([&] {
    scene->live.note_blow(body, {numbers[0], numbers[1], numbers[2]}, {numbers[3], numbers[4], numbers[5]},
                          contact_time);
  });
}
EMSCRIPTEN_KEEPALIVE void scene_take_blows(limber_scene* scene) { scene->say(scene->live.take_blows()); }

}  // extern "C"
