/// @file limber/dynamics/contact_source.h
/// The door between those who find contacts (collision/, or your own) and those who answer them (constraints/,
/// engine/). Neither knows the other: poses, shapes and amplitudes go in, contact points come out.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "limber/core/jobs.h"
#include "limber/core/rigid_transform.h"
#include "limber/core/stage_times.h"
#include "limber/core/state_archive.h"
#include "limber/model/modal_model.h"
#include "limber/model/shape.h"

namespace limber {

/// The geometry that others meet: exactly one of the two.
struct BodyGeometry {
  std::shared_ptr<const ModalModel> model{};  ///< its collision surface, which deforms with the amplitudes
  std::shared_ptr<const Shape> shape{};       ///< a rigid shape, in the body frame
  bool skin = false;                          ///< the surface bends by the model's modal skin
};

/// Two bodies meet only if each one's layers have a bit in common with the other's mask.
struct CollisionFilter {
  std::uint32_t layers = 1;
  std::uint32_t mask = 0xffffffffu;
  bool self = false;  ///< also find where the body touches itself (modal bodies with a volume block)

  friend bool operator==(const CollisionFilter&, const CollisionFilter&) = default;
};

/// State of one body at one instant.
struct BodyState {
  RigidTransform pose{};                 ///< X_WB
  std::span<const double> amplitudes{};  ///< z, k numbers; none for a rigid shape
  /// How far any of its points may come until the next query beside `displacement`, m, ≥ 0:
  ///   p(t) = p(0) + t/T displacement + e(t),   |e| ≤ reach.
  /// Contacts of all that such motions may bring together (or within the query's margin) are found, so what a step may
  /// bring together is there before it.
  double reach = 0.0;
  /// The motion expected until the next query: of the body origin, m, straight on and evenly; and the rotation vector,
  /// rad; world. For two bodies that move on together only their reaches count. By both a source may choose
  /// normals of what is apart but would be passed; the rotation counts for nothing else.
  Vec3 displacement = Vec3::Zero(), rotation = Vec3::Zero();
  /// Its expected state at the next query. Its points are expected to go there straight on and evenly, and come
  /// no farther than `doubt` beside: contacts that this keeps apart need not be found. m, ≥ 0; infinite: nothing is
  /// expected, and the other two are not read.
  double doubt = std::numeric_limits<double>::infinity();
  RigidTransform end_pose{};
  std::span<const double> end_amplitudes{};  ///< as many as amplitudes
  bool asleep = false;  ///< has not moved since the last query; two that sleep are not tested with each other

  double way() const { return displacement.norm() + reach; }  ///< how far any of its points may come in all, m
};

struct ContactQuery {
  std::span<const BodyState> states{};  ///< by body index; entries of indices that hold no body are not read
  double margin = 0.0;                  ///< m, ≥ 0: gaps up to here are contacts
  Vec3 origin = Vec3::Zero();           ///< world; positions come out relative to it
  /// Gravity moves any body by so much or not at all until the next query, beside its `doubt`, as something holds it or
  /// not; `reach` has it. Of two bodies the difference counts. World, m.
  Vec3 fall = Vec3::Zero();
  /// Ascending; none: not known. Otherwise all others are as they were in the last query, which they slept in: what a
  /// source may pass over without a look.
  std::span<const Index> awake{};
  StageTimes* times = nullptr;  ///< a source may add what it spends on its stages; null: nobody asks
};

/// One body's side of a contact.
struct ContactSide {
  Index body = -1;
  /// On the body's collision surface (SurfacePoint::Surface::kCollision); −1 for a rigid shape, which has no modal row.
  Index triangle = -1;
  std::array<double, 3> weight{0.0, 0.0, 0.0};  ///< barycentric, sums to 1; zeros for a rigid shape
  Vec3 point_B = Vec3::Zero();                  ///< the point, deformed, in the body frame, m
  /// m, > 0: the surface about the point is that of a ball of this radius (of rigid shapes: spheres, capsules). As the
  /// body turns, what it touches with is another point of it, always this far from the ball's centre against the
  /// normal.
  double radius = 0.0;
};

/// Two points that are, or may come, together:  gap = normal · (p_a − p_b), negative where the bodies overlap.
/// To first order the gap changes by normal · (u_a − u_b), u the displacements of the two points.
struct ContactPoint {
  ContactSide a, b;              ///< a.body ≤ b.body; equal where a body touches itself
  Vec3 normal = Vec3::Zero();    ///< unit, world, out of b into a: a is pushed along it, b against it
  Vec3 position = Vec3::Zero();  ///< midway between both points, world, less the query's origin
  double gap = 0.0;              ///< m
  /// The same features of the same bodies have the same id in every query; different ones differ within a query.
  std::uint64_t id = 0;
};

/// Finds contacts. Same calls, same contacts in the same order, for any Jobs. Once warm, a query allocates nothing.
class ContactSource {
 public:
  virtual ~ContactSource() = default;

  /// @param body any index ≥ 0 that holds none. @throws InvalidArgument for one that does, or a bad geometry
  virtual void add_body(Index body, const BodyGeometry& geometry, const CollisionFilter& filter) = 0;
  virtual void remove_body(Index body) = 0;
  virtual void set_filter(Index body, const CollisionFilter& filter) = 0;
  /// Bodies that never meet each other, such as neighbours at a joint. Forgotten when either is removed.
  virtual void exclude_pair(Index a, Index b, bool excluded) = 0;

  /// Replaces `contacts`, ordered by (a.body, b.body, id).
  /// @throws InvalidArgument for a state that is not finite or has the wrong number of amplitudes; nothing changes then
  virtual void find_contacts(const ContactQuery& query, std::vector<ContactPoint>& contacts, Jobs& jobs) = 0;

  /// Appends what the contacts of coming queries depend on beside the queries themselves, and restore_state() takes it
  /// back; nothing, for a source that remembers nothing. Bodies and pairs that are excluded are no part of it.
  virtual void save_state(StateWriter&) const {}
  /// Bodies may then be elsewhere than in the last query, those that are asleep too.
  virtual void restore_state(StateReader&) {}
};

}  // namespace limber
