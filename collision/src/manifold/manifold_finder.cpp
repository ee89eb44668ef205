#include "limber/collision/manifold_finder.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "field/field_pairs.h"
#include "finder/body_register.h"
#include "finder/contact_id.h"
#include "finder/worker_pool.h"
#include "limber/core/error.h"
#include "manifold/contact_graph.h"
#include "manifold/manifold_points.h"
#include "manifold/pair_finder.h"
#include "manifold/swept_path.h"
#include "tuning.h"

namespace limber {

using internal::ContactGraph;
using internal::FeatureContact;
using internal::FeatureSide;
using internal::KeptPoint;
using internal::LivePair;
using internal::ManifoldBody;
using internal::PairFinder;
using internal::PairQuery;

namespace {

constexpr double kSameNormal = 1e-3;                   // length of the difference of two normals that are one
constexpr internal::FeatureKey kInside = 0xffffffffu;  // a body's inner ball: of a kind that no feature has

/// What one thread works with.
struct ManifoldWorker {
  explicit ManifoldWorker(const NarrowPhaseOptions& options) : pairs(options) {}
  PairFinder pairs;
  internal::SweptPath path{};
  DeformedSurface root{};  // for boxes of whole bodies
  std::vector<std::uint64_t> last{};
  std::vector<KeptPoint> made{};  // a manifold under way
  std::vector<double> gaps{};     // of these, where they were found
};
using ManifoldWorkers = internal::WorkerPool<ManifoldWorker>;

}  // namespace

void ManifoldFinderOptions::validate() const {
  for (const auto& [name, value] : {std::pair("recycle_distance", recycle_distance),
                                    std::pair("recycle_turn", recycle_turn), std::pair("flush", flush)})
    if (!(value >= 0.0 && value <= 0.1))
      throw InvalidArgument("ManifoldFinderOptions: " + std::string(name) + " is " + std::to_string(value) +
                            ", expected 0 to 0.1");
}

struct ManifoldFinder::Impl {
  explicit Impl(const ManifoldFinderOptions& o) : options(o) {
    options.validate();
    if (options.distance_fields) deforming = std::make_unique<internal::FieldPairs>();
  }

  ManifoldFinderOptions options;
  internal::GeometryCache geometries;
  internal::SharedByKey<Shape, internal::ManifoldShape> shapes;
  internal::BodyRegister<ManifoldBody> bodies{"ManifoldFinder"};
  ContactGraph graph;
  std::unique_ptr<internal::DeformingPairs> deforming;  ///< null: NarrowPhase finds all contacts of what deforms
  ManifoldWorkers workers;

  // Of the query under way.
  ContactQuery query;
  std::vector<Index> to_place;
  std::vector<Aabb> boxes;  ///< by entry of to_place
  std::vector<BodyPair> pairs;
  std::vector<std::uint8_t> recycled;                ///< by pair
  std::vector<std::size_t> pairs_of, first_pair_of;  ///< by body: of which pairs it is
  std::vector<internal::SupportPlane> planes_a, planes_b;
  std::vector<Vec3> own_normals;  ///< of the pair whose planes are sought, into the body that they are sought for
  std::vector<std::size_t> first_of, counts;  ///< by pair: of its contacts, and how many
  Counts told;

  ManifoldBody& at(Index body) { return bodies[body]; }
  const ManifoldBody& at(Index body) const { return bodies[body]; }
  const BodyState& state(Index body) const { return query.states[static_cast<std::size_t>(body)]; }

