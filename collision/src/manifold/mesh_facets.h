// What of a rigid mesh can be touched otherwise than along a face's normal.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "limber/collision/collision_surface.h"

namespace limber::internal {

/// Triangles that lie in one plane and hang together are one facet, called by its lowest triangle. Edges and vertices
/// within a facet are none: an edge is *active* where it has triangles of two facets and the surface is convex there,
/// or where the surface ends.
class MeshFacets {
 public:
  explicit MeshFacets(const CollisionSurface& surface);

  Index facet(Index triangle) const { return facet_[static_cast<std::size_t>(triangle)]; }
  /// Of a triangle: whether any of its edges is active.
  bool has_active_edge(Index triangle) const { return rim_[static_cast<std::size_t>(triangle)] != 0; }
  /// Whether an edge of it, from a corner to the next, is.
  bool active(Index triangle, int corner) const {
    return (rim_[static_cast<std::size_t>(triangle)] >> corner & 1) != 0;
  }
  /// The facet that all triangles at an edge or a vertex belong to; −1: there are several, or the surface ends.
  Index around_edge(Index edge) const { return around_edge_[static_cast<std::size_t>(edge)]; }
  Index around_vertex(Index vertex) const { return around_vertex_[static_cast<std::size_t>(vertex)]; }

 private:
  void grow_facets(const CollisionSurface& surface);
  void look_around(const CollisionSurface& surface);
  bool is_active(const CollisionSurface& surface, Index edge) const;

  std::vector<Vec3> normal_;
  std::vector<Index> facet_, around_edge_, around_vertex_;
  std::vector<std::uint8_t> rim_;
};

}  // namespace limber::internal
