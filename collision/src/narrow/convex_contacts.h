// Contacts of two rigid convex shapes: one direction, and the faces that meet along it clipped against each other.
#pragma once

#include <limits>
#include <vector>

#include "convex/convex_core.h"
#include "limber/collision/closest_features.h"
#include "limber/core/rigid_transform.h"
#include "narrow/pair_surface.h"

namespace limber::internal {

class ConvexContacts {
 public:
  // Appends, in the frame of a. @param X_AB frame of b in that of a
  void find(const ConvexCore& a, const ConvexCore& b, const RigidTransform& X_AB, double margin,
            std::vector<FeatureContact>& contacts);

 private:
  // One of the two, in the frame of a.
  struct Side {
    const ConvexCore* core = nullptr;
    RigidTransform pose{};
    std::vector<Vec3> points{}, normals{}, edge_directions{};  // the second: of the faces

    const Vec3& normal(const ConvexFace& f) const { return normals[static_cast<std::size_t>(&f - core->faces.data())]; }
    double offset(const ConvexFace& f) const { return f.offset + normal(f).dot(pose.p); }
  };
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

  static void load(Side& side, const ConvexCore& core, const RigidTransform* pose);
  void add(const FeatureSide& a, const FeatureSide& b, const Vec3& normal);
  double least_gap() const;
  double round_off() const;

  bool faces_tell(double margin);
  void find_by_distance(double margin);
  void touch(const Direction& d, const Deepest* known, double margin);

  Direction across_faces() const;
  Direction least_penetration() const;
  double depth_along(const Vec3& normal) const;
  static void take_shallower(Direction& best, const Vec3& normal, double depth, double preference);
  Vec3 across_edges() const;
  Deepest deepest_along(const Direction& d) const;

  void touch_along(const Vec3& normal, double margin);
  static const ConvexFace* facing(const Side& side, const Vec3& out);
  void clip_faces(const Vec3& normal, double margin);
  void load_incident(const Side& side, const Vec3& out);
  void clip_by_edge(const Side& reference, const ConvexFace& face, Index edge);
  static void name_cut(Corner& cut, Index line, const ConvexFace& face, Index edge);

  Side side_[2];
  std::vector<Corner> corners_, clipped_;
  mutable std::vector<Vec3> moved_;
  std::vector<FeatureContact>* contacts_ = nullptr;
  std::size_t first_ = 0;  // of the contacts of this pair
};

}  // namespace limber::internal
