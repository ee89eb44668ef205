#include <algorithm>
#include <cmath>
#include <limits>

#include "manifold/manifold_finder_impl.h"
#include "tuning.h"

namespace limber {

using internal::KeptPoint;
using internal::ManifoldBody;
using internal::ManifoldWorker;
using internal::ManifoldWorkers;
using internal::PairQuery;

namespace {

constexpr std::size_t kNotListed = std::numeric_limits<std::size_t>::max();

}  // namespace

// -- Seams between bodies ---------------------------------------------------------------------------------------------

/// Where a body rests or comes down on one thing and comes to another one that reaches to the same plane and no
/// farther, the plane is what both touch along. Manifolds made in this query are made again so, one after the other.
void ManifoldFinder::Impl::level_seams() {
  bool listed = false;
  seams.touches.clear();
  seams.touches_of.assign(pairs.size(), {kNotListed, kNotListed});
  const ManifoldWorkers::Lease worker(workers);
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    const BodyPair& pair = pairs[p];
    if (recycled[p] != 0 || graph.at(p).points.empty() || at(pair.a).modal || at(pair.b).modal) continue;
    if (!listed) list_pairs_of_bodies();
    listed = true;
    find_planes(p, pair.a, *worker, seams.planes_a);
    find_planes(p, pair.b, *worker, seams.planes_b);
    if (seams.planes_a.empty() && seams.planes_b.empty()) continue;
    PairQuery q = query_of(pair);
    q.planes_a = seams.planes_a, q.planes_b = seams.planes_b;
    make(graph.at(p), q, *worker);
    list_touches(p, *worker);
  }
}

std::span<const ManifoldFinder::Impl::Touch> ManifoldFinder::Impl::touches_of(std::size_t p, ManifoldWorker& worker) {
  if (seams.touches_of[p].first == kNotListed) list_touches(p, worker);
  const auto& [first, end] = seams.touches_of[p];
  return std::span(seams.touches).subspan(first, end - first);
}

/// Of what convex bodies touch.
void ManifoldFinder::Impl::list_touches(std::size_t p, ManifoldWorker& worker) {
  const Vec3 way = at(pairs[p].a).displacement - at(pairs[p].b).displacement;
  seams.touches_of[p].first = seams.touches.size();
  const bool matters = at(pairs[p].a).core() != nullptr || at(pairs[p].b).core() != nullptr;
  for (const KeptPoint& point : graph.at(p).points) {
    if (!matters) break;
    const Measured m = measure(point, pairs[p], worker);
    seams.touches.push_back({m, m.gap + std::min(0.0, m.normal.dot(way))});
  }
  seams.touches_of[p].second = seams.touches.size();
}

void ManifoldFinder::Impl::list_pairs_of_bodies() {
  seams.first_pair_of.assign(bodies.size() + 1, 0);
  for (const auto& [a, b] : pairs)
    ++seams.first_pair_of[static_cast<std::size_t>(a) + 1], ++seams.first_pair_of[static_cast<std::size_t>(b) + 1];
  for (std::size_t i = 1; i < seams.first_pair_of.size(); ++i) seams.first_pair_of[i] += seams.first_pair_of[i - 1];
  seams.pairs_of.resize(2 * pairs.size());
  for (std::size_t p = 0; p < pairs.size(); ++p)
    for (const Index body : {pairs[p].a, pairs[p].b})
      seams.pairs_of[seams.first_pair_of[static_cast<std::size_t>(body)]++] = p;
  for (std::size_t i = seams.first_pair_of.size() - 1; i > 0; --i) seams.first_pair_of[i] = seams.first_pair_of[i - 1];
  seams.first_pair_of[0] = 0;
}

/// Planes, in the frame of a convex body of a pair, that it rests on or comes down on beside the other one, with more
/// than half of itself in front, to which that one reaches, and along which not all of the pair's contacts are.
void ManifoldFinder::Impl::find_planes(std::size_t p, Index body, ManifoldWorker& worker,
                                       std::vector<internal::SupportPlane>& planes) {
  planes.clear();
  const Index other = pairs[p].a == body ? pairs[p].b : pairs[p].a;
  const ManifoldBody& me = at(body);
  if (me.core() == nullptr || at(other).half_space() != nullptr) return;
  const double tolerance = options.flush * std::min(me.thickness, at(other).thickness),
               same_normal = internal::collision_tuning().manifold.same_normal;
  const auto i = static_cast<std::size_t>(body);
  const auto out_of_other = [&](const Touch& touch, std::size_t of) {
    return pairs[of].a == body ? touch.at.normal : Vec3(-touch.at.normal);
  };
  seams.own_normals.clear();
  for (const Touch& touch : touches_of(p, worker)) seams.own_normals.push_back(out_of_other(touch, p));
  for (std::size_t k = seams.first_pair_of[i]; k < seams.first_pair_of[i + 1]; ++k) {
    const std::size_t beside = seams.pairs_of[k];
    if (beside == p) continue;
    Vec3 last = Vec3::Zero();
    for (const Touch& touch : touches_of(beside, worker)) {
      if (touch.lowest > tolerance) continue;
      const Vec3 out = out_of_other(touch, beside);
      if ((out - last).squaredNorm() <= same_normal * same_normal) continue;  // contacts of a face
      last = out;
      if (touches_along(out)) continue;
      const double offset = pairs[beside].a == body ? out.dot(touch.at.p_b)
                                                    : out.dot(touch.at.p_a + at(pairs[beside].a).pose.p - me.pose.p);
      if (reach(body, out) - reach(body, -out) < 2.0 * offset) continue;  // its middle is behind
      if (reaches_to(other, out, offset + out.dot(me.pose.p - at(other).pose.p), tolerance))
        planes.push_back({me.turn.transpose() * out, offset, tolerance});
    }
  }
}

bool ManifoldFinder::Impl::touches_along(const Vec3& out) const {
  const double same_normal = internal::collision_tuning().manifold.same_normal;
  return std::ranges::all_of(seams.own_normals,
                             [&](const Vec3& own) { return (own - out).squaredNorm() <= same_normal * same_normal; });
}

/// Whether a convex body reaches to normal · x = offset, x from its origin, and no farther; of meshes each triangle is
/// looked at by itself.
bool ManifoldFinder::Impl::reaches_to(Index body, const Vec3& normal, double offset, double tolerance) const {
  if (at(body).core() == nullptr) return at(body).half_space() == nullptr;
  return std::abs(reach(body, normal) - offset) <= tolerance;
}

/// How far a convex body reaches along a direction, from its origin.
double ManifoldFinder::Impl::reach(Index body, const Vec3& along) const {
  const internal::ConvexCore& core = *at(body).core();
  const Vec3 along_B = at(body).turn.transpose() * along;
  if (core.half_extents[0] > 0.0) return along_B.cwiseAbs().dot(core.half_extents) + core.radius;
  double highest = -std::numeric_limits<double>::infinity();
  for (const Vec3& p : core.points) highest = std::max(highest, along_B.dot(p));
  return highest + core.radius;
}

}  // namespace limber
