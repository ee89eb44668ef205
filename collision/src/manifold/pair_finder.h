// What finds the contacts of one pair, by the kinds of its two bodies.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "finder/surface_pool.h"
#include "limber/dynamics/contact_source.h"
#include "manifold/manifold_body.h"
#include "manifold/mesh_contacts.h"
#include "narrow/convex_contacts.h"

namespace limber::internal {

/// A pair as it is asked for. Contacts are told in the frame of a, by feature, each pair of features once.
struct PairQuery {
  Index index_a = -1, index_b = -1;  ///< equal: a body with itself
  const ManifoldBody &a, &b;
  const BodyState &state_a, &state_b;
  RigidTransform X_AB{};
  double reach = 0.0;  ///< m: gaps up to here are wanted
  Passing passing{};
  /// Planes that a, or b, rests on beside the other: what of the other reaches no farther is touched along these alone.
  /// In the frame of a, or of b.
  std::span<const SupportPlane> planes_a{}, planes_b{};
  /// Share of the expected way after which they are so; 0: now.
  double ahead = 0.0;
  /// Of pairs that DeformingPairs finds: where b is expected in the frame of a at the step's end, and the gaps up to
  /// which contacts are wanted beside what the expected motion of their points, and a fall, close, m.
  bool by_fields = false;
  struct {
    RigidTransform X_AB_end{};
    double near = 0.0;
    Vec3 fall = Vec3::Zero();  ///< ContactQuery::fall, frame of a
  } expected{};
};

/// Finds the contacts of pairs in which a surface deforms: what may take the place of NarrowPhase there. Calls of
/// find() come from many threads at once.
class DeformingPairs {
 public:
  virtual ~DeformingPairs() = default;
  virtual void add_body(Index index, const ManifoldBody& body) = 0;
  virtual void remove_body(Index index) = 0;
  /// Once a query, before anything else: all states are checked. @param changed bodies whose state may be another than
  /// in the last query, ascending
  virtual void start_query(std::span<const ManifoldBody> bodies, std::span<const BodyState> states,
                           std::span<const Index> changed, Jobs& jobs) = 0;
  /// Whether it finds the contacts of two bodies, of which one deforms at least.
  virtual bool takes(Index a, Index b) const = 0;
  /// Appends. @pre query.by_fields
  virtual void find(const PairQuery& query, std::vector<FeatureContact>& found) = 0;
  /// Whether it has a body's coordinates, and then: what holds its surface, how far modes are expected to move any
  /// point of it, m, and where a point of it is; body frame.
  virtual bool has(Index body) const = 0;
  virtual Aabb bounds(Index body) const = 0;
  virtual double largest_swing(Index body) const = 0;
  virtual Vec3 place(Index body, const FeatureSide& side) const = 0;
  /// What the expected motion and a fall close of a contact's gap, m. @param points, normal in the frames of a, b and a
  virtual double closing(const PairQuery& query, const FeatureContact& contact) const = 0;
};

/// Finds the contacts of all pairs; the scratch of one thread.
class PairFinder {
 public:
  explicit PairFinder(const NarrowPhaseOptions& options) : narrow_(options) {}

  void start_query(DeformingPairs* deforming) { pool_.start_query(), deforming_ = deforming; }
  const DeformingPairs* deforming() const { return deforming_; }
  /// Until the next call. Of rigid pairs at most kManifoldPoints to a patch.
  /// @param last feature_pair() of those of the last manifold
  std::span<const FeatureContact> find(const PairQuery& query, std::span<const std::uint64_t> last);

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
  DeformingPairs* deforming_ = nullptr;
  std::vector<ContactPoint> contacts_;
  std::vector<FeatureContact> found_;
};

}  // namespace limber::internal
