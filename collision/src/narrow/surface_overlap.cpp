// Where surfaces have gone through each other: what is inside, and the way out of it.
#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "narrow/surface_contacts.h"

namespace limber::internal {
void SurfaceContacts::find_piercings(int of, Index s, Index t) {
  for (int c = 0; c < 3; ++c)
    if (self_ || side_[of]->owns_edge(s, c)) find_piercing(of, side_[of]->surface().edge_of(s, c), t);
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
  if (side_[1 - of]->sided()) inside_[of].seeds.push_back({ends[behind], t});
  // An edge that only begins or ends on the face, or meets its rim, touches it.
  if (front > tolerance_ && within > tolerance_) cut_.piercings.push_back({of, e, t, {h0, h1}, p, 0});
}

// From the ends of piercing edges over the mesh to every vertex that is inside the other surface.
void SurfaceContacts::spread_inside(int of, OverlapRule* rule) {
  std::vector<Seed>& seeds = inside_[of].seeds;
  while (!seeds.empty()) {
    const Seed seed = seeds.back();
    seeds.pop_back();
    std::uint32_t& visited = inside_[of].visited[static_cast<std::size_t>(seed.vertex)];
    if (visited >= generation_) continue;
    visited = generation_;
    const Vec3& p = side_[of]->vertex(seed.vertex);
    PairSurface& other = *side_[1 - of];
    const double reach = seed.near < 0 ? std::numeric_limits<double>::infinity() : other.distance_from(seed.near, p);
    const PairSurface::Nearest nearest = other.nearest(p, reach + directionless_);
    if (!nearest.inside) continue;
    visited = generation_ + 1;
    add_inside(of, seed.vertex, nearest, rule);
    for (const Index w : side_[of]->surface().vertex_neighbours(seed.vertex)) seeds.push_back({w, nearest.triangle});
  }
}

// The same of one surface. Its nearest point tells nothing there: that is the vertex itself.
void SurfaceContacts::spread_inside_itself(SelfOverlapRule& places) {
  PairSurface& mine = *side_[0];
  std::vector<Seed>& seeds = inside_[0].seeds;
  OverlapRule::Exit exit;
  while (!seeds.empty()) {
    const auto [v, near] = seeds.back();
    seeds.pop_back();
    std::uint32_t& visited = inside_[0].visited[static_cast<std::size_t>(v)];
    if (visited > generation_) continue;
    visited = generation_;
    if (!places.exit_of(v, mine, mine.on_face(near, mine.vertex(v)), exit)) continue;
    visited = generation_ + 1;
    inside_[0].exit_normal[static_cast<std::size_t>(v)] = exit.normal;
    add(0, mine.at_vertex(v), exit.at, exit.normal, exit.normal.dot(mine.vertex(v) - exit.at.point));
    for (const Index w : mine.surface().vertex_neighbours(v)) seeds.push_back({w, exit.at.triangle});
  }
}

void SurfaceContacts::add_inside(int of, Index v, const PairSurface::Nearest& nearest, OverlapRule* rule) {
  PairSurface& other = *side_[1 - of];
  const Vec3& p = side_[of]->vertex(v);
  OverlapRule::Exit exit;
  if (!leave_behind(of, v, exit) && (rule == nullptr || !rule->exit(other, p, nearest, exit))) {
    exit.at = other.at_foot(nearest.triangle, nearest.foot);
    exit.normal = nearest.distance > directionless_ ? Vec3((exit.at.point - p) / nearest.distance)
                                                    : unit_or(nearest.outward, Vec3::UnitZ());
  }
  if (nearest.distance <= nearness(of, v, nearest.triangle) && !side_[of]->in_front(v, exit.normal, tuning_->steep))
    find_supporting_face(of, v, nearest.triangle, flush(of, v, exit.at), exit);
  overlap_ = true;
  inside_[of].exit_normal[static_cast<std::size_t>(v)] = exit.normal;
  add(of, side_[of]->at_vertex(v), exit.at, exit.normal, exit.normal.dot(p - exit.at.point));
}

// A vertex of a surface that has a front and encloses nothing leaves the other where that ends behind it, however much
// nearer its front side is: what has come through from behind goes on to the front.
bool SurfaceContacts::leave_behind(int of, Index v, OverlapRule::Exit& exit) {
  PairSurface &mine = *side_[of], &other = *side_[1 - of];
  if (mine.surface().closed() || !other.surface().closed()) return false;
  const Vec3 back = -unit_or(mine.vertex_normal(v), Vec3::Zero());
  const PairSurface::WayOut way = other.way_out(mine.vertex(v), back);
  if (way.triangle < 0) return false;
  exit = {other.on_face(way.triangle, mine.vertex(v) + way.distance * back), other.face(way.triangle).normal};
  return true;
}

// Next to a rim, the nearest point may be on a face that the vertex's own surface does not follow: the top box of a
// stack would be pushed off sideways. The nearest face of those around whose normal it does follow is found, if it lies
// within reach.
bool SurfaceContacts::find_supporting_face(int of, Index v, Index near, bool aligned, OverlapRule::Exit& exit) {
  PairSurface &mine = *side_[of], &other = *side_[1 - of];
  const Vec3& p = mine.vertex(v);
  // Sides in one plane say nothing about how deep the overlap is.
  const double reach = (aligned ? tuning_->aligned_depth / tuning_->touching : 1.0) * nearness(of, v, near);
  double least = reach;
  for (const Index corner : other.surface().triangle(near))
    for (const Index t : other.surface().vertex_triangles(corner)) {
      const PairSurface::Face& f = other.face(t);
      const double height = std::abs(f.normal.dot(p - f.x[0]));
      if (!(height < least) || !mine.in_front(v, f.normal, tuning_->leaning)) continue;
      const SurfaceFoot foot = closest_on_triangle(p, f.x);
      if ((p - foot.point).norm() > reach) continue;
      exit = {other.at_foot(t, foot), f.normal};
      least = height;
    }
  return least < reach;
}

// Parts of one surface that are inside the other without meeting it.
void SurfaceContacts::find_enclosed(int of, OverlapRule* rule) {
  for (const Index v : side_[of]->surface().component_vertices()) {
    if (inside_[of].visited[static_cast<std::size_t>(v)] >= generation_) continue;
    if (!side_[1 - of]->may_hold(side_[of]->vertex(v))) continue;
    inside_[of].seeds.push_back({v, -1});
    spread_inside(of, rule);
  }
}

// Edges of two solids that have passed through each other. Surfaces intersect along closed loops, and what is to be
// freed is the part that a loop encloses: all crossings along the ways out of it count, so that bars laid across each
// other rest on every crossing of their outlines however deep each is.
void SurfaceContacts::cross_edges() {
  if (!side_[0]->sided() || !side_[1]->sided()) return;
  find_loops();
  for (std::size_t first = 0, next = 0; first < cut_.piercings.size(); first = next) {
    while (next < cut_.piercings.size() && cut_.piercings[next].loop == cut_.piercings[first].loop) ++next;
    cross_edges_of_loop(first, next);
  }
}

// Where two triangles intersect, an edge of one goes through the other at each end: piercings with a triangle pair in
// common belong to one loop. Sorts them by loop.
void SurfaceContacts::find_loops() {
  const auto sort_piercings = [this] {
    std::sort(cut_.piercings.begin(), cut_.piercings.end(), [](const Piercing& a, const Piercing& b) {
      return std::tie(a.loop, a.of, a.edge, a.face) < std::tie(b.loop, b.of, b.edge, b.face);
    });
  };
  sort_piercings();
  cut_.crossed.clear();
  for (std::size_t i = 0; i < cut_.piercings.size(); ++i) {
    const Piercing& p = cut_.piercings[i];
    for (const Index t : side_[p.of]->surface().edge_triangles(p.edge)) {
      const bool in_order = self_ ? t < p.face : p.of == 0;
      cut_.crossed.push_back({in_order ? TrianglePair{t, p.face} : TrianglePair{p.face, t}, static_cast<Index>(i)});
    }
  }
  std::sort(cut_.crossed.begin(), cut_.crossed.end(), [](const Crossed& a, const Crossed& b) {
    return std::tie(a.triangles, a.piercing) < std::tie(b.triangles, b.piercing);
  });
  cut_.loops.reset(cut_.piercings.size());
  for (std::size_t i = 1; i < cut_.crossed.size(); ++i)
    if (cut_.crossed[i].triangles == cut_.crossed[i - 1].triangles)
      cut_.loops.join(cut_.crossed[i].piercing, cut_.crossed[i - 1].piercing);
  for (std::size_t i = 0; i < cut_.piercings.size(); ++i)
    cut_.piercings[i].loop = cut_.loops.root(static_cast<Index>(i));
  sort_piercings();
}

void SurfaceContacts::cross_edges_of_loop(std::size_t first, std::size_t end) {
  cut_.crossings.clear();
  for (std::size_t i = first; i < end; ++i) find_crossings(cut_.piercings[i]);
  find_ways_out(first, end);
  const double same_way = tuning_->same_way;
  for (const EdgePair& crossing : cut_.crossings) {
    const Vec3 n = -crossing.direction;
    // Of one surface either part may be the one that an edge is of; its cones have told which way is out.
    if (std::none_of(cut_.ways_out.begin(), cut_.ways_out.end(),
                     [&](const Vec3& way) { return (self_ ? std::abs(n.dot(way)) : n.dot(way)) > same_way; }))
      continue;
    overlap_ = true;
    add_edges(crossing, n);
  }
}

// Of a piercing edge with the edges of the face.
void SurfaceContacts::find_crossings(const Piercing& piercing) {
  for (int c = 0; c < 3; ++c) {
    const Index f = side_[1 - piercing.of]->surface().edge_of(piercing.face, c);
    const EdgePair pair = piercing.of == 0 ? nearest_of_edges(piercing.edge, f) : nearest_of_edges(f, piercing.edge);
    if (pair.distance < std::numeric_limits<double>::infinity() && side_[1]->in_normal_cone(pair.f, -pair.direction) &&
        side_[0]->in_normal_cone(pair.e, pair.direction))
      cut_.crossings.push_back(pair);
  }
}

// The directions in which vertices leave that are inside next to the loop. Without any, the direction of the crossing
// along which the loop, and with it the region that both bodies share, is least wide.
void SurfaceContacts::find_ways_out(std::size_t first, std::size_t end) {
  cut_.ways_out.clear();
  for (std::size_t i = first; i < end; ++i) {
    const int of = cut_.piercings[i].of;
    for (const Index v : side_[of]->surface().edge(cut_.piercings[i].edge).vertices)
      if (inside_[of].visited[static_cast<std::size_t>(v)] == generation_ + 1)
        cut_.ways_out.push_back((of == 0 ? 1.0 : -1.0) * inside_[of].exit_normal[static_cast<std::size_t>(v)]);
  }
  if (!cut_.ways_out.empty() || cut_.crossings.empty()) return;
  const EdgePair* best = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (const EdgePair& crossing : cut_.crossings) {
    const double width = std::max(width_of_loop(first, end, crossing.direction), crossing.distance);
    if (width < least) least = width, best = &crossing;
  }
  cut_.ways_out.push_back(-best->direction);
}

double SurfaceContacts::width_of_loop(std::size_t first, std::size_t end, const Vec3& n) const {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (std::size_t i = first; i < end; ++i) {
    const double height = n.dot(cut_.piercings[i].point);
    low = std::min(low, height), high = std::max(high, height);
  }
  return high - low;
}

// Surfaces that intersect where nothing tells inside from outside, such as a sheet: back out of the pierced face, the
// shorter way.
void SurfaceContacts::push_out_of_faces() {
  for (const Piercing& piercing : cut_.piercings) {
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

}  // namespace limber::internal
