// A deformed or rigid surface as one of two in a narrow-phase query: its vertices and faces in the frame they share.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "limber/collision/closest_features.h"
#include "limber/collision/collision_surface.h"
#include "limber/collision/deformed_surface.h"
#include "limber/core/rigid_transform.h"

namespace limber::internal {

// A vertex, edge or face of a surface as one number: two bits of kind, thirty of index.
using FeatureKey = std::uint32_t;
inline FeatureKey feature_key(Feature::Kind kind, Index index) {
  return static_cast<FeatureKey>(kind) << 30 | static_cast<FeatureKey>(index);
}

inline Index index_of(FeatureKey key) { return static_cast<Index>(key & 0x3fffffffu); }
inline Feature::Kind kind_of(FeatureKey key) { return static_cast<Feature::Kind>(key >> 30); }

// Round-off of a length, in parts of the largest coordinate: points nearer than this to where two features meet belong
// to the smaller feature.
inline constexpr double kRoundOff = 64 * std::numeric_limits<double>::epsilon();

inline Vec3 unit_or(const Vec3& v, const Vec3& otherwise) {
  const double n = v.norm();
  return n > 0.0 ? Vec3(v / n) : otherwise;
}

// One side of a contact, in the pair's frame.
struct FeatureSide {
  FeatureKey key = 0;
  Index triangle = -1;
  std::array<double, 3> weight{0.0, 0.0, 0.0};
  Vec3 point = Vec3::Zero();
};

// gap = normal · (a.point − b.point)
struct FeatureContact {
  FeatureSide a, b;
  Vec3 normal = Vec3::Zero();
  double gap = 0.0;
};

class PairSurface {
 public:
  struct Face {
    TrianglePoints x;
    Vec3 normal;                 // unit; zero if the triangle has no area
    std::array<Vec3, 3> inward;  // unit, in the plane, from edge i into the triangle; zero like the normal
    Aabb box;
  };

  // X_PS: the surface's body frame in the pair's. Forgets the state before.
  // @param tolerance a length that is round-off here, m
  // @param solid_below unit, body frame: up, of the top of something solid (RigidGeometry::up()); zero: of anything
  // else
  void bind(DeformedSurface& deformed, const RigidTransform& X_PS, double tolerance,
            const Vec3& solid_below = Vec3::Zero());

  DeformedSurface& deformed() const { return *deformed_; }
  const CollisionSurface& surface() const { return deformed_->surface(); }
  const RigidTransform& pose() const { return X_PS_; }  // in the pair's frame
  double tolerance() const { return tolerance_; }
  // Directions between points nearer than this are noise; the surface's own normal serves.
  double directionless() const { return directionless_; }
  // Only one of its sides can be touched: it bounds a solid, or is a rigid mesh, which has a front.
  bool sided() const { return sided_; }

  const Vec3& vertex(Index v) {
    const auto i = static_cast<std::size_t>(v);
    if (vertex_stamp_[i] != generation_) make_vertex(v);
    return vertices_[i];
  }
  TrianglePoints corners(Index t) {
    const Triangle& v = surface().triangle(t);
    return {vertex(v[0]), vertex(v[1]), vertex(v[2])};
  }
  const Face& face(Index t) {
    const auto i = static_cast<std::size_t>(t);
    if (face_stamp_[i] != generation_) make_face(t);
    return faces_[i];
  }

  // Each vertex and edge belongs to one triangle, so that what is found for several is looked at once.
  bool owns_vertex(Index t, int corner) const {
    return surface().vertex_triangles(surface().triangle(t)[static_cast<std::size_t>(corner)]).front() == t;
  }
  bool owns_edge(Index t, int corner) const {
    const std::span<const Index> sharing = surface().edge_triangles(surface().edge_of(t, corner));
    return !sharing.empty() && sharing.front() == t;
  }

  // Local minima of the distance from p over the surface, up to `reach`, on the face t and on those of its edges and
  // vertices that it owns (`all`: on any of them); of a sided surface only those in front of which p is.
  // @param visit (const Minimum&)
  //
  // The regions are told by the signs of numbers that neighbouring features share, bit for bit, so that round-off
  // leaves no gap between them: of p against an edge in a triangle's plane, and against the ends of an edge.
  struct Minimum {
    FeatureSide at{};
    Vec3 direction = Vec3::Zero();  // unit, out of the surface, towards p where that is not round-off
    double distance = 0.0;          // direction · (p − at.point)
  };
  template <class Visit>
  void for_each_minimum(const Vec3& p, Index t, double reach, bool all, const Visit& visit);

  // Whether q is on the outer side of any face at v: else the body itself lies between. Always true if not sided.
  bool sees(Index v, const Vec3& q);
  // Whether nothing of the surface near an edge reaches farther along a unit direction than the edge, but for the
  // widening of creases (see narrow_phase.h); of a sided surface, on its outer side.
  bool in_normal_cone(Index e, const Vec3& direction);

  // Whether the surface near a vertex lies in front of it along a unit direction, leaning back by no more than a sine:
  // n · (w − v) ≥ −leaning |w − v| for all its neighbours w. What pushes the vertex along n then pushes the surface.
  bool in_front(Index v, const Vec3& n, double leaning);
  // The same, but behind, for all that meets at a feature.
  bool behind(const FeatureSide& feature, const Vec3& n, double leaning);
  double shortest_edge(Index v);
  Vec3 edge_vector(Index e) { return vertex(surface().edge(e).vertices[1]) - vertex(surface().edge(e).vertices[0]); }

