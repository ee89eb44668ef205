// Posing as plain C functions: what posing.js calls. Texts are UTF-8 and end with zero; arrays stay valid until the
// next call. Functions that can fail return 0 and leave one line in pose_error().
#include <emscripten.h>

#include <exception>
#include <memory>
#include <string>

#include "limber/view/page_pose.h"

namespace {

using limber::Index;
using limber::PagePose;
using limber::PoseHit;
using limber::PoseResult;

std::unique_ptr<PagePose> pose;
std::string pose_line, pose_words;
PoseHit pose_hit;
double pose_numbers[8];

template <class F>
int guarded(const F& work) {
  try {
    work();
    return 1;
  } catch (const std::exception& e) {
    pose_line = e.what();
    return 0;
  }
}

}  // namespace

extern "C" {

EMSCRIPTEN_KEEPALIVE const char* pose_error() { return pose_line.c_str(); }
EMSCRIPTEN_KEEPALIVE int pose_open(const char* model, const char* joints) {
  return guarded([&] { pose = std::make_unique<PagePose>(model, joints); });
}
EMSCRIPTEN_KEEPALIVE const char* pose_description() {
  return guarded([] { pose_words = pose->description(); }) != 0 ? pose_words.c_str() : "";
}
EMSCRIPTEN_KEEPALIVE const void* pose_triangles() { return pose->triangles().data(); }
EMSCRIPTEN_KEEPALIVE const float* pose_positions() { return pose->positions().data(); }
EMSCRIPTEN_KEEPALIVE const double* pose_joint_frames() { return pose->joint_frames().data(); }
// How many handles there are, then point and target of each.
EMSCRIPTEN_KEEPALIVE int pose_handle_count() { return static_cast<int>(pose->handles().size() / 6); }
EMSCRIPTEN_KEEPALIVE const double* pose_handles() { return pose->handles().data(); }

// The hit stays until the next cast. @return part (−1: none), point, distance
EMSCRIPTEN_KEEPALIVE const double* pose_cast(double x, double y, double z, double dx, double dy, double dz) {
  pose_hit = pose->cast_ray({x, y, z}, {dx, dy, dz});
  pose_numbers[0] = pose_hit.part;
  for (int i = 0; i < 3; ++i) pose_numbers[1 + i] = pose_hit.point[i];
  pose_numbers[4] = pose_hit.distance;
  return pose_numbers;
}
EMSCRIPTEN_KEEPALIVE int pose_grab() {
  return guarded([] { pose->grab(pose_hit); });
}
EMSCRIPTEN_KEEPALIVE int pose_take(int handle) {
  return guarded([&] { pose->take(handle); });
}
EMSCRIPTEN_KEEPALIVE void pose_drag_to(double x, double y, double z) { pose->drag_to({x, y, z}); }
EMSCRIPTEN_KEEPALIVE void pose_let_go() { pose->let_go(); }
EMSCRIPTEN_KEEPALIVE void pose_remove_handles() { pose->remove_handles(); }

EMSCRIPTEN_KEEPALIVE int pose_set_name(int part, const char* name) {
  return guarded([&] { pose->set_name(static_cast<Index>(part), name); });
}
EMSCRIPTEN_KEEPALIVE int pose_set_pinned(int part, int pinned) {
  return guarded([&] { pose->set_pinned(static_cast<Index>(part), pinned != 0); });
}
EMSCRIPTEN_KEEPALIVE int pose_set_soft(int part, int soft) {
  return guarded([&] { pose->set_soft(static_cast<Index>(part), soft != 0); });
}
EMSCRIPTEN_KEEPALIVE int pose_set_joint(int joint, const char* told) {
  return guarded([&] { pose->set_joint(static_cast<Index>(joint), told); });
}
// Cuts the part of the last hit: the eye, and directions to both ends of the stroke.
EMSCRIPTEN_KEEPALIVE int pose_cut(double x, double y, double z, double fx, double fy, double fz, double tx, double ty,
                                  double tz) {
  return guarded([&] { pose->cut(pose_hit.part, {{x, y, z}, {fx, fy, fz}, {tx, ty, tz}}); });
}
EMSCRIPTEN_KEEPALIVE int pose_undo() { return pose->undo() ? 1 : 0; }
EMSCRIPTEN_KEEPALIVE void pose_reset() { pose->reset(); }

// status, iterations, energy, joint_error, limit_violation, handle_error; none where it fails
EMSCRIPTEN_KEEPALIVE const double* pose_solve() {
  const int done = guarded([] {
    const PoseResult r = pose->solve();
    const double all[] = {static_cast<double>(r.status),
                          static_cast<double>(r.iterations),
                          r.energy,
                          r.joint_error,
                          r.limit_violation,
                          r.handle_error};
    for (int i = 0; i < 6; ++i) pose_numbers[i] = all[i];
  });
  return done != 0 ? pose_numbers : nullptr;
}
EMSCRIPTEN_KEEPALIVE const char* pose_model_text() {
  return guarded([] { pose_words = pose->model_text(); }) != 0 ? pose_words.c_str() : "";
}
EMSCRIPTEN_KEEPALIVE const char* pose_joints_text() {
  return guarded([] { pose_words = pose->joints_text(); }) != 0 ? pose_words.c_str() : "";
}

}  // extern "C"
