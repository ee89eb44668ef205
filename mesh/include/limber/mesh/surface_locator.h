/// @file limber/mesh/surface_locator.h
/// The point of a triangulated surface nearest to a point.
#pragma once

#include <array>
#include <memory>
#include <span>

#include "limber/core/types.h"

namespace limber {

struct SurfaceLocation {
  Index triangle = 0;
  std::array<double, 3> weight{};  ///< of the triangle's corners, barycentric: ≥ 0, sum 1
  double distance = 0.0;           ///< m, ≥ 0: on which side is not told
};

/// A tree of boxes over the triangles, of which it keeps what it needs. Queries are exact searches, take time
/// logarithmic in the number of triangles, allocate nothing and may run at the same time.
class SurfaceLocator {
 public:
  /// @throws InvalidArgument if there are no triangles, or one names a vertex that is not there
  SurfaceLocator(std::span<const Vec3> vertices, std::span<const Triangle> triangles);
  ~SurfaceLocator();
  SurfaceLocator(SurfaceLocator&&) noexcept;
  SurfaceLocator& operator=(SurfaceLocator&&) noexcept;

  /// The nearest point; among equally near triangles, that of the lowest index. @pre p is finite
  SurfaceLocation nearest(const Vec3& p) const;

 private:
  struct Tree;
  std::unique_ptr<const Tree> tree_;
};

}  // namespace limber