  void make_boxes(Jobs& jobs);
  Aabb swept_box(Index body) const;
  void place();
  void find_near_pairs(Jobs& jobs);
  bool by_fields(const BodyPair& pair) const {
    return deforming && (at(pair.a).modal || at(pair.b).modal) && deforming->takes(pair.a, pair.b);
  }
  PairQuery query_of(const BodyPair& pair) const;
  void find_manifolds(Jobs& jobs);
  bool keeps(const LivePair& pair, const PairQuery& query) const;
  bool keeps_motion(const LivePair& pair, const PairQuery& query) const;
  bool hardly_moved(const PairQuery& query, const RigidTransform& from, const RigidTransform& to) const;
  bool lasts(const PairQuery& query) const;
  void expect(PairQuery& query) const;
  void make(LivePair& pair, const PairQuery& query, ManifoldWorker& worker);
  void follow(ManifoldWorker& worker) const;
  static void touch(std::span<const FeatureContact> found, const PairQuery& query, ManifoldWorker& worker);
  void keep(std::span<const FeatureContact> found, const PairQuery& query, ManifoldWorker& worker) const;
  static void keep(const FeatureContact& contact, double round_a, double round_b, const PairQuery& query,
                   ManifoldWorker& worker);
  static void keep_inner_balls(const FeatureContact& deepest, const PairQuery& query, ManifoldWorker& worker);
  struct Measured {
    Vec3 normal, p_a, p_b;  ///< world; points from the origin of a
    double gap;
  };
  FeatureContact feature_contact(const Measured& measured, const KeptPoint& point, const BodyPair& pair) const;
  Measured measure(const KeptPoint& point, const BodyPair& pair, ManifoldWorker& worker) const;
  void level_seams();
  Vec3 out_of_other(const KeptPoint& point, const BodyPair& pair, Index body) const;
  bool touches_along(const Vec3& out) const;
  void list_pairs_of_bodies();
  void find_planes(std::size_t pair, Index body, std::vector<internal::SupportPlane>& planes, ManifoldWorker& worker);
  bool reaches_to(Index body, const Vec3& normal, double offset, double tolerance) const;
  RigidTransform smaller_in_larger(const PairQuery& query, const RigidTransform& X_AB) const;
  double farthest(const PairQuery& query) const;
  double slack(const PairQuery& query) const;
  void write_contacts(std::vector<ContactPoint>& contacts, Jobs& jobs);
  std::size_t write(const LivePair& live, const BodyPair& pair, ManifoldWorker& worker, ContactPoint* to) const;
};

// -- Bodies in the broad phase ----------------------------------------------------------------------------------------

/// About all that a deforming body is expected to pass through until the next query, straight on.
Aabb ManifoldFinder::Impl::swept_box(Index body) const {
  const BodyState& s = state(body);
  const Aabb bounds = deforming->bounds(body);
  Aabb box = internal::world_box(bounds, s.pose);
  box.include(internal::world_box(bounds.grown(deforming->largest_swing(body)), s.end_pose));
  return box.grown(s.doubt + query.fall.norm());
}

/// About all that a body may pass through until the next query.
void ManifoldFinder::Impl::make_boxes(Jobs& jobs) {
  boxes.resize(to_place.size());
  jobs.parallel_for(to_place.size(), internal::collision_tuning().finder.bodies_per_chunk,
                    [this](std::size_t begin, std::size_t end) {
                      const ManifoldWorkers::Lease worker(workers);
                      for (std::size_t i = begin; i < end; ++i) {
                        const ManifoldBody& body = at(to_place[i]);
                        const BodyState& s = state(to_place[i]);
                        if (body.half_space() != nullptr) continue;
                        if (body.modal)
                          internal::bind_state("ManifoldFinder", to_place[i], (*worker).root, body.modal->surface,
                                               s.amplitudes);
                        Aabb& box = boxes[i];
                        if (body.modal && deforming && deforming->has(to_place[i]) && std::isfinite(s.doubt)) {
                          box = swept_box(to_place[i]);
                          continue;
                        }
                        box = body.modal ? internal::world_box((*worker).root.bounds(0), s.pose)
                                         : internal::world_box(body.rigid->geometry, s.pose);
                        box.include(Aabb{box.low + s.displacement, box.high + s.displacement});
                        box = box.grown(s.reach);
                      }
                    });
}

void ManifoldFinder::Impl::place() {
  BroadPhase& broad_phase = bodies.broad_phase();
  for (std::size_t i = 0; i < to_place.size(); ++i) {
    const Index index = to_place[i];
    ManifoldBody& body = at(index);
    const BodyState& s = state(index);
    if (const HalfSpace* shape = body.half_space()) {
      HalfSpace plane = internal::world_half_space(*shape, s.pose);
      plane.offset += s.reach + std::max(0.0, plane.normal.dot(s.displacement));
      broad_phase.set_half_space(index, plane);
    } else {
      broad_phase.set_box(index, boxes[i]);
    }
    body.pose = s.pose, body.turn = to_matrix(s.pose.q);
    body.displacement = s.displacement, body.reach = s.reach;
    body.placed_asleep = s.asleep;
    broad_phase.set_asleep(index, s.asleep);
  }
}

void ManifoldFinder::Impl::find_near_pairs(Jobs& jobs) {
  bodies.list_to_place(query, to_place);
  workers.start_query(
      jobs.concurrency(), [this] { return std::make_unique<ManifoldWorker>(options.narrow_phase); },
      [this](ManifoldWorker& worker) { worker.pairs.start_query(deforming.get()); });
  if (deforming) deforming->start_query(bodies.all(), query.states, to_place, jobs);
  make_boxes(jobs);
  place();
  bodies.find_pairs(query, pairs, jobs);
}

// -- Manifolds --------------------------------------------------------------------------------------------------------

PairQuery ManifoldFinder::Impl::query_of(const BodyPair& pair) const {
  const ManifoldBody &a = at(pair.a), &b = at(pair.b);
  PairQuery q{.index_a = pair.a, .index_b = pair.b, .a = a, .b = b, .state_a = state(pair.a), .state_b = state(pair.b)};
  const Quaternion to_a = a.pose.q.conjugate();
  q.X_AB = {to_a * b.pose.q, to_a * (b.pose.p - a.pose.p)};
  q.passing = {to_a * (a.displacement - b.displacement), options.flush * std::min(a.thickness, b.thickness)};
  if (a.placed_asleep != b.placed_asleep) q.passing.ground = a.placed_asleep ? 0 : 1;
  q.reach = query.margin + a.reach + b.reach + q.passing.way.norm();
  if (by_fields(pair)) expect(q);
  return q;
}

/// Bodies that nobody expects anything of go straight on, and come as far as they may.
void ManifoldFinder::Impl::expect(PairQuery& q) const {
  const auto end_of = [](const BodyState& s) {
    return std::isfinite(s.doubt) ? s.end_pose : RigidTransform{s.pose.q, s.pose.p + s.displacement};
  };
  const auto beside = [](const BodyState& s) { return std::isfinite(s.doubt) ? s.doubt : s.reach; };
  q.by_fields = true;
  q.X_AB_end = end_of(q.state_a).inverse() * end_of(q.state_b);
  q.near = query.margin + beside(q.state_a) + beside(q.state_b);
  q.fall = q.state_a.pose.q.conjugate() * query.fall;
}

RigidTransform ManifoldFinder::Impl::smaller_in_larger(const PairQuery& q, const RigidTransform& X_AB) const {
  return q.a.radius <= q.b.radius ? X_AB.inverse() : X_AB;
}

double ManifoldFinder::Impl::farthest(const PairQuery& q) const {
  return options.recycle_distance * std::min(q.a.thickness, q.b.thickness);
}

/// How far points of one body may come against the other while a manifold is kept: by what it moves, turns and bends;
/// by fields also what more their motion closes.
double ManifoldFinder::Impl::slack(const PairQuery& q) const {
  const double parts = q.by_fields ? 3.0 : q.a.modal || q.b.modal ? 2.0 : 1.0;
  return parts * farthest(q) + options.recycle_turn * std::min(q.a.radius, q.b.radius);
}

namespace {

double expected_change(const BodyState& state, std::size_t mode) {
  return std::isfinite(state.doubt) ? state.end_amplitudes[mode] - state.amplitudes[mode] : 0.0;
}

}  // namespace

bool ManifoldFinder::Impl::keeps(const LivePair& pair, const PairQuery& q) const {
  const double farthest = this->farthest(q);
  if (!pair.known || (q.by_fields ? q.near > pair.reach : q.reach > pair.reach + farthest)) return false;
  if (!hardly_moved(q, pair.X_LS, smaller_in_larger(q, q.X_AB))) return false;
  double bent = 0.0;
  const double* z = pair.amplitudes.data();
  for (const auto& [body, amplitudes] : {std::pair(&q.a, q.state_a.amplitudes), std::pair(&q.b, q.state_b.amplitudes)})
    for (std::size_t i = 0; i < amplitudes.size(); ++i) {
      const double change = std::abs(amplitudes[i] - *z++);
      if (body->modal->surface->skin() != nullptr && change > 0.0) return false;
      bent += change * body->modal->surface->largest_shape(static_cast<Index>(i));
    }
  return bent <= farthest && (!q.by_fields || keeps_motion(pair, q));
}

bool ManifoldFinder::Impl::hardly_moved(const PairQuery& q, const RigidTransform& from,
                                        const RigidTransform& to) const {
  return (to.p - from.p).norm() <= farthest(q) &&
         2.0 * (to.q * from.q.conjugate()).vector().norm() <= options.recycle_turn;
}

/// Whether a manifold that is made now can be kept in the next query, as far as the expected motion tells.
bool ManifoldFinder::Impl::lasts(const PairQuery& q) const {
  if (!q.by_fields) return true;
  if (!hardly_moved(q, smaller_in_larger(q, q.X_AB), smaller_in_larger(q, q.X_AB_end))) return false;
  double bends = 0.0;
  for (const auto& [body, state] : {std::pair(&q.a, &q.state_a), std::pair(&q.b, &q.state_b)})
    for (std::size_t i = 0; i < state->amplitudes.size(); ++i)
      bends += std::abs(expected_change(*state, i)) * body->modal->surface->largest_shape(static_cast<Index>(i));
  return bends <= farthest(q);
}

/// Whether the expected motion closes at most so much more as manifolds are made for.
bool ManifoldFinder::Impl::keeps_motion(const LivePair& pair, const PairQuery& q) const {
  const RigidTransform X_LS = smaller_in_larger(q, q.X_AB), end = smaller_in_larger(q, q.X_AB_end);
  const Vec3 way = end.p - X_LS.p, way_before = pair.X_LS_end.p - pair.X_LS.p;
  const Quaternion turn = end.q * X_LS.q.conjugate(), turn_before = pair.X_LS_end.q * pair.X_LS.q.conjugate();
  double more = (way - way_before).norm() +
                2.0 * (turn * turn_before.conjugate()).vector().norm() * std::min(q.a.radius, q.b.radius);
  const double* change = pair.amplitudes.data() + pair.amplitudes.size() / 2;
  for (const auto& [body, state] : {std::pair(&q.a, &q.state_a), std::pair(&q.b, &q.state_b)})
    for (std::size_t i = 0; i < state->amplitudes.size(); ++i)
      more +=
          std::abs(expected_change(*state, i) - *change++) * body->modal->surface->largest_shape(static_cast<Index>(i));
  return more <= farthest(q);
}

namespace {

bool is_face(const FeatureSide& side) { return internal::kind_of(side.key) == Feature::Kind::kFace; }

}  // namespace

void ManifoldFinder::Impl::make(LivePair& pair, const PairQuery& q, ManifoldWorker& worker) {
  worker.last.clear();
  for (const KeptPoint& point : pair.points)
    worker.last.push_back(static_cast<std::uint64_t>(point.a.key) << 32 | point.b.key);
  const bool follows = !q.by_fields && internal::SweptPath::is_needed(q);
  const bool kept = !follows && lasts(q);
  PairQuery farther = q;
  if (follows)
    farther.reach = internal::SweptPath::near_at_start(q);
  else if (kept)
    farther.reach += slack(q), farther.near += slack(q);
  worker.made.clear(), worker.gaps.clear();
  const std::span<const FeatureContact> found = worker.pairs.find(farther, worker.last);
  keep(found, q, worker);
  if (follows) {
    worker.path.begin(q);
    if (std::ranges::any_of(worker.gaps, [&](double gap) { return gap <= internal::SweptPath::margin(q); }))
      touch(found, q, worker);
    follow(worker);
  }
  graph.make_room(pair, worker.made.size());
  pair.points.assign(worker.made.begin(), worker.made.end());
  std::sort(pair.points.begin(), pair.points.end(), [](const KeptPoint& p, const KeptPoint& r) { return p.id < r.id; });
  pair.known = kept;
  pair.X_LS = smaller_in_larger(q, q.X_AB);
  pair.X_LS_end = smaller_in_larger(q, q.X_AB_end);
  pair.reach = q.by_fields ? q.near : q.reach;
  pair.amplitudes.assign(q.state_a.amplitudes.begin(), q.state_a.amplitudes.end());
  pair.amplitudes.insert(pair.amplitudes.end(), q.state_b.amplitudes.begin(), q.state_b.amplitudes.end());
  if (!q.by_fields) return;
  for (const BodyState* state : {&q.state_a, &q.state_b})
    for (std::size_t i = 0; i < state->amplitudes.size(); ++i) pair.amplitudes.push_back(expected_change(*state, i));
}

/// Adds the contacts of all places where two bodies come to touch on their way.
void ManifoldFinder::Impl::follow(ManifoldWorker& worker) const {
  const int most = internal::collision_tuning().impact.touches_on_the_way;
  for (int n = 0; n < most && worker.path.advance(); ++n) {
    const PairQuery there = worker.path.query();
    const std::span<const FeatureContact> found = worker.pairs.find(there, worker.last);
    keep(found, there, worker);
    if (found.empty()) return;
    touch(found, there, worker);
  }
}

void ManifoldFinder::Impl::touch(std::span<const FeatureContact> found, const PairQuery& q, ManifoldWorker& worker) {
  keep_inner_balls(
      *std::min_element(found.begin(), found.end(), [](const auto& c, const auto& d) { return c.gap < d.gap; }), q,
      worker);
  worker.path.turn_aside(found);
}

void ManifoldFinder::Impl::keep(std::span<const FeatureContact> found, const PairQuery& q,
                                ManifoldWorker& worker) const {
  for (const FeatureContact& c : found) keep(c, q.a.rounding(), q.b.rounding(), q, worker);
}

/// Contacts with a face turn with the body that has it. Of what is touched twice the first touch counts, and any before
/// what is only near.
void ManifoldFinder::Impl::keep(const FeatureContact& c, double round_a, double round_b, const PairQuery& q,
                                ManifoldWorker& worker) {
  const RigidTransform X_BA = q.X_AB.inverse();
  const std::uint64_t id = internal::contact_id({q.index_a, q.index_b}, internal::feature_pair(c));
  const bool inside = c.a.key == kInside || c.b.key == kInside;
  KeptPoint point{.id = inside ? id >> 24 : id, .a = c.a, .b = c.b};
  point.a.point += round_a * c.normal;
  point.b.point = X_BA * (c.b.point - round_b * c.normal);
  point.turns_with_b = is_face(c.b) && !is_face(c.a);
  point.normal = point.turns_with_b ? X_BA.q * c.normal : c.normal;
  point.round_a = round_a, point.round_b = round_b, point.ahead = q.ahead;
  if (q.ahead > 0.0) point.normal = (point.turns_with_b ? q.b : q.a).pose.q.conjugate() * (q.state_a.pose.q * c.normal);
  const auto known = q.ahead == 0.0 ? worker.made.end()
                                    : std::find_if(worker.made.begin(), worker.made.end(),
                                                   [&](const KeptPoint& made) { return made.id == point.id; });
  if (known == worker.made.end()) {
    worker.made.push_back(point), worker.gaps.push_back(c.gap);
  } else if (double& gap = worker.gaps[static_cast<std::size_t>(known - worker.made.begin())];
             known->ahead == 0.0 && gap > internal::SweptPath::margin(q)) {
    *known = point, gap = c.gap;
  }
}

/// What turns far touches with one point after the other: a ball inside of it stays on its side whichever that is. Its
/// id is the least of the pair, so that who goes through contacts forward and back ends with it.
void ManifoldFinder::Impl::keep_inner_balls(const FeatureContact& deepest, const PairQuery& q, ManifoldWorker& worker) {
  FeatureContact c = deepest;
  double round_a = q.a.rounding(), round_b = q.b.rounding();
  const auto turns = [](const ManifoldBody& body, const BodyState& state) {
    return body.inner && !state.rotation.isZero(0.0);
  };
  const bool by_a = turns(q.a, q.state_a), by_b = turns(q.b, q.state_b);
  if (by_a) {
    round_a = q.a.inner->radius;
    c.a = {.key = kInside, .triangle = -1, .weight = {}, .point = q.a.inner->middle - round_a * c.normal};
  }
  if (by_b) {
    round_b = q.b.inner->radius;
    c.b = {.key = kInside, .triangle = -1, .weight = {}, .point = q.X_AB * q.b.inner->middle + round_b * c.normal};
  }
  c.gap = c.normal.dot(c.a.point - c.b.point);
  if (by_a || by_b) keep(c, round_a, round_b, q, worker);
}

void ManifoldFinder::Impl::find_manifolds(Jobs& jobs) {
  graph.match(pairs);
  recycled.resize(pairs.size());
  jobs.parallel_for(pairs.size(), internal::collision_tuning().finder.pairs_per_chunk,
                    [this](std::size_t begin, std::size_t end) {
                      const ManifoldWorkers::Lease worker(workers);
                      for (std::size_t p = begin; p < end; ++p) {
                        const PairQuery q = query_of(pairs[p]);
                        recycled[p] = keeps(graph.at(p), q) ? 1 : 0;
                        if (recycled[p] == 0) make(graph.at(p), q, *worker);
                      }
                    });
  told = {static_cast<std::int64_t>(pairs.size()), std::count(recycled.begin(), recycled.end(), std::uint8_t{1})};
}

// -- Contacts ---------------------------------------------------------------------------------------------------------

namespace {

/// Where a kept point of a body is now, in the body's frame.
Vec3 place_of(const FeatureSide& side, Index index, const ManifoldBody& body, const BodyState& state,
              PairFinder& finder) {
  if (!body.modal || side.triangle < 0) return side.point;
  if (finder.deforming() != nullptr && finder.deforming()->has(index)) return finder.deforming()->place(index, side);
  DeformedSurface& surface = finder.surface(index, body, state);
  const Triangle& t = body.modal->surface->triangle(side.triangle);
  Vec3 p = Vec3::Zero();
  for (std::size_t c = 0; c < 3; ++c)
    if (side.weight[c] != 0.0) p += side.weight[c] * surface.vertex(t[c]);
  return p;
}

ContactSide side_of(const FeatureSide& kept, Index index, const ManifoldBody& body, double round, const Vec3& point_B) {
  ContactSide side{.body = index, .point_B = point_B, .radius = round};
  if (body.modal && kept.triangle >= 0) side.triangle = kept.triangle, side.weight = kept.weight;
  return side;
}

}  // namespace

/// The point of the body that the normal turns with is the foot of the other's point, as both slide along each other.
ManifoldFinder::Impl::Measured ManifoldFinder::Impl::measure(const KeptPoint& point, const BodyPair& pair,
                                                             ManifoldWorker& worker) const {
  const ManifoldBody &a = at(pair.a), &b = at(pair.b);
  Measured m;
  m.normal = (point.turns_with_b ? b.turn : a.turn) * point.normal;
  m.p_a = a.turn * place_of(point.a, pair.a, a, state(pair.a), worker.pairs) - point.round_a * m.normal;
  m.p_b = b.turn * place_of(point.b, pair.b, b, state(pair.b), worker.pairs) + (b.pose.p - a.pose.p) +
          point.round_b * m.normal;
  m.gap = m.normal.dot(m.p_a - m.p_b);
  if (point.ahead > 0.0) return m;
  if (point.turns_with_b && !b.modal) m.p_b = m.p_a - m.gap * m.normal;
  if (!point.turns_with_b && !a.modal) m.p_a = m.p_b + m.gap * m.normal;
  return m;
}

/// In the frame of a, but for the point of b, which is in its own.
FeatureContact ManifoldFinder::Impl::feature_contact(const Measured& m, const KeptPoint& point,
                                                     const BodyPair& pair) const {
  const ManifoldBody &a = at(pair.a), &b = at(pair.b);
  FeatureContact c{point.a, point.b, a.turn.transpose() * m.normal, m.gap};
  c.a.point = a.turn.transpose() * m.p_a;
  c.b.point = b.turn.transpose() * (m.p_b - (b.pose.p - a.pose.p));
  return c;
}

/// The contacts that the expected motion may close, with gaps as they are now.
std::size_t ManifoldFinder::Impl::write(const LivePair& live, const BodyPair& pair, ManifoldWorker& worker,
                                        ContactPoint* to) const {
  if (live.points.empty()) return 0;
  const ManifoldBody &a = at(pair.a), &b = at(pair.b);
  const bool by_fields = this->by_fields(pair);
  const PairQuery q =
      by_fields ? query_of(pair) : PairQuery{.a = a, .b = b, .state_a = state(pair.a), .state_b = state(pair.b)};
  const double near_enough = by_fields ? q.near : query.margin + a.reach + b.reach;
  const Vec3 way = a.displacement - b.displacement, between = b.pose.p - a.pose.p, base = a.pose.p - query.origin;
  std::size_t count = 0;
  for (const KeptPoint& point : live.points) {
    const Measured m = measure(point, pair, worker);
    const auto closing = [&] {
      return by_fields ? deforming->closing(q, feature_contact(m, point, pair)) : -m.normal.dot(way);
    };
    if (point.ahead == 0.0 && m.gap > near_enough && m.gap > near_enough + closing()) continue;
    to[count++] = {side_of(point.a, pair.a, a, point.round_a, a.turn.transpose() * m.p_a),
                   side_of(point.b, pair.b, b, point.round_b, b.turn.transpose() * (m.p_b - between)),
                   m.normal,
                   base + 0.5 * (m.p_a + m.p_b),
                   m.gap,
                   point.id};
  }
  return count;
}

void ManifoldFinder::Impl::write_contacts(std::vector<ContactPoint>& contacts, Jobs& jobs) {
  first_of.resize(pairs.size() + 1);
  counts.resize(pairs.size());
  first_of[0] = 0;
  for (std::size_t p = 0; p < pairs.size(); ++p) first_of[p + 1] = first_of[p] + graph.at(p).points.size();
  contacts.resize(first_of.back());
  jobs.parallel_for(pairs.size(), internal::collision_tuning().finder.pairs_per_chunk,
                    [this, &contacts](std::size_t begin, std::size_t end) {
                      const ManifoldWorkers::Lease worker(workers);
                      for (std::size_t p = begin; p < end; ++p)
                        counts[p] = write(graph.at(p), pairs[p], *worker, contacts.data() + first_of[p]);
                    });
  std::size_t count = 0;
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    if (first_of[p] != count)
      std::copy_n(contacts.begin() + static_cast<std::ptrdiff_t>(first_of[p]), counts[p],
                  contacts.begin() + static_cast<std::ptrdiff_t>(count));
    count += counts[p];
  }
  contacts.resize(count);
}

