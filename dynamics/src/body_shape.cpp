#include "limber/dynamics/body_shape.h"

#include <algorithm>

namespace limber {
namespace {

const ModalSurface& surface_of(const ModalModel& model, const SurfacePoint& at) {
  return at.surface == SurfacePoint::Surface::kRender ? model.render() : model.collision();
}

/// Three rows of k numbers, times k numbers.
Vec3 product(std::span<const double> shapes, std::span<const double> z) {
  Vec3 u = Vec3::Zero();
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (std::size_t i = 0; i < z.size(); ++i) u[static_cast<Index>(axis)] += shapes[axis * z.size() + i] * z[i];
  return u;
}

void add_product(std::span<const double> shapes, const Vec3& f, std::span<double> g) {
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (std::size_t i = 0; i < g.size(); ++i) g[i] += shapes[axis * g.size() + i] * f[static_cast<Index>(axis)];
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

Vec3 BodyShape::position(const SurfacePoint& at, std::span<const double> shapes) const {
  if (skin_ == nullptr) {
    if (shapes.empty()) return deformed_point(*model_, at, z_);
    const ModalSurface& surface = surface_of(*model_, at);
    const Triangle& corners = surface.triangles[static_cast<std::size_t>(at.triangle)];
    Vec3 rest = Vec3::Zero();
    for (std::size_t c = 0; c < 3; ++c)
      rest += at.weight[c] * surface.rest[static_cast<std::size_t>(corners[c])].cast<double>();
    return rest + product(shapes, z_);
  }
  const SkinPose& pose = handles();
  const Vec3 mean = shapes.empty() ? Vec3(Vec3::Zero()) : product(shapes, z_);
  Vec3 sum = Vec3::Zero();
  for_corners(*model_, at, [&](const Corner& c) {
    const Vec3 u = shapes.empty() ? displacement(*model_, c.at, z_) : mean;
    sum += c.weight * pose.position(c.influences, c.rest, u);
  });
  return sum;
}

Vec3 BodyShape::velocity(const SurfacePoint& at, std::span<const double> rates, std::span<const double> shapes) const {
  if (skin_ == nullptr) return shapes.empty() ? displacement(*model_, at, rates) : product(shapes, rates);
  const SkinPose& pose = differentiated();
  Vec3 sum = Vec3::Zero();
  for_corners(*model_, at, [&](const Corner& c) {
    const Vec3 u = shapes.empty() ? displacement(*model_, c.at, z_) : product(shapes, z_);
    const Vec3 v = shapes.empty() ? displacement(*model_, c.at, rates) : product(shapes, rates);
    sum += c.weight * pose.velocity(c.influences, c.rest, u, v, rates);
  });
  return sum;
}

void BodyShape::add_force(const SurfacePoint& at, const Vec3& f_B, std::span<double> g,
                          std::span<const double> shapes) const {
  if (skin_ == nullptr) {
    if (shapes.empty()) return add_modal_force(*model_, at, f_B, g);
    return add_product(shapes, f_B, g);
  }
  const SkinPose& pose = differentiated();
  Vec3 to_region = Vec3::Zero();
  for_corners(*model_, at, [&](const Corner& c) {
    const Vec3 u = shapes.empty() ? displacement(*model_, c.at, z_) : product(shapes, z_);
    const Vec3 turned = pose.add_rows(c.influences, c.rest, u, c.weight * f_B, g);
    if (shapes.empty())
      add_modal_force(*model_, c.at, turned, g);
    else
      to_region += turned;
  });
  if (!shapes.empty()) add_product(shapes, to_region, g);
}

Mat3 BodyShape::turn(const SurfacePoint& at) const {
  if (skin_ == nullptr) return Mat3::Identity();
  const SkinPose& pose = handles();
  Mat3 sum = Mat3::Zero();
  for_corners(*model_, at, [&](const Corner& c) { sum += c.weight * pose.turn(c.influences); });
  return sum;
}

}  // namespace limber
