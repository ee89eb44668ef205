// The page's engine as plain C functions: what web/engine.js calls. Texts are UTF-8 and end with zero; arrays stay
// valid until the next call. Functions that can fail return 0 and leave one line in page_error().
#include <cstddef>
#include <cstdio>
#include <memory>
#include <span>
#include <string>

#include "limber/view/page_world.h"
#include "wasm_function.h"

namespace {

using limber::guarded;
using limber::PageHit;
using limber::PageSettings;
using limber::PageWorld;
using limber::Vec3;

std::unique_ptr<PageWorld> page;
std::string error, text;
PageHit hit;
std::span<const double> ray, blows;
double answer[16];
std::span<const double> contacts;
limber::PageSurface bent;

/// From 12 numbers: gravity, drag_frequency, poke_speed, step, substeps, modes, damping, friction, solver,
/// joint_friction.
PageSettings settings_of(const double* n) {
  PageSettings s;
  s.gravity = {n[0], n[1], n[2]};
  s.drag_frequency = n[3];
  s.poke_speed = n[4];
  s.step = n[5];
  s.substeps = static_cast<int>(n[6]);
  s.modes = static_cast<limber::Index>(n[7]);
  s.damping = n[8];
  s.friction = n[9];
  s.solver = static_cast<limber::ContactSolver>(static_cast<int>(n[10]));
  s.joint_friction = n[11];
  return s;
}

}  // namespace

