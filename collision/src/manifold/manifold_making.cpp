#include <algorithm>
#include <cmath>
#include <utility>

#include "finder/contact_id.h"
#include "manifold/manifold_finder_impl.h"
#include "manifold/manifold_points.h"
#include "tuning.h"

namespace limber {

using internal::FeatureContact;
using internal::FeatureSide;
using internal::KeptPoint;
using internal::LivePair;
using internal::ManifoldBody;
using internal::ManifoldWorker;
using internal::ManifoldWorkers;
using internal::PairQuery;

namespace {

constexpr internal::FeatureKey kInside = 0xffffffffu;  // a body's inner ball: of a kind that no feature has

}  // namespace

PairQuery ManifoldFinder::Impl::query_of(const BodyPair& pair) const {
  const ManifoldBody &a = at(pair.a), &b = at(pair.b);
  PairQuery q{.index_a = pair.a, .index_b = pair.b, .a = a, .b = b, .state_a = state(pair.a), .state_b = state(pair.b)};
  q.X_AB = {a.pose.q.conjugate() * b.pose.q, a.turn.transpose() * (b.pose.p - a.pose.p)};
  q.X_LS = a.radius <= b.radius ? q.X_AB.inverse() : q.X_AB;
  q.passing = {a.turn.transpose() * (a.displacement - b.displacement),
               options.flush * std::min(a.thickness, b.thickness)};
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
  q.expected.X_AB_end = end_of(q.state_a).inverse() * end_of(q.state_b);
  q.expected.X_LS_end = q.a.radius <= q.b.radius ? q.expected.X_AB_end.inverse() : q.expected.X_AB_end;
  q.expected.near = query.margin + beside(q.state_a) + beside(q.state_b);
  q.expected.fall = q.state_a.pose.q.conjugate() * query.fall;
}

double ManifoldFinder::Impl::farthest(const PairQuery& q) const {
  return options.recycle_distance * std::min(q.a.thickness, q.b.thickness);
}

/// How far points of one body may come against the other while a manifold is kept: by what it moves, turns and bends;
/// by fields all of it together, and what the expected motion closes from there.
double ManifoldFinder::Impl::slack(const PairQuery& q) const {
  const double parts = q.by_fields ? 3.0 : q.a.modal || q.b.modal ? 2.0 : 1.0;
  return parts * farthest(q) + options.recycle_turn * std::min(q.a.radius, q.b.radius);
}

/// Where two were farther apart than they have come since and may come, they still have no contacts.
bool ManifoldFinder::Impl::keeps(const LivePair& pair, const PairQuery& q) const {
  const double bent = q.a.bent - pair.bent[0] + q.b.bent - pair.bent[1];
  if (pair.apart > 0.0 &&
      pair.apart - way(q, pair.X_LS, q.X_LS) - bent > (q.by_fields ? q.expected.near + comes(q) : q.reach))
    return true;
  const double farthest = this->farthest(q);
  if (!pair.known || (q.by_fields ? q.expected.near > pair.reach : q.reach > pair.reach + farthest)) return false;
  if (!q.by_fields && !hardly_moved(q, pair.X_LS, q.X_LS)) return false;
  return q.by_fields ? way(q, pair.X_LS, q.X_LS) + bent + comes(q) <= slack(q) : bent <= farthest;
}

bool ManifoldFinder::Impl::hardly_moved(const PairQuery& q, const RigidTransform& from,
                                        const RigidTransform& to) const {
  return (to.p - from.p).norm() <= farthest(q) &&
         2.0 * (to.q * from.q.conjugate()).vector().norm() <= options.recycle_turn;
}

/// Whether a manifold that is made now can be kept in the next query, as far as the expected motion tells.
bool ManifoldFinder::Impl::lasts(const PairQuery& q) const {
  return !q.by_fields || 2.0 * comes(q) <= slack(q);  // as it comes and, made then, as it comes further
}

/// How far points of one body come against the other as the smaller one moves in the frame of the larger.
double ManifoldFinder::Impl::way(const PairQuery& q, const RigidTransform& from, const RigidTransform& to) {
  return (to.p - from.p).norm() + 2.0 * (to.q * from.q.conjugate()).vector().norm() * std::min(q.a.radius, q.b.radius);
}

/// How far they are expected to, modes included.
double ManifoldFinder::Impl::comes(const PairQuery& q) const {
  return way(q, q.X_LS, q.expected.X_LS_end) + fields.largest_swing(q.index_a) + fields.largest_swing(q.index_b);
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
  internal::Parting parting{pair.parting};
  farther.expected.parting = &parting;
  if (follows)
    farther.reach = internal::SweptPath::near_at_start(q);
  else if (kept)
    farther.reach += slack(q), farther.expected.near += slack(q);
  worker.made.clear(), worker.gaps.clear();
  const std::span<const FeatureContact> found = worker.pairs.find(farther, worker.last);
  const double apart = worker.pairs.apart();
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
  pair.parting = parting.direction;
  pair.known = kept;
  pair.X_LS = q.X_LS;
  pair.reach = q.by_fields ? q.expected.near : q.reach;
  pair.apart = worker.made.empty() ? apart : 0.0;
  pair.bent = {q.a.bent, q.b.bent};
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
  const Quaternion to_b = q.X_AB.q.conjugate();
  const std::uint64_t id = internal::contact_id({q.index_a, q.index_b}, internal::feature_pair(c));
  const bool inside = c.a.key == kInside || c.b.key == kInside;
  KeptPoint point{.id = inside ? id >> 24 : id, .a = c.a, .b = c.b};
  point.a.point += round_a * c.normal;
  point.b.point = to_b * (c.b.point - round_b * c.normal - q.X_AB.p);
  point.turns_with_b = is_face(c.b) && !is_face(c.a);
  point.normal = point.turns_with_b ? to_b * c.normal : c.normal;
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

}  // namespace limber
