// Contacts of two rigid convex shapes: one direction, and the faces that meet along it clipped against each other.
#pragma once

#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "convex/convex_core.h"
#include "limber/collision/closest_features.h"
#include "limber/core/rigid_transform.h"
#include "narrow/pair_surface.h"

namespace limber::internal {

// How two bodies are expected to pass each other.
struct Passing {
  Vec3 way = Vec3::Zero();  // of a against b, straight on and evenly, in the frame of a
  double touching = 0.0;    // m: faces that overlap by no more keep them apart nevertheless
  int ground = -1;          // 0 or 1: a or b stands still; −1: neither, or both

  // Whether it brings a nearer to b along a direction, by more than what is at rest may stir.
  bool closes(const Vec3& normal) const { return normal.dot(way) < -1e-3 * touching; }
};

// Tells which directions lead out of something.
class DirectionFilter {
 public:
  virtual ~DirectionFilter() = default;
  virtual bool allows(const Vec3& out) = 0;
};

class ConvexContacts {
 public:
  // Appends, in the frame of a. Where contacts stand in the way of a that a face keeps from b all along it, the
  // contacts are those with this face: a body that slides over flush boxes does not meet their sides.
  // @param X_AB frame of b in that of a
  void find(const ConvexCore& a, const ConvexCore& b, const RigidTransform& X_AB, double margin,
            std::vector<FeatureContact>& contacts, const Passing& passing = {});
  // How far apart those of the last find() are at least that were farther than the margin, m; 0: they were not.
  double apart() const { return apart_; }
  // Of the faces that look along a direction which is known to keep the two apart. @param normal unit, out of b into a
  // @param ground as in Passing
  void find_along(const ConvexCore& a, const ConvexCore& b, const RigidTransform& X_AB, const Vec3& normal,
                  double margin, int ground, std::vector<FeatureContact>& contacts);
  struct TriangleQuery {
    double margin = 0.0;
    Passing passing{};
    bool rim = false;         // its edges and corners may be touched beside its face
    bool face_alone = false;  // it is touched along its normal however deep
    // Faces beyond its convex edges: what is less deep in one of these leaves there.
    struct Plane {
      Vec3 normal = Vec3::Zero();
      double offset = 0.0;
    };
    std::array<Plane, 3> beyond{};
    std::size_t beyond_count = 0;
  };
  // With a triangle of a surface, one-sided: a polytope of three points and one face, in the frame of a, that is left
  // along its normal or where the filter lets it.
  void find_on_triangle(const ConvexCore& a, const ConvexCore& triangle, const TriangleQuery& query,
                        DirectionFilter& leaves, std::vector<FeatureContact>& contacts);

 private:
  // One of the two, in the frame of a.
  struct Side {
    const ConvexCore* core = nullptr;
    RigidTransform pose{};
    std::span<const Vec3> points{}, edge_directions{};
    std::array<Vec3, 3> half_axes{};  // of a box
    bool turned = false;              // false: as the core has it, bit for bit
    std::vector<Vec3> turned_points{}, turned_normals{}, turned_edges{};

    bool is_box() const { return core->half_extents[0] > 0.0; }
    const Vec3& normal(const ConvexFace& f) const {
      return turned ? turned_normals[static_cast<std::size_t>(&f - core->faces.data())] : f.normal;
    }
    double offset(const ConvexFace& f) const { return f.offset + normal(f).dot(pose.p); }
    // How far it extends along an axis to either side of its origin. @pre a box
    double half_width(const Vec3& axis) const {
      return std::abs(axis.dot(half_axes[0])) + std::abs(axis.dot(half_axes[1])) + std::abs(axis.dot(half_axes[2]));
    }
  };
  struct Range {
    double low, high;
  };
  static Range along(const Side& side, const Vec3& axis);
  static double lowest(const Side& side, const Vec3& n) { return along(side, n).low; }
  // A direction out of b, into a, and how far the cores overlap along it; negative where they are apart.
  struct Direction {
    Vec3 normal = Vec3::Zero();
    double depth = std::numeric_limits<double>::infinity();
  };
  struct Deepest {
    Vec3 a, b;
  };
  // A corner of the face that is clipped, with the features that made it, and the line that follows it.
  struct Corner {
    Vec3 point;
    FeatureKey incident, reference;
    Index line;  // ≥ 0: edge of the incident face; < 0: −1 − edge of the reference face
  };

  void load(const ConvexCore& a, const ConvexCore& b, const RigidTransform& X_AB,
            std::vector<FeatureContact>& contacts);
  static void load(Side& side, const ConvexCore& core, const RigidTransform* pose);
  void add(const FeatureSide& a, const FeatureSide& b, const Vec3& normal);
  double least_gap() const;
  double round_off() const;

  void let_pass(const Passing& passing, double margin);
  Direction keeping_apart(const Passing& passing);
  bool faces_tell(double margin);
  void find_by_distance(double margin);
  void touch(const Direction& d, const Deepest* known, double margin);

  template <class Visit>
  void for_faces(const Visit& visit);
  Direction across_faces();
  Direction least_penetration(const Direction& across_faces) const;
  template <class Visit>
  void for_edges(const Visit& visit) const;
  bool leave_triangle(Direction& best, DirectionFilter& leaves);
  double depth_along(const Vec3& normal) const;
  static void take_shallower(Direction& best, const Vec3& normal, double depth, double preference);
  Vec3 across_edges() const;
  Deepest deepest_along(const Direction& d) const;

  void touch_along(const Vec3& normal, double margin);
  int reference_of_like_faces() const;
  static const ConvexFace* facing(const Side& side, const Vec3& out);
  void clip_faces(const Vec3& normal, double margin);
  void load_incident(const Side& side, const Vec3& out);
  void clip_by_edge(const Side& reference, const ConvexFace& face, Index edge);
  void name_cut(Corner& cut, Index line, const Side& reference, const ConvexFace& face, Index edge);

  Side side_[2];
  std::vector<Corner> corners_, clipped_;
  std::vector<double> heights_;  // of corners over what they are clipped to
  std::vector<double> depths_;   // across the faces of both, once asked for
  mutable std::vector<Vec3> moved_;
  std::vector<FeatureContact>* contacts_ = nullptr;
  std::size_t first_ = 0;  // of the contacts of this pair
  int ground_ = -1;
  double apart_ = 0.0;
};

}  // namespace limber::internal
