#include "limber/dynamics/surface_point.h"

#include <cmath>

#include "limber/core/error.h"
#include "surface_point_kernels.h"

namespace limber {
namespace {

using internal::add_rows;
using internal::rows_times;
using internal::SurfaceRows;

/// True if the rows of a vertex lie together.
bool has_rows(const ModalModel& model, const SurfacePoint& at) {
  return at.surface == SurfacePoint::Surface::kCollision && model.data().touchable;
}

const ModalSurface& surface_of(const ModalModel& model, const SurfacePoint& at) {
  return at.surface == SurfacePoint::Surface::kRender ? model.render() : model.collision();
}

/// The rows of U at the corners that take part, weighted, and along each axis by `along`; a vertex reads one corner's.
SurfaceRows rows_at(const ModalModel& model, const SurfacePoint& at, const Vec3& along) {
  const Triangle& corners = model.collision().triangles[static_cast<std::size_t>(at.triangle)];
  SurfaceRows rows{};
  for (std::size_t corner = 0; corner < 3; ++corner) {
    if (at.weight[corner] == 0.0) continue;
    for (int axis = 0; axis < 3; ++axis, ++rows.count) {
      rows.row[rows.count] = model.collision_rows().row(corners[corner], axis);
      rows.weight[rows.count] = at.weight[corner] * along[axis];
    }
  }
  return rows;
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
  if (has_rows(model, at)) {
    double sum[3];
    rows_times(rows_at(model, at, Vec3::Ones()), z.size(), z.data(), sum);
    return {sum[0], sum[1], sum[2]};
  }
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
  if (has_rows(model, at)) return add_rows(rows_at(model, at, f_B), g.size(), g.data());
  for (std::size_t i = 0; i < g.size(); ++i) g[i] += shape_at(model, at, static_cast<Index>(i)).dot(f_B);
}

}  // namespace limber
