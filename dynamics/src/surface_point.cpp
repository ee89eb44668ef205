#include "limber/dynamics/surface_point.h"

#include <cmath>

#include "limber/core/error.h"

namespace limber {
namespace {

const ModalSurface& surface_of(const ModalModel& model, const SurfacePoint& at) {
  return at.surface == SurfacePoint::Surface::kRender ? model.render() : model.collision();
}

}  // namespace

void validate(const ModalModel& model, const SurfacePoint& at) {
  const auto triangles = static_cast<Index>(surface_of(model, at).triangles.size());
  if (at.triangle < 0 || at.triangle >= triangles)
    throw InvalidArgument("surface point of \"" + model.name() + "\": triangle " + std::to_string(at.triangle) +
                          ", expected 0 to " + std::to_string(triangles - 1));
  const double sum = at.weight[0] + at.weight[1] + at.weight[2];
  if (!(std::abs(sum - 1.0) <= 1e-6))
    throw InvalidArgument("surface point of \"" + model.name() + "\": weights sum to " + std::to_string(sum) +
                          ", expected 1");
}

Vec3 shape_at(const ModalModel& model, const SurfacePoint& at, Index mode) {
  const ModalSurface& surface = surface_of(model, at);
  const Triangle& corners = surface.triangles[static_cast<std::size_t>(at.triangle)];
  Vec3 shape = Vec3::Zero();
  for (std::size_t corner = 0; corner < 3; ++corner)
    if (at.weight[corner] != 0.0)
      shape += at.weight[corner] * surface.basis.shape(corners[corner], mode).cast<double>();
  return shape;
}

Vec3 displacement(const ModalModel& model, const SurfacePoint& at, std::span<const double> z) {
  Vec3 u = Vec3::Zero();
  for (std::size_t i = 0; i < z.size(); ++i) u += z[i] * shape_at(model, at, static_cast<Index>(i));
  return u;
}

Vec3 deformed_point(const ModalModel& model, const SurfacePoint& at, std::span<const double> z) {
  const ModalSurface& surface = surface_of(model, at);
  const Triangle& corners = surface.triangles[static_cast<std::size_t>(at.triangle)];
  Vec3 p = displacement(model, at, z);
  for (std::size_t corner = 0; corner < 3; ++corner)
    p += at.weight[corner] * surface.rest[static_cast<std::size_t>(corners[corner])].cast<double>();
  return p;
}

void add_modal_force(const ModalModel& model, const SurfacePoint& at, const Vec3& f_B, std::span<double> g) {
  for (std::size_t i = 0; i < g.size(); ++i) g[i] += shape_at(model, at, static_cast<Index>(i)).dot(f_B);
}

}  // namespace limber
