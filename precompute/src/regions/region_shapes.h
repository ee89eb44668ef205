/// @file region_shapes.h
/// Whether a shape holds a point.
#pragma once

#include <Eigen/Geometry>
#include <optional>

#include "limber/mesh/grouped_surface.h"
#include "limber/mesh/surface_locator.h"
#include "limber/precompute/material_regions.h"

namespace limber::internal {

/// The nearest face of a body's surface.
struct NearFace {
  const SurfaceGroup* group = nullptr;
  double distance = 0.0;  ///< m
};

class NearestFaces {
 public:
  /// @throws InputError if there are no faces
  explicit NearestFaces(const std::optional<GroupedSurface>& faces);
  NearFace at(const Vec3& p) const;

 private:
  const GroupedSurface& faces_;
  SurfaceLocator locator_;
};

/// One region's shape, made ready for many points. Keeps a reference to the region.
class ShapeTest {
 public:
  /// @param faces of the body's surface @throws InputError if the shape names faces that are not there
  ShapeTest(const MaterialRegion& region, const std::optional<GroupedSurface>& faces);
  /// @param face nearest to p, where any region asks for it
  bool holds(const Vec3& p, const std::optional<NearFace>& face) const;

 private:
  const RegionShape& shape_;
  Eigen::AlignedBox3d box_;  // of shells
};

}  // namespace limber::internal