// -- Seams between bodies ---------------------------------------------------------------------------------------------

/// Where a body rests or comes down on one thing and comes to another one that reaches to the same plane and no
/// farther, the plane is what both touch along. Manifolds made in this query are made again so, one after the other.
void ManifoldFinder::Impl::level_seams() {
  bool listed = false;
  const ManifoldWorkers::Lease worker(workers);
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    const BodyPair& pair = pairs[p];
    if (recycled[p] != 0 || graph.at(p).points.empty() || at(pair.a).modal || at(pair.b).modal) continue;
    if (!listed) list_pairs_of_bodies();
    listed = true;
    find_planes(p, pair.a, planes_a, *worker);
    find_planes(p, pair.b, planes_b, *worker);
    if (planes_a.empty() && planes_b.empty()) continue;
    PairQuery q = query_of(pair);
    q.planes_a = planes_a, q.planes_b = planes_b;
    make(graph.at(p), q, *worker);
  }
}

void ManifoldFinder::Impl::list_pairs_of_bodies() {
  first_pair_of.assign(bodies.size() + 1, 0);
  for (const auto& [a, b] : pairs)
    ++first_pair_of[static_cast<std::size_t>(a) + 1], ++first_pair_of[static_cast<std::size_t>(b) + 1];
  for (std::size_t i = 1; i < first_pair_of.size(); ++i) first_pair_of[i] += first_pair_of[i - 1];
  pairs_of.resize(2 * pairs.size());
  for (std::size_t p = 0; p < pairs.size(); ++p)
    for (const Index body : {pairs[p].a, pairs[p].b}) pairs_of[first_pair_of[static_cast<std::size_t>(body)]++] = p;
  for (std::size_t i = first_pair_of.size() - 1; i > 0; --i) first_pair_of[i] = first_pair_of[i - 1];
  first_pair_of[0] = 0;
}

