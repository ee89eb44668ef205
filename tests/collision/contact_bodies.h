// Bodies for pairs of the narrow phase, and what can be read from any of their contacts.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include "contact_reference.h"
#include "limber/collision/closest_features.h"
#include "limber/collision/collision_surface.h"
#include "limber/collision/deformed_surface.h"
#include "limber/collision/narrow_phase.h"
#include "shapes.h"

namespace limber::testing {

/// A body, once as the narrow phase takes it and once as plain points in the world.
class Body {
 public:
  explicit Body(std::shared_ptr<const ModalModel> model)
      : model_(std::move(model)), surface_(std::make_shared<const CollisionSurface>(model_)) {
    plain_.triangles = model_->collision().triangles;
  }
  explicit Body(const Shape& shape) : geometry_(std::make_unique<RigidGeometry>(shape)) {}

  void place(const RigidTransform& X_WB, std::vector<double> z = {}) {
    pose = X_WB, z_ = std::move(z);
    if (model_ == nullptr) return;
    deformed_.bind(surface_, z_);
    plain_.vertices.clear();
    const Mat3 R = to_matrix(X_WB.q);
    const ModalSurface& s = model_->collision();
    for (Index v = 0; v < s.vertices(); ++v) {
      Vec3 p = s.rest[static_cast<std::size_t>(v)].cast<double>();
      for (Index i = 0; i < model_->modes(); ++i)
        p += z_[static_cast<std::size_t>(i)] * s.basis.shape(v, i).cast<double>();
      plain_.vertices.push_back(R * p + X_WB.p);
    }
  }
  /// Corners and faces of a box in the world; which way its sides are cut into triangles is the geometry's choice.
  void place_box(const RigidTransform& X_WB, const Vec3& half_extents) {
    pose = X_WB;
    const CollisionSurface& s = surface();
    plain_.triangles.clear();
    for (Index t = 0; t < s.triangles(); ++t) plain_.triangles.push_back(s.triangle(t));
    plain_.vertices.clear();
    for (const Vec3& p : shapes::box(-half_extents, half_extents).vertices) {
      ASSERT_EQ(p, s.rest(static_cast<Index>(plain_.vertices.size())));
      plain_.vertices.push_back(to_matrix(X_WB.q) * p + X_WB.p);
    }
  }

  CollisionBody body(Index index) {
    return {index, pose, model_ ? &deformed_ : nullptr, geometry_.get(), volume_.get()};
  }
  const PlainSurface& plain() const { return plain_; }
  const CollisionSurface& surface() const { return surface_ ? *surface_ : *geometry_->surface(); }
  void use_volume() { volume_ = std::make_unique<RestVolume>(model_); }

  RigidTransform pose{};

 private:
  std::shared_ptr<const ModalModel> model_;
  std::shared_ptr<const CollisionSurface> surface_;
  DeformedSurface deformed_;
  std::unique_ptr<RigidGeometry> geometry_;
  std::unique_ptr<RestVolume> volume_;
  std::vector<double> z_;
  PlainSurface plain_;
};

inline std::vector<ContactPoint> contacts_of(Body& a, Body& b, double margin, const NarrowPhaseOptions& options = {}) {
  NarrowPhase narrow(options);
  std::vector<ContactPoint> contacts;
  narrow.find_contacts(a.body(0), b.body(1), margin, Vec3::Zero(), contacts);
  return contacts;
}

inline Vec3 point_a(const ContactPoint& c, const Body& a) { return a.pose * c.a.point_B; }
inline Vec3 point_b(const ContactPoint& c, const Body& b) { return b.pose * c.b.point_B; }

// Features out of an id: two bits of kind and thirty of index, of a in the upper half.
inline std::uint32_t key_of(const ContactPoint& c, int side) {
  return static_cast<std::uint32_t>(side == 0 ? c.id >> 32 : c.id & 0xffffffffu);
}
inline bool is_kind(std::uint32_t key, Feature::Kind kind) { return key >> 30 == static_cast<std::uint32_t>(kind); }
inline Index index_of(std::uint32_t key) { return static_cast<Index>(key & 0x3fffffffu); }

/// What every contact fulfils, whatever the bodies.
inline void expect_well_formed(const std::vector<ContactPoint>& contacts, const Body& a, const Body& b, double margin) {
  std::set<std::uint64_t> ids;
  for (const ContactPoint& c : contacts) {
    ASSERT_TRUE(std::isfinite(c.gap) && c.normal.allFinite() && c.position.allFinite());
    ASSERT_LE(c.gap, margin);
    ASSERT_NEAR(c.normal.norm(), 1.0, 1e-13);
    const Vec3 p = point_a(c, a), q = point_b(c, b);
    ASSERT_NEAR(c.gap, c.normal.dot(p - q), 1e-13);
    ASSERT_LE((c.position - 0.5 * (p + q)).norm(), 1e-13);
    ASSERT_TRUE(ids.insert(c.id).second) << "two contacts with one id";
    for (const ContactSide* side : {&c.a, &c.b}) {
      if (side->triangle < 0) continue;
      ASSERT_NEAR(side->weight[0] + side->weight[1] + side->weight[2], 1.0, 1e-13);
    }
  }
}

}  // namespace limber::testing
