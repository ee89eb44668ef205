// How ManifoldFinder works inside.
//
//   manifold_finder.cpp    bodies, near pairs, what is told of a manifold
//   manifold_making.cpp    manifolds: kept, made, followed to where bodies touch on their way
//   manifold_seams.cpp     planes that a body rests on beside what it touches
#pragma once

#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "field/field_pairs.h"
#include "finder/body_register.h"
#include "finder/worker_pool.h"
#include "limber/collision/manifold_finder.h"
#include "manifold/contact_graph.h"
#include "manifold/pair_finder.h"
#include "manifold/swept_path.h"

namespace limber {
namespace internal {

/// What one thread works with.
struct ManifoldWorker {
  explicit ManifoldWorker(const NarrowPhaseOptions& options) : pairs(options) {}
  PairFinder pairs;
  SweptPath path{};
  DeformedSurface root{};  // for boxes of whole bodies
  std::vector<std::uint64_t> last{};
  std::vector<KeptPoint> made{};  // a manifold under way
  std::vector<double> gaps{};     // of these, where they were found
};
using ManifoldWorkers = WorkerPool<ManifoldWorker>;

}  // namespace internal

struct ManifoldFinder::Impl {
  explicit Impl(const ManifoldFinderOptions& o) : options(o) { options.validate(); }

  ManifoldFinderOptions options;
  struct {
    internal::GeometryCache surfaces;
    internal::SharedByKey<Shape, internal::ManifoldShape> shapes;
  } geometry;
  internal::BodyRegister<internal::ManifoldBody> bodies{"ManifoldFinder"};
  internal::ContactGraph graph;
  internal::FieldPairs fields;
  internal::ManifoldWorkers workers;

  struct Measured {
    Vec3 normal, p_a, p_b;  ///< world; points from the origin of a
    double gap;
  };
  /// A kept point where it is, and the least that its gap comes to by the expected motion.
  struct Touch {
    Measured at;
    double lowest;
  };
  /// A plane that a body touches along from in front, in one of its pairs: out · x ≥ offset, x from its origin, world.
  struct Support {
    Vec3 out;
    double offset, lowest;  ///< the latter as that of a touch
    std::size_t pair;
  };

  // Of the query under way.
  ContactQuery query;
  struct {
    std::vector<Index> bodies;  ///< whose place may be another
    std::vector<Aabb> boxes;
  } placing;
  std::vector<BodyPair> pairs;
  std::vector<std::uint8_t> recycled;  ///< by pair
  struct {
    std::vector<std::size_t> pairs_of, first_pair_of;  ///< by body: of which pairs it is
    std::vector<Touch> touches;
    std::vector<Support> supports;
    std::vector<std::pair<std::size_t, std::size_t>> touches_of;   ///< by pair: first and end, once asked for
    std::vector<std::pair<std::size_t, std::size_t>> supports_of;  ///< by body, likewise
    std::vector<internal::SupportPlane> planes_a, planes_b;
    std::vector<Vec3> own_normals;  ///< of the pair whose planes are sought, into the body that they are sought for
  } seams;
  struct {
    std::vector<std::size_t> first_of, counts;  ///< by pair: of its contacts, and how many
  } written;
  Counts told;

  internal::ManifoldBody& at(Index body) { return bodies[body]; }
  const internal::ManifoldBody& at(Index body) const { return bodies[body]; }
  const BodyState& state(Index body) const { return query.states[static_cast<std::size_t>(body)]; }

  void make_boxes(Jobs& jobs);
  Aabb swept_box(Index body) const;
  void place();
  void find_near_pairs(Jobs& jobs);
  bool by_fields(const BodyPair& pair) const {
    return (at(pair.a).modal || at(pair.b).modal) && fields.takes(pair.a, pair.b);
  }
  internal::PairQuery query_of(const BodyPair& pair) const;
  void find_manifolds(Jobs& jobs);
  bool keeps(const internal::LivePair& pair, const internal::PairQuery& query) const;
  static double way(const internal::PairQuery& query, const RigidTransform& from, const RigidTransform& to);
  double comes(const internal::PairQuery& query) const;
  bool hardly_moved(const internal::PairQuery& query, const RigidTransform& from, const RigidTransform& to) const;
  bool lasts(const internal::PairQuery& query) const;
  void expect(internal::PairQuery& query) const;
  void make(internal::LivePair& pair, const internal::PairQuery& query, internal::ManifoldWorker& worker);
  void follow(internal::ManifoldWorker& worker) const;
  static void touch(std::span<const internal::FeatureContact> found, const internal::PairQuery& query,
                    internal::ManifoldWorker& worker);
  void keep(std::span<const internal::FeatureContact> found, const internal::PairQuery& query,
            internal::ManifoldWorker& worker) const;
  static void keep(const internal::FeatureContact& contact, double round_a, double round_b,
                   const internal::PairQuery& query, internal::ManifoldWorker& worker);
  static void keep_inner_balls(const internal::FeatureContact& deepest, const internal::PairQuery& query,
                               internal::ManifoldWorker& worker);
  internal::FeatureContact feature_contact(const Measured& measured, const internal::KeptPoint& point,
                                           const BodyPair& pair) const;
  Measured measure(const internal::KeptPoint& point, const BodyPair& pair, internal::ManifoldWorker& worker) const;
  void level_seams();
  void list_touches(std::size_t pair, internal::ManifoldWorker& worker);
  std::span<const Touch> touches_of(std::size_t pair, internal::ManifoldWorker& worker);
  std::span<const Touch> listed_touches(std::size_t pair) const;
  void list_supports(Index body, internal::ManifoldWorker& worker);
  std::span<const Support> supports_of(Index body, internal::ManifoldWorker& worker);
  bool touches_along(const Vec3& out) const;
  void list_pairs_of_bodies();
  void find_planes(std::size_t pair, Index body, internal::ManifoldWorker& worker,
                   std::vector<internal::SupportPlane>& planes);
  bool reaches_to(Index body, const Vec3& normal, double offset, double tolerance) const;
  double reach(Index body, const Vec3& along) const;
  double farthest(const internal::PairQuery& query) const;
  double slack(const internal::PairQuery& query) const;
  void write_contacts(std::vector<ContactPoint>& contacts, Jobs& jobs);
  std::size_t write(std::size_t pair, internal::ManifoldWorker& worker, ContactPoint* to) const;
};

}  // namespace limber