/// Planes, in the frame of a convex body of a pair, that it rests on or comes down on beside the other one, to which
/// that one reaches, and along which not all of the pair's contacts are.
void ManifoldFinder::Impl::find_planes(std::size_t p, Index body, std::vector<internal::SupportPlane>& planes,
                                       ManifoldWorker& worker) {
  planes.clear();
  const Index other = pairs[p].a == body ? pairs[p].b : pairs[p].a;
  const ManifoldBody& me = at(body);
  if (me.core() == nullptr || at(other).half_space() != nullptr) return;
  const double tolerance = options.flush * std::min(me.thickness, at(other).thickness);
  const auto i = static_cast<std::size_t>(body);
  own_normals.clear();
  for (const KeptPoint& point : graph.at(p).points) own_normals.push_back(out_of_other(point, pairs[p], body));
  for (std::size_t k = first_pair_of[i]; k < first_pair_of[i + 1]; ++k) {
    const std::size_t beside = pairs_of[k];
    if (beside == p) continue;
    const KeptPoint* last_point = nullptr;
    Vec3 out = Vec3::Zero(), last = Vec3::Zero();
    for (const KeptPoint& point : graph.at(beside).points) {
      if (last_point == nullptr || last_point->turns_with_b != point.turns_with_b || last_point->normal != point.normal)
        out = out_of_other(point, pairs[beside], body);
      last_point = &point;
      if ((out - last).squaredNorm() <= kSameNormal * kSameNormal) continue;  // contacts of a face
      const Measured m = measure(point, pairs[beside], worker);
      const ManifoldBody& ground = at(pairs[beside].a == body ? pairs[beside].b : pairs[beside].a);
      if (m.gap + std::min(0.0, out.dot(me.displacement - ground.displacement)) > tolerance) continue;
      last = out;
      if (touches_along(out)) continue;
      const double offset =
          pairs[beside].a == body ? out.dot(m.p_b) : out.dot(m.p_a + at(pairs[beside].a).pose.p - me.pose.p);
      if (reaches_to(other, out, offset + out.dot(me.pose.p - at(other).pose.p), tolerance))
        planes.push_back({me.turn.transpose() * out, offset, tolerance});
    }
  }
}

