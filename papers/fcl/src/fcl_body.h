// A body as FCL sees it: its points in the world, FCL's tree over their triangles, and FCL's convex shape.
#pragma once

#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/narrowphase/collision_object.h>

#include <memory>
#include <span>
#include <vector>

#include "finder/geometry_cache.h"
#include "limber/collision/aabb.h"
#include "limber/collision/deformed_surface.h"
#include "limber/dynamics/contact_source.h"
#include "narrow/pair_surface.h"

namespace limber::internal {

using FclBox = fcl::AABB<double>;
using FclTree = fcl::BVHModel<FclBox>;

inline FclBox fcl_box(const Aabb& box) { return {box.low, box.high}; }

/// What the broad phase holds of a body: a box that is set, not made from a shape.
class FclPlace final : public fcl::CollisionObject<double> {
 public:
  explicit FclPlace(Index body);
  Index body() const { return body_; }
  void set_box(const Aabb& box) { aabb = fcl_box(box); }

 private:
  Index body_;
};

/// The point of a body nearest to another point, within one triangle (of a ball's or capsule's core: at all).
struct FclFoot {
  FeatureSide at{};  ///< its key is that of the feature that the point lies on
  double distance = 0.0;
};

class FclBody {
 public:
  FclBody(Index index, std::shared_ptr<const ModalGeometry> modal);
  FclBody(Index index, std::shared_ptr<const RigidGeometry> rigid);

  /// Where the body is: makes all its points and refits its tree.
  void place(const RigidTransform& X_WB, std::span<const double> amplitudes);

  Index index() const { return place_.body(); }
  FclPlace& broad() { return place_; }
  const RigidTransform& pose() const { return X_WB_; }
  const ModalGeometry* modal() const { return modal_.get(); }
  const RigidGeometry* rigid() const { return rigid_.get(); }
  Index modes() const { return modal_ ? modal_->surface->modes() : 0; }
  /// Null for half-spaces, balls and capsules.
  const CollisionSurface* surface() const { return surface_.get(); }
  const FclTree* tree() const { return tree_.get(); }
  /// FCL's shape of a ball, capsule, box or hull, else null.
  fcl::CollisionGeometry<double>* convex() const { return convex_.get(); }
  const HalfSpace* half_space() const { return rigid_ ? std::get_if<HalfSpace>(&rigid_->shape()) : nullptr; }
  double diagonal() const { return diagonal_; }
  double radius() const { return radius_; }  ///< of a ball or capsule about its core, else 0
  const Aabb& box() const { return box_; }   ///< world; of half-spaces: without meaning
  /// World; of a core: the centre, or the two ends. Those that no triangle has are none of the body's.
  const Vec3& point(Index v) const { return points_[static_cast<std::size_t>(v)]; }
  Index points() const { return static_cast<Index>(points_.size()); }
  bool is_corner(Index v) const { return surface_ == nullptr || !surface_->vertex_triangles(v).empty(); }
  /// It has an inside, or of an open rigid surface a back.
  bool sided() const { return surface_ != nullptr && (surface_->closed() || rigid_ != nullptr); }
  bool solid() const { return surface_ != nullptr && (surface_->closed() || below_is_solid_); }

  /// A length that is round-off at p.
  double round_off(const Vec3& p) const;
  /// The foot of p in each triangle no farther than `reach`, by triangle.
  void near(const Vec3& p, double reach, std::vector<FclFoot>& feet) const;
  /// The nearest of all. @pre not a half-space
  FclFoot nearest(const Vec3& p) const;
  /// Whether p, whose nearest foot this is, is on the inner side. Always false if not sided().
  bool is_behind(const Vec3& p, const FclFoot& nearest) const;
  /// Outward; the sum of unit normals at an edge, angle-weighted at a vertex. Unit; zero without a surface.
  Vec3 normal_at(FeatureKey key) const;
  Vec3 face_normal(Index t) const;
  /// Triangles whose boxes come near a box.
  void triangles_near(const Aabb& box, std::vector<Index>& triangles) const;

 private:
  void make_tree();
  FclFoot foot_on_core(const Vec3& p) const;
  FclFoot foot_in(Index t, const Vec3& p) const;

  std::shared_ptr<const ModalGeometry> modal_;
  std::shared_ptr<const RigidGeometry> rigid_;
  std::shared_ptr<const CollisionSurface> surface_;
  std::shared_ptr<fcl::CollisionGeometry<double>> convex_;
  std::unique_ptr<FclTree> tree_;
  FclPlace place_;
  DeformedSurface deformed_;
  RigidTransform X_WB_{};
  std::vector<Vec3> points_;
  Aabb box_;
  double radius_ = 0.0, diagonal_ = 0.0;
  bool below_is_solid_ = false;
};

}  // namespace limber::internal
