/// @file limber/scene/surface_ray.h
/// First hit of a ray on a deformed body: for picking.
#pragma once

#include <optional>

#include "limber/engine/world.h"

namespace limber {

struct SurfaceHit {
  SurfacePoint at{};       ///< of the render surface
  double parameter = 0.0;  ///< the point is from + parameter · direction; ≥ 0
};

/// The first point of a body's render surface that a ray meets, from either side; none: it misses. All triangles are
/// looked at.
/// @param from, direction world; the direction of any length > 0
std::optional<SurfaceHit> first_hit(const World& world, BodyId body, const Vec3& from, const Vec3& direction);

}  // namespace limber
