/// @file orbit_samples.h
/// Points that stand for a surface when it is tested against another, and steps from point to point over it. Private to
/// the articulation module.
#pragma once

#include <span>
#include <vector>

#include "ranges/orbit_faces.h"

namespace limber::internal {

/// A point of a surface, in path coordinates.
struct SurfaceSample {
  Vec3 p = Vec3::Zero();
  Index face = 0;  ///< of SampledSurface::faces()
};

/// The faces of one side: points on them, and their neighbours.
class SampledSurface {
 public:
  /// @param bodies whose triangles `faces` are. @param count points wanted on the faces, half as many on sharp edges
  /// and as many at most at the ends of these
  SampledSurface(std::span<const OrbitBody> bodies, std::vector<OrbitFace> faces, int count);

  const std::vector<OrbitFace>& faces() const { return faces_; }
  const std::vector<SurfaceSample>& points() const { return points_; }
  double spacing() const { return spacing_; }  ///< typical distance between points on faces

  /// A point of the surface near `target`, reached from `start` over neighbouring faces.
  SurfaceSample walk(const SurfaceSample& start, const Vec3& target) const;

 private:
  struct Edge {
    Index a = 0, b = 0;  ///< as OrbitFace numbers vertices, a < b
    Index face = 0;
  };

  std::vector<Edge> sharp_edges(std::span<const OrbitBody> bodies) const;
  void add_face_points(int count);
  void add_edge_points(const std::vector<Edge>& edges, int count);
  void add_corner_points(const std::vector<Edge>& edges, int most);
  Vec3 corner(Index face, Index vertex) const;

  std::vector<OrbitFace> faces_;
  FacesAround around_;
  std::vector<SurfaceSample> points_;
  double spacing_ = 0.0;
};

}  // namespace limber::internal
