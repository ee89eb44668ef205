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
  seams.touches.clear(), seams.supports.clear();
  seams.touches_of.assign(pairs.size(), {kNotListed, kNotListed});
  seams.supports_of.assign(bodies.size(), {kNotListed, kNotListed});
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
    for (const Index body : {pair.a, pair.b}) seams.supports_of[static_cast<std::size_t>(body)].first = kNotListed;
  }
}

std::span<const ManifoldFinder::Impl::Touch> ManifoldFinder::Impl::touches_of(std::size_t p, ManifoldWorker& worker) {
  if (seams.touches_of[p].first == kNotListed) list_touches(p, worker);
  return listed_touches(p);
}

/// Of each point of a manifold, or of none.
std::span<const ManifoldFinder::Impl::Touch> ManifoldFinder::Impl::listed_touches(std::size_t p) const {
  const auto& [first, end] = seams.touches_of[p];
  if (first == kNotListed) return {};
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

std::span<const ManifoldFinder::Impl::Support> ManifoldFinder::Impl::supports_of(Index body, ManifoldWorker& worker) {
  const auto& [first, end] = seams.supports_of[static_cast<std::size_t>(body)];
  if (first == kNotListed) list_supports(body, worker);
  return std::span(seams.supports).subspan(first, end - first);
}

/// Of a convex body that has more than half of itself in front; of the contacts of a face the lowest.
void ManifoldFinder::Impl::list_supports(Index body, ManifoldWorker& worker) {
  const double same_normal = internal::collision_tuning().manifold.same_normal;
  const auto i = static_cast<std::size_t>(body);
  seams.supports_of[i].first = seams.supports.size();
  for (std::size_t k = seams.first_pair_of[i]; k < seams.first_pair_of[i + 1]; ++k) {
    const std::size_t p = seams.pairs_of[k];
    const bool is_a = pairs[p].a == body;
    const std::size_t first = seams.supports.size();
    for (const Touch& touch : touches_of(p, worker)) {
      const Vec3 out = is_a ? touch.at.normal : Vec3(-touch.at.normal);
      const double offset =
          is_a ? out.dot(touch.at.p_b) : out.dot(touch.at.p_a + at(pairs[p].a).pose.p - at(body).pose.p);
      const Support here{out, offset, touch.lowest, p};
      if (seams.supports.size() == first ||
          (out - seams.supports.back().out).squaredNorm() > same_normal * same_normal) {
        const Vec3 out_B = at(body).turn.transpose() * out;
        if (at(body).core()->reach(out_B) - at(body).core()->reach(-out_B) >= 2.0 * offset)
          seams.supports.push_back(here);
      } else if (touch.lowest < seams.supports.back().lowest) {
        seams.supports.back() = here;
      }
    }
  }
  seams.supports_of[i].second = seams.supports.size();
}

/// Planes, in the frame of a convex body of a pair, that it rests on or comes down on beside the other one, to which
/// that one reaches, and along which not all of the pair's contacts are.
void ManifoldFinder::Impl::find_planes(std::size_t p, Index body, ManifoldWorker& worker,
                                       std::vector<internal::SupportPlane>& planes) {
  planes.clear();
  const Index other = pairs[p].a == body ? pairs[p].b : pairs[p].a;
  const ManifoldBody& me = at(body);
  if (me.core() == nullptr || at(other).half_space() != nullptr) return;
  const double tolerance = options.flush * std::min(me.thickness, at(other).thickness);
  seams.own_normals.clear();
  for (const Touch& touch : touches_of(p, worker))
    seams.own_normals.push_back(pairs[p].a == body ? touch.at.normal : Vec3(-touch.at.normal));
  for (const Support& support : supports_of(body, worker))
    if (support.pair != p && support.lowest <= tolerance && !touches_along(support.out) &&
        reaches_to(other, support.out, support.offset + support.out.dot(me.pose.p - at(other).pose.p), tolerance))
      planes.push_back({me.turn.transpose() * support.out, support.offset, tolerance});
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
  return at(body).core()->reach(at(body).turn.transpose() * along);
}

}  // namespace limber