  // How the body is expected to move within the step: of its points to first order, in the pair's frame.
  void expect_motion(const Vec3& displacement, const Vec3& rotation) {
    displacement_ = displacement, rotation_ = rotation;
  }
  Vec3 expected_motion(const Vec3& point) const { return displacement_ + rotation_.cross(point - X_PS_.p); }

  // Faces that meet at a feature, whose key is that of a vertex, an edge or a face.
  template <class Visit>
  void for_faces_at(FeatureKey key, const Visit& visit) {
    const Index index = index_of(key);
    if (kind_of(key) == Feature::Kind::kVertex) {
      for (const Index t : surface().vertex_triangles(index)) visit(t);
    } else if (kind_of(key) == Feature::Kind::kEdge) {
      for (const Index t : surface().edge_triangles(index)) visit(t);
    } else {
      visit(index);
    }
  }

  // Sum of the unit normals at an edge; angle-weighted normal at a vertex. Not of unit length.
  Vec3 edge_normal(Index e);
  Vec3 vertex_normal(Index v);
  Vec3 normal_at(Index t, const Feature& feature);

  FeatureSide at_vertex(Index v);
  // @param fraction along the edge, from its first vertex
  FeatureSide on_edge(Index e, double fraction, const Vec3& point);
  FeatureSide on_face(Index t, const Vec3& point);
  FeatureSide at_foot(Index t, const SurfaceFoot& foot);

  struct Nearest {
    Index triangle = -1;  // −1: nothing nearer than asked for
    SurfaceFoot foot{};
    double distance = 0.0;
    Vec3 outward = Vec3::Zero();  // pseudonormal at the foot
    bool inside = false;          // the point is behind the surface; never where the foot is on a rim, but of
                                  // what is solid below, where that is above
  };
  Nearest nearest(const Vec3& p, double max_distance);
  // Of one triangle: what the nearest point is not beyond.
  double distance_from(Index t, const Vec3& p);
  // Where a ray from a point inside first goes out through a face.
  struct WayOut {
    Index triangle = -1;    // −1: nowhere
    double distance = 0.0;  // along the ray, ≥ 0
  };
  // @param direction unit
  WayOut way_out(const Vec3& p, const Vec3& direction);
  // False only where p is not inside: outside the bounds of a closed surface, under none that is solid below.
  bool may_hold(const Vec3& p) {
    if (!up_.isZero(0.0)) return is_below(p);
    return surface().closed() && deformed_->bounds(0).contains(X_SP_ * p);
  }

 private:
  bool is_below(const Vec3& p) {
    const WayOut way = way_out(p, up_);
    return way.triangle >= 0 && way.distance > tolerance_;
  }
  void make_vertex(Index v);
  void make_face(Index t);
  bool on_rim(Index t, const Feature& feature) const;
  bool edge_minimum(const Vec3& p, Index e, double reach, Minimum& minimum);
  bool vertex_minimum(const Vec3& p, Index v, double reach, Minimum& minimum);
  bool finish(const Vec3& p, const Vec3& outward, double reach, Minimum& minimum) const;

  DeformedSurface* deformed_ = nullptr;
  RigidTransform X_PS_{}, X_SP_{};
  bool sided_ = false;
  Vec3 up_ = Vec3::Zero();  // in the pair's frame
  double tolerance_ = 0.0, directionless_ = 0.0;
  Vec3 displacement_ = Vec3::Zero(), rotation_ = Vec3::Zero();
  std::uint32_t generation_ = 0;
  std::vector<std::uint32_t> vertex_stamp_, face_stamp_;
  std::vector<Vec3> vertices_;
  std::vector<Face> faces_;
};

template <class Visit>
void PairSurface::for_each_minimum(const Vec3& p, Index t, double reach, bool all, const Visit& visit) {
  const Face& f = face(t);
  const double height = f.normal.dot(p - f.x[0]);
  if (std::abs(height) > reach) return;
  std::array<bool, 3> inside;
  for (std::size_t c = 0; c < 3; ++c) inside[c] = (p - f.x[c]).dot(f.inward[c]) > tolerance_;
  Minimum minimum;
  if (inside[0] && inside[1] && inside[2]) {
    if (sided_ && height < -tolerance_) return;
    minimum.direction = height < 0.0 && !sided_ ? Vec3(-f.normal) : f.normal;
    minimum.distance = minimum.direction.dot(p - f.x[0]);
    minimum.at = on_face(t, p - height * f.normal);
    visit(minimum);
    return;
  }
  for (int c = 0; c < 3; ++c) {
    if (!inside[static_cast<std::size_t>(c)] && (all || owns_edge(t, c)) &&
        edge_minimum(p, surface().edge_of(t, c), reach, minimum))
      visit(minimum);
    if ((all || owns_vertex(t, c)) &&
        vertex_minimum(p, surface().triangle(t)[static_cast<std::size_t>(c)], reach, minimum))
      visit(minimum);
  }
}

}  // namespace limber::internal