extern "C" {

EMSCRIPTEN_KEEPALIVE const char* page_error() { return error.c_str(); }
EMSCRIPTEN_KEEPALIVE int page_open(const char* scene) {
  return guarded(error, [&] { page = std::make_unique<PageWorld>(scene, false); });
}
EMSCRIPTEN_KEEPALIVE int page_begin() {
  return guarded(error, [] { page->begin(); });
}
EMSCRIPTEN_KEEPALIVE const char* page_description() {
  return guarded(error, [] { text = page->description(); }) != 0 ? text.c_str() : "";
}

// Data of model i: 0 rest, 1 normals (floats), 2 triangles (32 bits each); 3 to 5: of the surface that touches.
EMSCRIPTEN_KEEPALIVE const void* page_model_data(int model, int what) {
  const limber::PageModel& m = what < 3 ? page->models()[static_cast<std::size_t>(model)] : page->touching(model);
  switch (what % 3) {
    case 0:
      return m.rest.data();
    case 1:
      return m.normals.data();
    default:
      return m.triangles.data();
  }
}
// Vertices and triangles of the surface that touches; none: it is the drawn one.
EMSCRIPTEN_KEEPALIVE const double* page_touching_size(int model) {
  const limber::PageModel& m = page->touching(model);
  const bool drawn = &m == &page->models()[static_cast<std::size_t>(model)];
  answer[0] = drawn ? 0.0 : static_cast<double>(m.rest.size() / 3);
  answer[1] = drawn ? 0.0 : static_cast<double>(m.triangles.size() / 3);
  return answer;
}

// The surface of a body as it is bent (PageWorld::bent()): by how many modes, and until the next 0 positions, 1
// normals.
EMSCRIPTEN_KEEPALIVE int page_bend(int body, double tolerance, int touching) {
  bent = page->bent(body, tolerance, touching != 0);
  return static_cast<int>(bent.modes);
}
EMSCRIPTEN_KEEPALIVE const float* page_bent(int what) {
  return what == 0 ? bent.positions.data() : bent.normals.data();
}

EMSCRIPTEN_KEEPALIVE int page_set_live(const double* settings) {
  return guarded(error, [&] { page->set_live(settings_of(settings)); });
}
EMSCRIPTEN_KEEPALIVE int page_restart(const double* settings) {
  return guarded(error, [&] {
    PageSettings next = settings_of(settings);
    next.stiffness = page->settings().stiffness;
    page->restart(next);
  });
}
EMSCRIPTEN_KEEPALIVE int page_set_stiffness(int model, double factor) {
  return guarded(error, [&] { page->set_stiffness(model, factor); });
}
EMSCRIPTEN_KEEPALIVE int page_step() {
  return guarded(error, [] { page->step(); });
}
EMSCRIPTEN_KEEPALIVE double page_steps_taken() { return static_cast<double>(page->steps_taken()); }
EMSCRIPTEN_KEEPALIVE const char* page_hash() {
  char digits[17];
  std::snprintf(digits, sizeof digits, "%016llx", static_cast<unsigned long long>(page->state_hash()));
  text = digits;
  return text.c_str();
}
EMSCRIPTEN_KEEPALIVE const float* page_frame() { return page->frame().data(); }
EMSCRIPTEN_KEEPALIVE const double* page_numbers() { return page->numbers().data(); }
EMSCRIPTEN_KEEPALIVE const double* page_stage_seconds() { return page->stage_seconds().data(); }
EMSCRIPTEN_KEEPALIVE const double* page_joint_frames() { return page->joint_frames().data(); }
// Per joint and coordinate (3) where it is led, and its speed; NaN: nowhere, none.
EMSCRIPTEN_KEEPALIVE const double* page_joint_wishes() { return page->joint_wishes().data(); }
EMSCRIPTEN_KEEPALIVE int page_lead_joint(int joint, int coordinate, double place) {
  return guarded(error, [&] { page->lead_joint(joint, coordinate, place); });
}
EMSCRIPTEN_KEEPALIVE int page_run_joint(int joint, int coordinate, double speed) {
  return guarded(error, [&] { page->run_joint(joint, coordinate, speed); });
}
EMSCRIPTEN_KEEPALIVE int page_leave_joint(int joint, int coordinate) {
  return guarded(error, [&] { page->leave_joint(joint, coordinate); });
}

// What pressed in the last step, six numbers each (PageWorld::contacts()): how many, and where they are until the next.
EMSCRIPTEN_KEEPALIVE int page_contact_count() {
  contacts = page->contacts();
  return static_cast<int>(contacts.size() / 6);
}
EMSCRIPTEN_KEEPALIVE const double* page_contacts() { return contacts.data(); }
EMSCRIPTEN_KEEPALIVE const double* page_sensor_counts() { return page->sensor_counts().data(); }

// Places that a ray meets, seven numbers each (PageWorld::ray_places()): how many, and where they are until the next.
EMSCRIPTEN_KEEPALIVE int page_ray(double x, double y, double z, double dx, double dy, double dz) {
  ray = page->ray_places({x, y, z}, {dx, dy, dz});
  return static_cast<int>(ray.size() / 7);
}
EMSCRIPTEN_KEEPALIVE const double* page_ray_places() { return ray.data(); }

// The hit stays until the next cast. @return body (−1: none), point, distance
EMSCRIPTEN_KEEPALIVE const double* page_cast(double x, double y, double z, double dx, double dy, double dz) {
  hit = page->cast_ray({x, y, z}, {dx, dy, dz});
  answer[0] = hit.body;
  for (int i = 0; i < 3; ++i) answer[1 + i] = hit.point[i];
  answer[4] = hit.distance;
  return answer;
}
EMSCRIPTEN_KEEPALIVE int page_grab() { return page->grab(hit) ? 1 : 0; }
EMSCRIPTEN_KEEPALIVE void page_drag_to(double x, double y, double z) { page->drag_to({x, y, z}); }
EMSCRIPTEN_KEEPALIVE void page_let_go() { page->let_go(); }
// A flag for a held point, the point, its target, the force on the body, pins.
EMSCRIPTEN_KEEPALIVE const double* page_hand() {
  const limber::HandleView view = page->hand();
  const Vec3 point = page->held_point();
  answer[0] = page->holds() ? 1.0 : 0.0;
  for (int i = 0; i < 3; ++i) {
    answer[1 + i] = point[i];
    answer[4 + i] = view.target.position[i];
    answer[7 + i] = view.force[i];
  }
  answer[10] = page->pins();
  return answer;
}
EMSCRIPTEN_KEEPALIVE int page_pin() {
  return guarded(error, [] { page->pin(hit); });
}
EMSCRIPTEN_KEEPALIVE void page_unpin() { page->unpin(); }
EMSCRIPTEN_KEEPALIVE int page_poke(double dx, double dy, double dz, double contact_time) {
  return guarded(error, [&] { page->poke(hit, {dx, dy, dz}, contact_time); });
}
EMSCRIPTEN_KEEPALIVE int page_drop(int model, double x, double y, double z) {
  return guarded(error, [&] { page->drop(model, {x, y, z}); });
}
EMSCRIPTEN_KEEPALIVE int page_show_mode(int body, int mode, double amplitude) {
  return guarded(error, [&] { page->show_mode(body, mode, amplitude); });
}

// Sound of model i: 0 eigenvalues, 1 decays, 2 gains (doubles), 3 shapes (floats); null where it has none.
EMSCRIPTEN_KEEPALIVE const void* page_sound_data(int model, int what) {
  const void* data = nullptr;
  guarded(error, [&] {
    const limber::SoundingBody& body = page->sounding(model);
    switch (what) {
      case 0:
        data = body.modes().eigenvalues.data();
        break;
      case 1:
        data = body.modes().decays.data();
        break;
      case 2:
        data = body.gains().data();
        break;
      default:
        data = body.modes().shapes.data();
    }
  });
  return data;
}
EMSCRIPTEN_KEEPALIVE double page_loudness(int model, double contact_time) {
  return page->loudness(model, contact_time);
}
EMSCRIPTEN_KEEPALIVE void page_listen(int on) { page->listen(on != 0); }
// Blows since the last call, PageWorld::kBlowNumbers each: how many numbers, and where they are until the next call.
EMSCRIPTEN_KEEPALIVE int page_blows() {
  blows = page->take_blows();
  return static_cast<int>(blows.size());
}
EMSCRIPTEN_KEEPALIVE const double* page_blow_numbers() { return blows.data(); }

EMSCRIPTEN_KEEPALIVE int page_keep() {
  return guarded(error, [] { page->keep(); });
}
EMSCRIPTEN_KEEPALIVE int page_kept() { return page->kept(); }
EMSCRIPTEN_KEEPALIVE double page_kept_step(int key) { return static_cast<double>(page->kept_step(key)); }
EMSCRIPTEN_KEEPALIVE int page_go_to(int key) {
  return guarded(error, [&] { page->go_to(key); });
}

// All that is to be known to go on from here: how many bytes, 0 where it fails; page_text() has them.
EMSCRIPTEN_KEEPALIVE double page_save() {
  return guarded(error,
                 [] {
                   const std::vector<std::byte> saved = page->saved();
                   text.assign(reinterpret_cast<const char*>(saved.data()), saved.size());
                 }) != 0
             ? static_cast<double>(text.size())
             : 0.0;
}
EMSCRIPTEN_KEEPALIVE int page_restore(const std::byte* saved, int size) {
  return guarded(error, [&] { page->restore({saved, static_cast<std::size_t>(size)}); });
}

// A GLB of what was kept: how many bytes, 0 where it fails; page_text() has them until the next text.
EMSCRIPTEN_KEEPALIVE double page_record() {
  return guarded(error, [] { text = page->recording(); }) != 0 ? static_cast<double>(text.size()) : 0.0;
}
EMSCRIPTEN_KEEPALIVE const char* page_text() { return text.data(); }

// Surface by the engine itself, for comparison with what is drawn: 3 V floats of body `body` into `positions`.
EMSCRIPTEN_KEEPALIVE int page_reconstruct(int body, float* positions) {
  return guarded(error, [&] { page->reconstruct(body, positions); });
}

}  // extern "C"
