#include "limber/dynamics/body_shape.h"

#include <algorithm>

namespace limber {
namespace {

const ModalSurface& surface_of(const ModalModel& model, const SurfacePoint& at) {
  return at.surface == SurfacePoint::Surface::kRender ? model.render() : model.collision();
}

/// A vertex that has part in a point.
struct Corner {
  SurfacePoint at;  // the vertex alone
  SkinInfluences influences;
  Vec3 rest;
  double weight;
};

/// act(corner) for the vertices of a point.
template <class Action>
void for_corners(const ModalModel& model, const SurfacePoint& at, Action&& act) {
  const ModalSurface& surface = surface_of(model, at);
  const Triangle& corners = surface.triangles[static_cast<std::size_t>(at.triangle)];
  const std::span<const SkinInfluences> influences = skin_influences(model, at.surface);
  for (std::size_t c = 0; c < 3; ++c) {
    if (at.weight[c] == 0.0) continue;
    const auto v = static_cast<std::size_t>(corners[c]);
    Corner corner{{.surface = at.surface, .triangle = at.triangle, .weight = {0.0, 0.0, 0.0}},
                  influences[v],
                  surface.rest[v].cast<double>(),
                  at.weight[c]};
    corner.at.weight[c] = 1.0;
    act(corner);
  }
}

}  // namespace

SkinMemory::Entry& SkinMemory::entry(std::span<const double> z) {
  while (entries_.size() < kPoses) {
    if (entries_.empty()) entries_.reserve(kPoses);
    entries_.push_back({.pose = SkinPose(*skin_), .z = std::vector<double>(static_cast<std::size_t>(skin_->modes))});
  }
  Entry* oldest = entries_.data();
  for (Entry& e : entries_) {
    if (e.used > 0 && std::equal(z.begin(), z.end(), e.z.begin())) {
      e.used = ++clock_;
      return e;
    }
    if (e.used < oldest->used) oldest = &e;
  }
  oldest->pose.set(z);
  std::copy(z.begin(), z.end(), oldest->z.begin());
  oldest->used = ++clock_;
  oldest->differentiated = false;
  return *oldest;
}

const SkinPose& SkinMemory::differentiated(std::span<const double> z) {
  Entry& e = entry(z);
  if (!e.differentiated) e.pose.differentiate(), e.differentiated = true;
  return e.pose;
}

std::span<const SkinInfluences> skin_influences(const ModalModel& model, SurfacePoint::Surface surface) {
  const ModalSkin& skin = *model.data().skin;
  return surface == SurfacePoint::Surface::kCollision && model.data().collision ? skin.collision : skin.render;
}

Vec3 BodyShape::position(const SurfacePoint& at) const {
  if (skin_ == nullptr) return deformed_point(*model_, at, z_);
  const SkinPose& pose = handles();
  Vec3 sum = Vec3::Zero();
  for_corners(*model_, at, [&](const Corner& c) {
    sum += c.weight * pose.position(c.influences, c.rest, displacement(*model_, c.at, z_));
  });
  return sum;
}

Vec3 BodyShape::velocity(const SurfacePoint& at, std::span<const double> rates) const {
  if (skin_ == nullptr) return displacement(*model_, at, rates);
  const SkinPose& pose = differentiated();
  Vec3 sum = Vec3::Zero();
  for_corners(*model_, at, [&](const Corner& c) {
    const Vec3 u = displacement(*model_, c.at, z_), v = displacement(*model_, c.at, rates);
    sum += c.weight * pose.velocity(c.influences, c.rest, u, v, rates);
  });
  return sum;
}

void BodyShape::add_force(const SurfacePoint& at, const Vec3& f_B, std::span<double> g) const {
  if (skin_ == nullptr) return add_modal_force(*model_, at, f_B, g);
  const SkinPose& pose = differentiated();
  for_corners(*model_, at, [&](const Corner& c) {
    const Vec3 u = displacement(*model_, c.at, z_);
    add_modal_force(*model_, c.at, pose.add_rows(c.influences, c.rest, u, c.weight * f_B, g), g);
  });
}

Mat3 BodyShape::turn(const SurfacePoint& at) const {
  if (skin_ == nullptr) return Mat3::Identity();
  const SkinPose& pose = handles();
  Mat3 sum = Mat3::Zero();
  for_corners(*model_, at, [&](const Corner& c) { sum += c.weight * pose.turn(c.influences); });
  return sum;
}

}  // namespace limber
