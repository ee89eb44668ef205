/// @file limber/dynamics/surface_point.h
/// Points of a body's surface, and the rows of U there: p_BP = r + U z.
#pragma once

#include <array>
#include <span>
#include <tuple>
#include <type_traits>

#include "limber/core/types.h"
#include "limber/model/modal_model.h"

namespace limber {

/// A point of a body's surface: triangle and barycentric weights. A vertex v is any triangle that has it, weight 1.
struct SurfacePoint {
  enum class Surface { kRender, kCollision } surface = Surface::kCollision;
  Index triangle = 0;
  std::array<double, 3> weight{1.0, 0.0, 0.0};  ///< sums to 1
};

template <class Self>
requires std::is_same_v<std::remove_const_t<Self>, SurfacePoint>
auto state_fields(Self& s) { return std::tie(s.surface, s.triangle, s.weight); }

/// @throws InvalidArgument if the triangle does not exist, or the weights are not finite or do not sum to 1 (to 1e-6)
void validate(const ModalModel& model, const SurfacePoint& at);

/// r + U z, body frame, m. @param z k amplitudes @pre `at` is valid, here and below. Nothing here allocates or throws.
Vec3 deformed_point(const ModalModel& model, const SurfacePoint& at, std::span<const double> z);

/// One column of U: displacement per unit amplitude of a mode, body frame, kg^−½.
Vec3 shape_at(const ModalModel& model, const SurfacePoint& at, Index mode);

/// U z, body frame, m; with rates ż for z, the velocity of deformation, m/s.
Vec3 displacement(const ModalModel& model, const SurfacePoint& at, std::span<const double> z);

/// g += Uᵀ f. @param f_B force (N) or impulse (N·s), body axes
void add_modal_force(const ModalModel& model, const SurfacePoint& at, const Vec3& f_B, std::span<double> g);

}  // namespace limber
