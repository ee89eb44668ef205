/// @file orbit_faces.h
/// Triangles as the orbits of a motion see them. Private to the articulation module.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "limber/mesh/corner_tree.h"
#include "ranges/path_frame.h"

namespace limber::internal {

/// A surface made ready for any path.
struct OrbitBody {
  const SurfaceMesh* surface = nullptr;
  bool closed = true;
  bool inside_out = false;  ///< closed, and its triangles are clockwise seen from outside
  Eigen::AlignedBox3d box{};
  std::span<const Triangle> caps{};             ///< over small holes
  std::shared_ptr<const CornerTree<3>> tree{};  ///< of all triangles, with caps; copies share it

  std::size_t triangles() const { return surface->triangles.size() + caps.size(); }
  const Triangle& triangle(std::size_t i) const {
    const std::size_t own = surface->triangles.size();
    return i < own ? surface->triangles[i] : caps[i - own];
  }
};
OrbitBody orbit_body(const MotionBody& body);

struct OrbitSector {
  double bearing = 0.0, half = 0.0;  ///< rotations, screws: all of a face lies within θ = bearing ± half, rad
  double cosine_low = -1.0, cosine_high = 1.0;  ///< of θ − OrbitFace::heading over the sector
};

struct OrbitFace {
  std::array<Vec3, 3> corners;         ///< path coordinates, counter-clockwise seen from outside
  Vec3 normal;                         ///< outward, unit; 0 without an area
  double offset = 0.0;                 ///< normal · corner
  double across = 0.0, heading = 0.0;  ///< length and angle of the normal's part across the axis
  Triangle vertices{};                 ///< of the corners, numbered over all faces of a side
  Index body = 0, triangle = 0;
  bool cap = false;      ///< over a hole: solid behind it, and no surface
  bool flipped = false;  ///< the second and third corner have changed places
  /// The motion runs against it, or away from it, all over it and over what continues it. On a facet of a surface that
  /// the motion carries along itself the normal velocity changes its sign; so a face that lies along the motion is told
  /// from one that slides.
  bool one_sided = false;
  OrbitSector sector{};  ///< about the axis
  OrbitBox box{};        ///< of the orbits that meet it
};

/// The faces around each vertex of a side.
class FacesAround {
 public:
  FacesAround() = default;
  explicit FacesAround(const std::vector<OrbitFace>& faces);
  /// @param vertex as OrbitFace numbers them
  std::span<const Index> of(Index vertex) const {
    const auto first = static_cast<std::size_t>(first_[static_cast<std::size_t>(vertex)]),
               end = static_cast<std::size_t>(first_[static_cast<std::size_t>(vertex) + 1]);
    return std::span(faces_).subspan(first, end - first);
  }

 private:
  std::vector<Index> first_{0}, faces_;
};

/// The triangles of either side that orbits within `margin` of the other's triangles meet. All others are of no use:
/// nothing of the other side passes them. A screw's come twice where their helices reach beyond a turn.
/// @param crease angle below which a face continues another, rad
std::pair<std::vector<OrbitFace>, std::vector<OrbitFace>> faces_that_meet(const PathFrame& frame,
                                                                          std::span<const OrbitBody> moving,
                                                                          std::span<const OrbitBody> fixed,
                                                                          double margin, double crease);

}  // namespace limber::internal