/// The normal of a contact, into a body of the pair, world.
Vec3 ManifoldFinder::Impl::out_of_other(const KeptPoint& point, const BodyPair& pair, Index body) const {
  const Vec3 normal = at(point.turns_with_b ? pair.b : pair.a).turn * point.normal;
  return pair.a == body ? normal : Vec3(-normal);
}

bool ManifoldFinder::Impl::touches_along(const Vec3& out) const {
  return std::ranges::all_of(own_normals,
                             [&](const Vec3& own) { return (own - out).squaredNorm() <= kSameNormal * kSameNormal; });
}

/// Whether a convex body reaches to normal · x = offset, x from its origin, and no farther; of meshes each triangle is
/// looked at by itself.
bool ManifoldFinder::Impl::reaches_to(Index body, const Vec3& normal, double offset, double tolerance) const {
  const internal::ConvexCore* core = at(body).core();
  if (core == nullptr) return at(body).half_space() == nullptr;
  const Vec3 normal_B = at(body).turn.transpose() * normal;
  double highest = -std::numeric_limits<double>::infinity();
  if (core->half_extents[0] > 0.0)
    highest = normal_B.cwiseAbs().dot(core->half_extents);
  else
    for (const Vec3& p : core->points) highest = std::max(highest, normal_B.dot(p));
  return std::abs(highest + core->radius - offset) <= tolerance;
}

