// A body as the finder of manifolds knows it.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <variant>
#include <vector>

#include "convex/convex_core.h"
#include "finder/geometry_cache.h"
#include "finder/world_bounds.h"
#include "limber/collision/narrow_phase.h"
#include "manifold/inner_ball.h"
#include "manifold/mesh_facets.h"

namespace limber::internal {

/// A rigid shape made ready; shared by the bodies that wear it.
struct ManifoldShape {
  explicit ManifoldShape(std::shared_ptr<const Shape> s) : shape(std::move(s)), geometry(*shape) {
    std::visit(
        [this]<class T>(const T& convex) {
          if constexpr (requires { convex_core(convex); }) core = convex_core(convex);
        },
        *shape);
    if (core.points.empty() && geometry.surface()) facets.emplace(*geometry.surface());
  }
  std::shared_ptr<const Shape> shape;  ///< kept alive, so that its address is not another's
  RigidGeometry geometry;
  ConvexCore core{};                   ///< of the convex ones; without points for the rest
  std::optional<MeshFacets> facets{};  ///< of meshes and height fields
};

/// The size that motions are measured by: of solids and sheets the least extent, but a hundredth of the largest; of
/// meshes that others stand on the largest.
inline double thickness_of(const Aabb& box, bool ground) {
  const Vec3 extents = 2.0 * box.half_extents();
  return ground ? extents.maxCoeff() : std::max(extents.minCoeff(), 0.01 * extents.maxCoeff());
}

struct ManifoldBody {
  bool present = false;
  std::shared_ptr<const ModalGeometry> modal{};  ///< one of the two
  std::shared_ptr<const ManifoldShape> rigid{};
  std::optional<InnerBall> inner{};      ///< none: the shape holds no ball that is known
  double thickness = 0.0, radius = 0.0;  ///< thickness_of() its box at rest; farthest point from the origin, m

  /// How far bending may have taken any of its points in all queries so far: the length of a way, m.
  double bent = 0.0;

  // As it was placed for the last query.
  std::vector<double> amplitudes{};  ///< of a modal one
  bool placed_asleep = false;
  RigidTransform pose{};
  Mat3 turn = Mat3::Identity();
  Vec3 displacement = Vec3::Zero();
  double reach = 0.0;

  /// How far new amplitudes take any of its points at most, m. A skin may be anywhere then.
  double largest_bend(std::span<const double> z) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < z.size(); ++i) {
      const double change = std::abs(z[i] - amplitudes[i]);
      const bool skin = modal->surface->skin() != nullptr && change > 0.0;
      sum += skin ? 2.0 * radius : change * modal->surface->largest_shape(static_cast<Index>(i));
    }
    return sum;
  }
  Index modes() const { return modal ? modal->surface->modes() : 0; }
  const ConvexCore* core() const { return rigid && !rigid->core.points.empty() ? &rigid->core : nullptr; }
  const HalfSpace* half_space() const { return rigid ? std::get_if<HalfSpace>(rigid->shape.get()) : nullptr; }
  double rounding() const { return core() ? core()->radius : 0.0; }  ///< radius about the core, m
};

}  // namespace limber::internal
