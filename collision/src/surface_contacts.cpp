#include "surface_contacts.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

namespace limber {
namespace {

// Edges whose angle has a sine below this are parallel: their ends make the contacts.
constexpr double kParallelSine = 1e-12;

bool apart(const Aabb& a, const Aabb& b, double margin) {
  return ((a.low - b.high).array() > margin).any() || ((b.low - a.high).array() > margin).any();
}

}  // namespace

void SurfaceContacts::begin(PairSurface& a, PairSurface& b, double margin, bool self,
                            std::vector<FeatureContact>& contacts) {
  side_[0] = &a, side_[1] = &b;
  margin_ = margin, tolerance_ = a.tolerance(), self_ = self, overlap_ = false;
  contacts_ = &contacts;
  pairs_.clear(), piercings_.clear();
  for (int of = 0; of < 2; ++of) {
    seeds_[of].clear();
    const auto vertices = static_cast<std::size_t>(side_[of]->surface().vertices());
    if (visited_[of].size() < vertices) visited_[of].resize(vertices);
  }
  if (generation_ > std::numeric_limits<std::uint32_t>::max() - 4) {
    for (std::vector<std::uint32_t>& stamps : visited_) std::fill(stamps.begin(), stamps.end(), 0u);
    generation_ = 0;
  }
  generation_ += 2;
}

void SurfaceContacts::find(PairSurface& a, PairSurface& b, const RigidTransform& X_AB, double margin,
                           OverlapRule* rule_a, OverlapRule* rule_b, std::vector<FeatureContact>& contacts) {
  begin(a, b, margin, false, contacts);
  find_triangle_pairs(a.deformed(), b.deformed(), X_AB, margin, pairs_);
  for (const auto& [s, t] : pairs_) test_pair(s, t);
  spread_inside(0, rule_b);
  spread_inside(1, rule_a);
  find_enclosed(0, rule_b);
  find_enclosed(1, rule_a);
  cross_edges();
  if (!overlap_) push_out_of_faces();
}

void SurfaceContacts::find_self(PairSurface& a, double margin, std::vector<FeatureContact>& contacts) {
  begin(a, a, margin, true, contacts);
  find_self_pairs(a.deformed(), margin, false, pairs_);
  for (const auto& [s, t] : pairs_) test_pair(s, t);
}

void SurfaceContacts::test_pair(Index s, Index t) {
  const PairSurface::Face &f = side_[0]->face(s), &g = side_[1]->face(t);
  if (apart(f.box, g.box, margin_) || planes_separate(f, g)) return;
  test_vertices(0, s, t);
  test_vertices(1, t, s);
  test_edges(s, t);
  if (self_ || apart(f.box, g.box, 0.0)) return;
  find_piercings(0, s, t);
  find_piercings(1, t, s);
}

// Whether one triangle lies beyond the margin on one side of the other's plane.
bool SurfaceContacts::planes_separate(const PairSurface::Face& s, const PairSurface::Face& t) const {
  const auto beyond = [&](const PairSurface::Face& plane, const TrianglePoints& x) {
    const double h0 = plane.normal.dot(x[0] - plane.x[0]), h1 = plane.normal.dot(x[1] - plane.x[0]),
                 h2 = plane.normal.dot(x[2] - plane.x[0]);
    return (h0 > margin_ && h1 > margin_ && h2 > margin_) || (h0 < -margin_ && h1 < -margin_ && h2 < -margin_);
  };
  return beyond(s, t.x) || beyond(t, s.x);
}

// -- A vertex and a surface -------------------------------------------------------------------------------------------

void SurfaceContacts::test_vertices(int of, Index s, Index t) {
  for (int c = 0; c < 3; ++c)
    if (self_ || side_[of]->owns_vertex(s, c))
      vertex_against_face(of, side_[of]->surface().triangle(s)[static_cast<std::size_t>(c)], t);
}

void SurfaceContacts::vertex_against_face(int of, Index v, Index t) {
  PairSurface &mine = *side_[of], &other = *side_[1 - of];
  other.for_each_minimum(mine.vertex(v), t, margin_, self_, [&](const PairSurface::Minimum& minimum) {
    if (mine.sees(v, minimum.at.point)) add(of, mine.at_vertex(v), minimum.at, minimum.direction, minimum.distance);
  });
}

// -- Two edges --------------------------------------------------------------------------------------------------------

void SurfaceContacts::test_edges(Index s, Index t) {
  for (int c = 0; c < 3; ++c) {
    if (!self_ && !side_[0]->owns_edge(s, c)) continue;
    for (int d = 0; d < 3; ++d) {
      if (!self_ && !side_[1]->owns_edge(t, d)) continue;
      const EdgePair pair = nearest_of_edges(side_[0]->surface().edge_of(s, c), side_[1]->surface().edge_of(t, d));
      if (pair.distance <= margin_) add_separated_edges(pair);
    }
  }
}

// Where the common perpendicular of two edges meets both within their length; the distance is infinite otherwise.
SurfaceContacts::EdgePair SurfaceContacts::nearest_of_edges(Index e, Index f) {
  EdgePair pair{e, f, 0.0, 0.0, {}, {}, {}, std::numeric_limits<double>::infinity()};
  const SurfaceEdge &edge = side_[0]->surface().edge(e), &fdge = side_[1]->surface().edge(f);
  if (edge.triangle_count == 0 || fdge.triangle_count == 0) return pair;
  const Vec3 &a0 = side_[0]->vertex(edge.vertices[0]), &a1 = side_[0]->vertex(edge.vertices[1]);
  const Vec3 &b0 = side_[1]->vertex(fdge.vertices[0]), &b1 = side_[1]->vertex(fdge.vertices[1]);
  const Vec3 u = a1 - a0, w = b1 - b0, r = b0 - a0;
  const Vec3 n = u.cross(w);
  const double n2 = n.squaredNorm(), u2 = u.squaredNorm(), w2 = w.squaredNorm();
  if (!(n2 > kParallelSine * kParallelSine * u2 * w2)) return pair;
  const double s = r.cross(w).dot(n) / n2, t = r.cross(u).dot(n) / n2;
  const double end_s = tolerance_ / std::sqrt(u2), end_t = tolerance_ / std::sqrt(w2);
  if (!(s > end_s && s < 1.0 - end_s && t > end_t && t < 1.0 - end_t)) return pair;
  // Feet again, one upon the other: for nearly parallel lines s and t are far less exact than the distance.
  const SurfaceFoot on_f = closest_on_segment(a0 + s * u, {b0, b1});
  const SurfaceFoot on_e = closest_on_segment(on_f.point, {a0, a1});
  pair.s = on_e.weight[1], pair.t = on_f.weight[1];
  pair.on_e = on_e.point, pair.on_f = on_f.point;
  pair.distance = (pair.on_e - pair.on_f).norm();
  // Of the two ways to the direction, the one that loses fewer digits.
  const bool nearly_parallel = std::sqrt(n2 / (u2 * w2)) * std::sqrt(u2 + w2) < pair.distance;
  pair.direction = nearly_parallel ? Vec3((pair.on_e - pair.on_f) / pair.distance) : Vec3(n / std::sqrt(n2));
  if (pair.direction.dot(pair.on_e - pair.on_f) < 0.0) pair.direction = -pair.direction;
  return pair;
}

// Out of f towards e, and back: both edges must have nothing nearer to either side.
void SurfaceContacts::add_separated_edges(EdgePair pair) {
  if (pair.distance <= kDirectionless * tolerance_ && pair.direction.dot(side_[1]->edge_normal(pair.f)) < 0.0)
    pair.direction = -pair.direction;
  if (side_[1]->in_normal_cone(pair.f, pair.direction) && side_[0]->in_normal_cone(pair.e, -pair.direction))
    add_edges(pair, pair.direction);
}

void SurfaceContacts::add_edges(const EdgePair& pair, const Vec3& normal) {
  add(0, side_[0]->on_edge(pair.e, pair.s, pair.on_e), side_[1]->on_edge(pair.f, pair.t, pair.on_f), normal,
      normal.dot(pair.on_e - pair.on_f));
}

// -- Overlap ----------------------------------------------------------------------------------------------------------

void SurfaceContacts::find_piercings(int of, Index s, Index t) {
  for (int c = 0; c < 3; ++c)
    if (side_[of]->owns_edge(s, c)) find_piercing(of, side_[of]->surface().edge_of(s, c), t);
}

void SurfaceContacts::find_piercing(int of, Index e, Index t) {
  PairSurface& mine = *side_[of];
  const PairSurface::Face& f = side_[1 - of]->face(t);
  const std::array<Index, 2> ends = mine.surface().edge(e).vertices;
  const Vec3 &x0 = mine.vertex(ends[0]), &x1 = mine.vertex(ends[1]);
  const double h0 = f.normal.dot(x0 - f.x[0]), h1 = f.normal.dot(x1 - f.x[0]);
  const std::size_t behind = h0 < h1 ? 0 : 1;
  const double back = std::min(h0, h1), front = std::max(h0, h1);
  if (!(back < -tolerance_ && front >= -tolerance_)) return;
  const Vec3 p = x0 + std::clamp(h0 / (h0 - h1), 0.0, 1.0) * (x1 - x0);
  double within = std::numeric_limits<double>::infinity();
  for (std::size_t c = 0; c < 3; ++c) within = std::min(within, (p - f.x[c]).dot(f.inward[c]));
  if (within < -tolerance_) return;
  if (side_[1 - of]->sided()) seeds_[of].push_back({ends[behind], (p - mine.vertex(ends[behind])).norm()});
  // An edge that only begins or ends on the face, or meets its rim, touches it.
  if (front > tolerance_ && within > tolerance_) piercings_.push_back({of, e, t, {h0, h1}});
}

// From the ends of piercing edges over the mesh to every vertex that is inside the other surface.
void SurfaceContacts::spread_inside(int of, OverlapRule* rule) {
  std::vector<Seed>& seeds = seeds_[of];
  while (!seeds.empty()) {
    const Seed seed = seeds.back();
    seeds.pop_back();
    std::uint32_t& visited = visited_[of][static_cast<std::size_t>(seed.vertex)];
    if (visited >= generation_) continue;
    visited = generation_;
    const Vec3& p = side_[of]->vertex(seed.vertex);
    const PairSurface::Nearest nearest =
        side_[1 - of]->nearest(p, seed.reach * (1.0 + 1e-9) + kDirectionless * tolerance_);
    if (!nearest.inside) continue;
    visited = generation_ + 1;
    add_inside(of, seed.vertex, nearest, rule);
    for (const Index w : side_[of]->surface().vertex_neighbours(seed.vertex))
      seeds.push_back({w, nearest.distance + (side_[of]->vertex(w) - p).norm()});
  }
}

void SurfaceContacts::add_inside(int of, Index v, const PairSurface::Nearest& nearest, OverlapRule* rule) {
  PairSurface& other = *side_[1 - of];
  const Vec3& p = side_[of]->vertex(v);
  OverlapRule::Exit exit;
  if (rule == nullptr || !rule->exit(other, p, nearest, exit)) {
    exit.at = other.at_foot(nearest.triangle, nearest.foot);
    exit.normal = nearest.distance > kDirectionless * tolerance_ ? Vec3((exit.at.point - p) / nearest.distance)
                                                                 : unit_or(nearest.outward, Vec3::UnitZ());
  }
  overlap_ = true;
  add(of, side_[of]->at_vertex(v), exit.at, exit.normal, exit.normal.dot(p - exit.at.point));
}

// Parts of one surface that are inside the other without meeting it.
void SurfaceContacts::find_enclosed(int of, OverlapRule* rule) {
  if (!side_[1 - of]->surface().closed()) return;
  for (const Index v : side_[of]->surface().component_vertices()) {
    if (visited_[of][static_cast<std::size_t>(v)] >= generation_) continue;
    if (!side_[1 - of]->may_hold(side_[of]->vertex(v))) continue;
    seeds_[of].push_back({v, std::numeric_limits<double>::infinity()});
    spread_inside(of, rule);
  }
}

bool SurfaceContacts::has_inside_end(int of, Index e) const {
  const std::array<Index, 2> ends = side_[of]->surface().edge(e).vertices;
  return std::any_of(ends.begin(), ends.end(),
                     [&](Index v) { return visited_[of][static_cast<std::size_t>(v)] == generation_ + 1; });
}

// Edges of two solids that have passed through each other, with no vertex inside to tell of it: of each piercing edge
// the crossing that is least deep.
void SurfaceContacts::cross_edges() {
  if (!side_[0]->sided() || !side_[1]->sided()) return;
  std::sort(piercings_.begin(), piercings_.end(), [](const Piercing& a, const Piercing& b) {
    return std::tie(a.of, a.edge, a.face) < std::tie(b.of, b.edge, b.face);
  });
  for (std::size_t first = 0; first < piercings_.size();) {
    const auto [of, edge, face, heights] = piercings_[first];
    EdgePair best{};
    best.distance = std::numeric_limits<double>::infinity();
    std::size_t next = first;
    for (; next < piercings_.size() && piercings_[next].of == of && piercings_[next].edge == edge; ++next)
      if (!has_inside_end(of, edge)) take_shallower_crossing(piercings_[next], best);
    if (best.distance < std::numeric_limits<double>::infinity()) {
      overlap_ = true;
      add_edges(best, -best.direction);
    }
    first = next;
  }
}

void SurfaceContacts::take_shallower_crossing(const Piercing& piercing, EdgePair& best) {
  for (int c = 0; c < 3; ++c) {
    const Index f = side_[1 - piercing.of]->surface().edge_of(piercing.face, c);
    if (has_inside_end(1 - piercing.of, f)) continue;
    const EdgePair pair = piercing.of == 0 ? nearest_of_edges(piercing.edge, f) : nearest_of_edges(f, piercing.edge);
    if (pair.distance < best.distance && side_[1]->in_normal_cone(pair.f, -pair.direction) &&
        side_[0]->in_normal_cone(pair.e, pair.direction))
      best = pair;
  }
}

// Surfaces that intersect where nothing tells inside from outside, such as a sheet: back out of the pierced face, the
// shorter way.
void SurfaceContacts::push_out_of_faces() {
  for (const Piercing& piercing : piercings_) {
    PairSurface& other = *side_[1 - piercing.of];
    const PairSurface::Face& f = other.face(piercing.face);
    const std::size_t end = std::abs(piercing.heights[0]) <= std::abs(piercing.heights[1]) ? 0 : 1;
    const double height = piercing.heights[end];
    const Index v = side_[piercing.of]->surface().edge(piercing.edge).vertices[end];
    const Vec3 n = height < 0.0 ? f.normal : Vec3(-f.normal);
    const Vec3 q = side_[piercing.of]->vertex(v) - height * f.normal;
    add(piercing.of, side_[piercing.of]->at_vertex(v), other.on_face(piercing.face, q), n, -std::abs(height));
  }
}

void SurfaceContacts::add(int of, const FeatureSide& mine, const FeatureSide& other, const Vec3& out_of_other,
                          double gap) {
  const bool first = self_ ? mine.key < other.key : of == 0;
  if (first)
    contacts_->push_back({mine, other, out_of_other, gap});
  else
    contacts_->push_back({other, mine, -out_of_other, gap});
}

}  // namespace limber
