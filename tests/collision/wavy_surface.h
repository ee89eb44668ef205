// Collision surfaces of bodies that bend in waves (wavy_model.h).
#pragma once

#include <memory>

#include "limber/collision/collision_surface.h"
#include "wavy_model.h"

namespace limber::testing {

inline std::shared_ptr<const CollisionSurface> wavy_surface(const SurfaceMesh& mesh, Index modes,
                                                            int leaf_triangles = 4) {
  return std::make_shared<const CollisionSurface>(wavy_model(mesh, modes),
                                                  CollisionSurfaceOptions{.leaf_triangles = leaf_triangles});
}

}  // namespace limber::testing