// -- The finder -------------------------------------------------------------------------------------------------------

ManifoldFinder::ManifoldFinder(const ManifoldFinderOptions& options) : impl_(std::make_unique<Impl>(options)) {}
ManifoldFinder::~ManifoldFinder() = default;
ManifoldFinder::ManifoldFinder(ManifoldFinder&&) noexcept = default;
ManifoldFinder& ManifoldFinder::operator=(ManifoldFinder&&) noexcept = default;

void ManifoldFinder::add_body(Index body, const BodyGeometry& geometry, const CollisionFilter& filter) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Impl& m = *impl_;
  m.bodies.check_new(body, geometry);
  ManifoldBody fresh{.present = true};
  if (geometry.model) {
    fresh.modal = m.geometries.get(geometry.model, geometry.skin);
  } else {
    fresh.rigid = m.shapes.get(geometry.shape.get(),
                               [&] { return std::make_shared<const internal::ManifoldShape>(geometry.shape); });
  }
  const Aabb box = fresh.modal ? fresh.modal->surface->rest_bounds() : fresh.rigid->geometry.bounds();
  fresh.thickness = fresh.half_space() ? kInfinity : internal::thickness_of(box, fresh.rigid && !fresh.core());
  if (fresh.modal)
    fresh.inner = internal::inner_ball(*geometry.model);
  else if (fresh.core())
    fresh.inner = internal::inner_ball(*fresh.core());
  fresh.radius = fresh.half_space() ? kInfinity : internal::farthest_of(box);
  m.graph.reserve(fresh.modes());
  m.bodies.add(body, std::move(fresh), filter);
  if (m.deforming) m.deforming->add_body(body, m.at(body));
}

