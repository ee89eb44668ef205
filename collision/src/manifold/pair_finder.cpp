#include "manifold/pair_finder.h"

#include <algorithm>
#include <utility>

#include "manifold/manifold_points.h"
#include "narrow/primitive_contacts.h"

namespace limber::internal {
namespace {

/// The same seen from the other body, in its frame. @param X_AB of the frame in which it was found in the other's
FeatureContact exchanged(const FeatureContact& c, const RigidTransform& X_AB) {
  FeatureContact r{c.b, c.a, X_AB.q * -c.normal, c.gap};
  r.a.point = X_AB * r.a.point, r.b.point = X_AB * r.b.point;
  return r;
}

}  // namespace

std::span<const FeatureContact> PairFinder::find(const PairQuery& q, std::span<const std::uint64_t> last) {
  found_.clear();
  apart_ = 0.0;
  const ConvexCore *core_a = q.a.core(), *core_b = q.b.core();
  if (core_a != nullptr && core_b != nullptr) {
    between_convex(q, *core_a, *core_b);
  } else if (core_a != nullptr && q.b.rigid) {
    against_ground(q, q.a, q.b, q.X_AB, q.passing.way);
  } else if (core_b != nullptr && q.a.rigid) {
    against_ground(q, q.b, q.a, q.X_AB.inverse(), q.X_AB.q.conjugate() * -q.passing.way);
    for (FeatureContact& c : found_) c = exchanged(c, q.X_AB);
  } else if (q.by_fields) {
    fields_->find(q, field_contacts_, found_);
    if (q.expected.parting != nullptr) apart_ = q.expected.parting->gap;
  } else {
    by_narrow_phase(q);
  }
  keep_each_once();
  if (!q.a.modal && !q.b.modal) keep_manifold_points(found_, last);
  return found_;
}

/// Ascending by features; of what two features have twice, the deeper.
void PairFinder::keep_each_once() {
  std::sort(found_.begin(), found_.end(), [](const FeatureContact& c, const FeatureContact& d) {
    return std::pair(feature_pair(c), c.gap) < std::pair(feature_pair(d), d.gap);
  });
  const auto end = std::unique(found_.begin(), found_.end(), [](const FeatureContact& c, const FeatureContact& d) {
    return feature_pair(c) == feature_pair(d);
  });
  found_.erase(end, found_.end());
}

void PairFinder::between_convex(const PairQuery& q, const ConvexCore& a, const ConvexCore& b) {
  if (!q.planes_a.empty() || !q.planes_b.empty())
    return convex_.find_along(
        a, b, q.X_AB, q.planes_a.empty() ? Vec3(q.X_AB.q * -q.planes_b.front().normal) : q.planes_a.front().normal,
        q.reach, q.passing.ground, found_);
  convex_.find(a, b, q.X_AB, q.reach, found_, q.passing);
  apart_ = convex_.apart();
}

/// A convex body and a half-space or a mesh, in the frame of the former, which is a of each contact.
/// @param way of the body against the ground
void PairFinder::against_ground(const PairQuery& q, const ManifoldBody& body, const ManifoldBody& ground,
                                const RigidTransform& X_BG, const Vec3& way) {
  if (const HalfSpace* plane = ground.half_space()) {
    const Vec3 normal = X_BG.q * plane->normal;
    return half_space_contacts(*body.core(), normal, plane->offset + normal.dot(X_BG.p), q.reach, found_);
  }
  const RigidGeometry& geometry = ground.rigid->geometry;
  rigid_.bind(geometry.surface(), {});
  const double size = internal::farthest_of(geometry.bounds()) + body.radius + X_BG.p.norm();
  mesh_.bind(rigid_, X_BG, kRoundOff * size, geometry.up());
  const bool is_a = &body == &q.a;
  mesh_contacts_.find(
      {*body.core(), mesh_, *ground.rigid->facets, q.reach, {way, q.passing.touching}, is_a ? q.planes_a : q.planes_b},
      found_);
}

DeformedSurface& PairFinder::surface_of(const PairQuery& q, Side side) {
  const bool is_a = side == Side::kA;
  const ManifoldBody& body = is_a ? q.a : q.b;
  const BodyState& state = is_a ? q.state_a : q.state_b;
  if (q.ahead == 0.0) return surface(is_a ? q.index_a : q.index_b, body, state);
  DeformedSurface& ahead = ahead_[is_a ? 0 : 1];
  ahead.bind(body.modal->surface, state.amplitudes);
  return ahead;
}

CollisionBody PairFinder::collision_body(const PairQuery& q, Side side) {
  const bool is_a = side == Side::kA;
  const ManifoldBody& body = is_a ? q.a : q.b;
  const BodyState& state = is_a ? q.state_a : q.state_b;
  CollisionBody result{.index = is_a ? q.index_a : q.index_b, .X_WB = state.pose};
  result.displacement = state.displacement, result.rotation = state.rotation;
  result.left_alone = q.passing.touching;
  if (body.modal) {
    result.surface = &surface_of(q, side);
    result.volume = body.modal->volume ? &*body.modal->volume : nullptr;
  } else {
    result.geometry = &body.rigid->geometry;
  }
  return result;
}

void PairFinder::by_narrow_phase(const PairQuery& q) {
  contacts_.clear();
  const CollisionBody a = collision_body(q, Side::kA);
  if (q.index_a == q.index_b)
    narrow_.find_self_contacts(a, q.reach, q.state_a.pose.p, contacts_);
  else
    narrow_.find_contacts(a, collision_body(q, Side::kB), q.reach, q.state_a.pose.p, contacts_);
  const Quaternion to_a = q.state_a.pose.q.conjugate();
  for (const ContactPoint& c : contacts_)
    found_.push_back({{static_cast<FeatureKey>(c.id >> 32), c.a.triangle, c.a.weight, c.a.point_B},
                      {static_cast<FeatureKey>(c.id), c.b.triangle, c.b.weight, q.X_AB * c.b.point_B},
                      to_a * c.normal,
                      c.gap});
}

}  // namespace limber::internal
