// What finds the contacts of one pair, by the kinds of its two bodies.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "field/field_pairs.h"
#include "finder/surface_pool.h"
#include "manifold/mesh_contacts.h"
#include "narrow/convex_contacts.h"

namespace limber::internal {

/// Finds the contacts of all pairs; the scratch of one thread.
class PairFinder {
 public:
  explicit PairFinder(const NarrowPhaseOptions& options) : narrow_(options) {}

  /// @param fields know the states of this query, and last as long as it
  void start_query(const FieldPairs* fields) { pool_.start_query(), fields_ = fields; }
  const FieldPairs& fields() const { return *fields_; }
  /// Until the next call. Of rigid pairs at most kManifoldPoints to a patch.
  /// @param last feature_pair() of those of the last manifold
  std::span<const FeatureContact> find(const PairQuery& query, std::span<const std::uint64_t> last);

  /// How far apart the two of the last find() are at least where that is farther than they were to be looked at, m; 0:
  /// not known.
  double apart() const { return apart_; }

  /// A body that deforms, in its state of this query.
  DeformedSurface& surface(Index index, const ManifoldBody& body, const BodyState& state) {
    return pool_.get(index, body.modal->surface, state.amplitudes);
  }

 private:
  void between_convex(const PairQuery& query, const ConvexCore& a, const ConvexCore& b);
  void against_ground(const PairQuery& query, const ManifoldBody& body, const ManifoldBody& ground,
                      const RigidTransform& X_BG, const Vec3& way);
  void keep_each_once();
  void by_narrow_phase(const PairQuery& query);
  enum class Side { kA, kB };
  CollisionBody collision_body(const PairQuery& query, Side side);
  DeformedSurface& surface_of(const PairQuery& query, Side side);

  ConvexContacts convex_;
  MeshContacts mesh_contacts_;
  DeformedSurface rigid_;  // that does not
  PairSurface mesh_;
  NarrowPhase narrow_;
  SurfacePool pool_;
  std::array<DeformedSurface, 2> ahead_;  // of a pair that is on its way
  const FieldPairs* fields_ = nullptr;
  FieldContacts field_contacts_;
  std::vector<ContactPoint> contacts_;
  std::vector<FeatureContact> found_;
  double apart_ = 0.0;
};

}  // namespace limber::internal