void ManifoldFinder::remove_body(Index body) {
  impl_->bodies.remove(body);
  impl_->graph.forget(body);
  if (impl_->deforming) impl_->deforming->remove_body(body);
}

void ManifoldFinder::set_filter(Index body, const CollisionFilter& filter) { impl_->bodies.set_filter(body, filter); }

void ManifoldFinder::exclude_pair(Index a, Index b, bool excluded) { impl_->bodies.exclude_pair(a, b, excluded); }

void ManifoldFinder::save_state(StateWriter& state) const {
  state(static_cast<std::uint64_t>(impl_->graph.living()));
  impl_->graph.for_each([&](const BodyPair& pair, const LivePair& live) { state(pair.a, pair.b, live); });
}

void ManifoldFinder::restore_state(StateReader& state) {
  impl_->graph.forget_all();
  for (auto left = state.read<std::uint64_t>(); left > 0; --left) {
    const auto a = state.read<Index>();
    const auto b = state.read<Index>();
    state(impl_->graph.append({a, b}));
  }
  impl_->bodies.forget_places();
}

void ManifoldFinder::find_contacts(const ContactQuery& query, std::vector<ContactPoint>& contacts, Jobs& jobs) {
  Impl& m = *impl_;
  internal::check_query("ManifoldFinder", query);
  m.query = query;
  StageClock clock(query.times);
  m.find_near_pairs(jobs);
  clock.lap(Stage::kBroadPhase, static_cast<std::int64_t>(m.pairs.size()));
  m.find_manifolds(jobs);
  m.level_seams();
  m.write_contacts(contacts, jobs);
  clock.lap(Stage::kNarrowPhase, static_cast<std::int64_t>(contacts.size()));
}

const ManifoldFinder::Counts& ManifoldFinder::counts() const { return impl_->told; }

}  // namespace limber
