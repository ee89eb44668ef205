#include "field/field_edges.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>

#include "tuning.h"

namespace limber::internal {
namespace {

int corner_of(const CollisionSurface& surface, Index t, Index e) {
  return surface.edge_of(t, 0) == e ? 0 : surface.edge_of(t, 1) == e ? 1 : 2;
}

}  // namespace

void FieldEdges::begin(const FieldView& a_in_b, const FieldView& b_in_a, float reach, float passed) {
  view_[0] = a_in_b, view_[1] = b_in_a, reach_ = reach, passed_ = passed;
  piercings_.clear(), contacts_.clear();
  ++generation_;
  for (int of = 0; of < 2; ++of) {
    const auto vertices = static_cast<std::size_t>(view_[of].mine->shell().surface().vertices());
    if (generation_ == 0) std::ranges::fill(stamp_[of], 0u);
    if (stamp_[of].size() < vertices) stamp_[of].resize(vertices), exit_[of].resize(vertices);
  }
  if (generation_ == 0) generation_ = 1;
}

void FieldEdges::set_exit(int of, Index vertex, const Vec3f& direction) {
  stamp_[of][static_cast<std::size_t>(vertex)] = generation_;
  exit_[of][static_cast<std::size_t>(vertex)] = direction;
}

void FieldEdges::find(int of, const SampleBounds& ends, std::span<const std::uint32_t> clusters) {
  const FieldView& view = view_[of];
  const Pointshell& mine = view.mine->shell();
  grow(hits_, kHitsOfEdge * kFieldLanes * clusters.size());
  const std::size_t count = near_edges(view.query, view.mine->view(), ends, clusters.data(), clusters.size(),
                                       static_cast<float>(view.other->shell().cell()), hits_.data());
  for (const FieldHit& hit : std::span(hits_).first(count)) {
    const Index e = mine.edge(hit.feature);
    if (hit.feature > 0 && mine.edge(hit.feature - 1) == e) continue;  // repeated to fill eights
    const auto& between = mine.surface().edge(e).vertices;
    const Vec3f from = view.placed(view.mine->vertex(between[0])), to = view.placed(view.mine->vertex(between[1]));
    const Index near = view.other->shell().triangle_near(hit);
    if (goes_through_face(of, e, near, from, to)) continue;
    // Of the face next to the point at which the field is least.
    const Segment edge = segment(of, e);
    for_edges_of_face(1 - of, walk_to_foot(*view.other, near, from + hit.along * (to - from)).triangle,
                      [&](const Segment& other) { add_separated(of, edge, other); });
  }
}

// Along an edge the foot goes from one feature to the next: next to the vertex it stays on the one that it is on there.
// The field sees no change of its distance within a part of a cell.
void FieldEdges::find_at_end(int of, const SampleFoot& sample) {
  if (sample.foot.corners == kFootOnFace) return;
  const FieldView& view = view_[of];
  const CollisionSurface &mine = view.mine->shell().surface(), &other = view.other->shell().surface();
  const Vec3f out = sample.at - sample.foot.point;
  met_.clear();
  for (const Index t : mine.vertex_triangles(sample.vertex)) {
    const auto corner =
        static_cast<std::size_t>(std::ranges::find(mine.triangle(t), sample.vertex) - mine.triangle(t).begin());
    const Index e = mine.edge_of(t, static_cast<int>(corner));
    if (!view.mine->shell().sticks_out(e)) continue;
    const Vec3f to = view.placed(view.mine->vertex(mine.triangle(t)[(corner + 1) % 3]));
    if (out.dot(to - sample.at) >= 0.0f) continue;  // the distance rises
    if (goes_through_face(of, e, sample.foot.triangle, sample.at, to)) continue;
    if (met_.empty())
      for_edges_at(other, sample.foot, [&](Index f) {
        if (view.other->shell().sticks_out(f)) met_.push_back(segment(1 - of, f));
      });
    const Segment edge = segment(of, e);
    for (const Segment& met : met_) add_separated(of, edge, met);
  }
}

bool FieldEdges::goes_through_face(int of, Index edge, Index near, const Vec3f& from, const Vec3f& to) {
  const FieldView& view = view_[of];
  const Pierced through = walk_to_face(*view.other, near, from, to);
  if (through.triangle < 0 || !(through.along > 0.0f && through.along < 1.0f)) return false;
  const Vec3f point = from + through.along * (to - from);
  piercings_.push_back({of, edge, through.triangle, of == 0 ? view.turned_back(point - view.shift) : point, 0});
  return true;
}

Vec3f FieldEdges::vertex(int of, Index v) const {
  return of == 0 ? view_[0].mine->vertex(v) : view_[1].placed(view_[1].mine->vertex(v));
}

FieldEdges::Segment FieldEdges::segment(int of, Index edge) const {
  const auto& ends = view_[of].mine->shell().surface().edge(edge).vertices;
  const Vec3f from = vertex(of, ends[0]);
  return {edge, from, vertex(of, ends[1]) - from};
}

// Those that stick out.
template <class Visit>
void FieldEdges::for_edges_of_face(int of, Index face, const Visit& visit) const {
  const Pointshell& shell = view_[of].mine->shell();
  const Triangle& t = shell.surface().triangle(face);
  const std::array<Vec3f, 3> x{vertex(of, t[0]), vertex(of, t[1]), vertex(of, t[2])};
  for (std::size_t c = 0; c < 3; ++c) {
    const Index e = shell.surface().edge_of(face, static_cast<int>(c));
    if (!shell.sticks_out(e)) continue;
    const bool forward = shell.surface().edge(e).vertices[0] == t[c];
    const Vec3f &from = x[forward ? c : (c + 1) % 3], &to = x[forward ? (c + 1) % 3 : c];
    visit(Segment{e, from, to - from});
  }
}

// Where the common perpendicular of two edges meets both between their ends.
bool FieldEdges::nearest_of_edges(const Segment& e, const Segment& f, EdgePair& pair) {
  const Vec3f &u = e.along, &w = f.along, r = f.from - e.from;
  const Vec3f n = u.cross(w);
  const float n2 = n.squaredNorm();
  // Directions of lines nearer to parallel are noise in single precision.
  const auto parallel = static_cast<float>(collision_tuning().narrow.parallel_touching);
  if (!(n2 > parallel * parallel * u.squaredNorm() * w.squaredNorm())) return false;
  const float s = r.cross(w).dot(n) / n2;
  if (!(s > 0.0f && s < 1.0f)) return false;
  const float t = r.cross(u).dot(n) / n2;
  if (!(t > 0.0f && t < 1.0f)) return false;
  pair = {e.edge, f.edge, s, t, e.from + s * u, f.from + t * w, n / std::sqrt(n2), 0.0f};
  pair.distance = pair.direction.dot(pair.on_e - pair.on_f);
  if (pair.distance < 0.0f) pair.distance = -pair.distance, pair.direction = -pair.direction;
  return true;
}

// So near that the sign of the direction is noise.
bool FieldEdges::touches(const EdgePair& pair) const {
  return pair.distance <= kNoise * static_cast<float>(view_[0].mine->shell().longest_side());
}

// Gives the direction the sign with which it leads out of b, or into it.
void FieldEdges::turn(EdgePair& pair, float out_of_b) const {
  Vec3f outward = Vec3f::Zero();
  for (const Index t : view_[1].mine->shell().surface().edge_triangles(pair.f))
    outward += face_normal(*view_[1].mine, t);
  if (out_of_b * pair.direction.dot(view_[1].turn * outward) < 0.0f) pair.direction = -pair.direction;
}

// See PairSurface::in_normal_cone().
bool FieldEdges::in_normal_cone(int of, Index edge, const Vec3f& direction) const {
  const DeformedPointshell& body = *view_[of].mine;
  const CollisionSurface& surface = body.shell().surface();
  const Vec3f d = of == 0 ? direction : view_[1].turned_back(direction);
  const auto& ends = surface.edge(edge).vertices;
  const Vec3f from = body.vertex(ends[0]), along = (body.vertex(ends[1]) - from).normalized();
  Vec3f sum = Vec3f::Zero(), outward = Vec3f::Zero();
  float worst = -1.0f;
  for (const Index t : surface.edge_triangles(edge)) {
    const Index tip = surface.triangle(t)[static_cast<std::size_t>((corner_of(surface, t, edge) + 2) % 3)];
    Vec3f inward = body.vertex(tip) - from;
    inward = (inward - along.dot(inward) * along).normalized();
    sum += inward, outward += face_normal(body, t);
    worst = std::max(worst, inward.dot(d));
  }
  constexpr float kRoundOffOfDirections = 1e-5f;
  const auto rocking = static_cast<float>(collision_tuning().narrow.rocking);
  return worst <= kRoundOffOfDirections + rocking * sum.norm() && outward.dot(d) >= -kRoundOffOfDirections;
}

// Edges that have not crossed.
void FieldEdges::add_separated(int of, const Segment& edge, const Segment& other) {
  EdgePair pair;
  if (!nearest_of_edges(of == 0 ? edge : other, of == 0 ? other : edge, pair)) return;
  if (touches(pair)) turn(pair, 1.0f);
  const Vec3f motion = expected_motion(pair);
  if (!comes_near(pair, motion)) return;
  if (!in_normal_cone(1, pair.f, pair.direction) || !in_normal_cone(0, pair.e, -pair.direction)) return;
  if (unhindered(pair, motion)) add(pair, pair.direction);
}

// How the point of a is expected to move against that of b.
Vec3f FieldEdges::expected_motion(const EdgePair& pair) const {
  const auto swing = [&](int of, Index edge, float along) {
    const auto& ends = view_[of].mine->shell().surface().edge(edge).vertices;
    const Vec3f from = view_[of].mine->swing(ends[0]);
    return Vec3f(from + along * (view_[of].mine->swing(ends[1]) - from));
  };
  const FieldView& view = view_[1];
  const Vec3f of_b = view.carried(view.turned_back(pair.on_f - view.shift)) + view.turn * swing(1, pair.f, pair.t);
  return swing(0, pair.e, pair.s) - of_b;
}

// Whether a gap, but for round-off, is one that settle() of FieldContacts keeps.
bool FieldEdges::comes_near(const EdgePair& pair, const Vec3f& motion) const {
  const auto& fall = view_[1].query.fall;
  const float closing = std::abs(pair.direction.dot(Vec3f(fall[0], fall[1], fall[2]))) - pair.direction.dot(motion);
  const float round_off = kNoise * (static_cast<float>(view_[0].mine->shell().longest_side()) + motion.norm());
  return pair.distance <= reach_ + std::max(closing, 0.0f) + round_off;
}

// See unhindered() of a sample.
bool FieldEdges::unhindered(EdgePair& pair, const Vec3f& motion) const {
  const FieldView& view = view_[1];
  const Vec3f apart = pair.on_e - pair.on_f;
  const Vec3f direction = pair.direction;
  const float noise = kNoise * (apart.norm() + motion.norm());
  float end = direction.dot(apart + motion);
  if (!(end < 0.0f)) return true;
  // Next to an end the vertex there tells of it.
  const auto room = [&](int of, Index edge, float along) {
    const auto& ends = view_[of].mine->shell().surface().edge(edge).vertices;
    return std::min(along, 1.0f - along) * (vertex(of, ends[1]) - vertex(of, ends[0])).norm();
  };
  if (std::min(room(0, pair.e, pair.s), room(1, pair.f, pair.t)) <= passed_) return false;
  const auto try_normal = [&](const Vec3f& n) {
    const float gap = n.dot(apart);
    if (!(gap >= -passed_) || !(gap + n.dot(motion) > end + noise)) return;
    if (!in_normal_cone(1, pair.f, n) || !in_normal_cone(0, pair.e, -n)) return;
    pair.direction = n, end = gap + n.dot(motion);
  };
  for (const Index t : view_[0].mine->shell().surface().edge_triangles(pair.e))
    try_normal(-face_normal(*view_[0].mine, t));
  for (const Index t : view.mine->shell().surface().edge_triangles(pair.f))
    try_normal(view.turn * face_normal(*view.mine, t));
  return pair.direction == direction || end < -passed_;
}

// Where two facets intersect, an edge of one goes through the other at each end: piercings with a pair of facets in
// common belong to one loop. Sorts them by loop.
void FieldEdges::find_loops() {
  crossed_.clear();
  for (std::size_t i = 0; i < piercings_.size(); ++i) {
    const Piercing& p = piercings_[i];
    const Pointshell &mine = view_[p.of].mine->shell(), &other = view_[p.of].other->shell();
    for (const Index t : mine.surface().edge_triangles(p.edge)) {
      const auto of_mine = static_cast<std::uint64_t>(mine.facet(t)),
                 of_other = static_cast<std::uint64_t>(other.facet(p.face));
      const auto of_a = p.of == 0 ? of_mine : of_other, of_b = p.of == 0 ? of_other : of_mine;
      crossed_.push_back({of_a << 32 | of_b, static_cast<Index>(i)});
    }
  }
  std::ranges::sort(crossed_, [](const Crossed& x, const Crossed& y) {
    return std::tie(x.facets, x.piercing) < std::tie(y.facets, y.piercing);
  });
  loops_.reset(piercings_.size());
  for (std::size_t i = 1; i < crossed_.size(); ++i)
    if (crossed_[i].facets == crossed_[i - 1].facets) loops_.join(crossed_[i].piercing, crossed_[i - 1].piercing);
  for (std::size_t i = 0; i < piercings_.size(); ++i) piercings_[i].loop = loops_.root(static_cast<Index>(i));
  std::ranges::sort(piercings_, [](const Piercing& x, const Piercing& y) {
    return std::tie(x.loop, x.of, x.edge, x.face) < std::tie(y.loop, y.of, y.edge, y.face);
  });
  const auto repeated = std::unique(piercings_.begin(), piercings_.end(), [](const Piercing& x, const Piercing& y) {
    return x.of == y.of && x.edge == y.edge && x.face == y.face;
  });
  piercings_.erase(repeated, piercings_.end());
}

// Edges that stick out and have crossed on a loop: those that lead out, and those of which each goes through a facet
// next to the other.
void FieldEdges::find_crossings(std::size_t first, std::size_t end) {
  crossings_.clear();
  for (std::size_t i = first; i < end; ++i) {
    const Piercing& p = piercings_[i];
    const Pointshell& other = view_[p.of].other->shell();
    const Segment edge = segment(p.of, p.edge);
    for_edges_of_face(1 - p.of, p.face, [&](const Segment& of_face) { cross(p.of, edge, of_face, first, end); });
    for (std::size_t j = first; j < end; ++j) {
      const Piercing& back = piercings_[j];
      const bool seen = j > first && piercings_[j - 1].of == back.of && piercings_[j - 1].edge == back.edge;
      if (back.of != p.of && !seen && is_next_to(other, back.edge, p.face))
        cross(p.of, edge, segment(back.of, back.edge), first, end);
    }
  }
}

// Whether an edge bounds the facet of a face, and not the face.
bool FieldEdges::is_next_to(const Pointshell& body, Index edge, Index face) {
  const auto around = body.surface().edge_triangles(edge);
  return std::ranges::find(around, face) == around.end() &&
         std::ranges::any_of(around, [&](Index t) { return body.facet(t) == body.facet(face); });
}

// An edge that goes through a facet and one that bounds it, if they have crossed.
void FieldEdges::cross(int of, const Segment& edge, const Segment& other, std::size_t first, std::size_t end) {
  EdgePair pair;
  if (!nearest_of_edges(of == 0 ? edge : other, of == 0 ? other : edge, pair)) return;
  if (touches(pair)) turn(pair, -1.0f);
  pair.leads_out = in_normal_cone(1, pair.f, -pair.direction) && in_normal_cone(0, pair.e, pair.direction);
  if (pair.leads_out || goes_through(other.edge, 1 - of, edge.edge, first, end)) crossings_.push_back(pair);
}

// Whether an edge goes through a facet next to one of the other surface, on a loop.
bool FieldEdges::goes_through(Index edge, int of, Index other, std::size_t first, std::size_t end) const {
  const Pointshell& body = view_[of].other->shell();
  const auto next_to = body.surface().edge_triangles(other);
  return std::any_of(piercings_.begin() + static_cast<std::ptrdiff_t>(first),
                     piercings_.begin() + static_cast<std::ptrdiff_t>(end), [&](const Piercing& p) {
                       return p.of == of && p.edge == edge && std::ranges::any_of(next_to, [&](Index t) {
                                return body.facet(t) == body.facet(p.face);
                              });
                     });
}

// Bodies part along one of the directions in which vertices leave and edges have crossed: that in which what they share
// is least wide, vertices' first among those that differ by what counts as passed. Edges that have crossed otherwise do
// not stand in their way. Where a corner goes through a ridge and beyond, no vertex is inside and no crossing may lead
// out of both surfaces: then any crossing will do.
void FieldEdges::cross_loop(std::size_t first, std::size_t end) {
  find_crossings(first, end);
  find_ways_out(first, end);
  const auto leads_out = [](const EdgePair& crossing) { return crossing.leads_out; };
  if (!ways_out_.empty() || std::ranges::any_of(crossings_, leads_out))
    std::erase_if(crossings_, [](const EdgePair& crossing) { return !crossing.leads_out; });
  if (crossings_.empty()) return;
  float least = std::numeric_limits<float>::infinity();
  Vec3f best = Vec3f::Zero();
  const auto try_way = [&](const Vec3f& way, float more) {
    if (const float wide = width(way) + more; wide < least) least = wide, best = way;
  };
  for (const WayOut& way : ways_out_) try_way(way.along, 0.0f);
  for (const EdgePair& crossing : crossings_) try_way(-crossing.direction, passed_);
  for (const EdgePair& crossing : crossings_)
    if (leaves_along(crossing, best)) add(crossing, -crossing.direction);
}

bool FieldEdges::leaves_along(const EdgePair& crossing, const Vec3f& way) {
  return -crossing.direction.dot(way) > static_cast<float>(collision_tuning().narrow.same_way);
}

// Directions in which vertices leave that are inside next to the loop, and the points that bound what bodies share
// there.
void FieldEdges::find_ways_out(std::size_t first, std::size_t end) {
  ways_out_.clear();
  shared_.clear();
  for (std::size_t i = first; i < end; ++i) {
    const int of = piercings_[i].of;
    shared_.push_back(piercings_[i].point);
    const CollisionSurface& surface = view_[of].mine->shell().surface();
    const auto leave = [&](Index v) {
      if (stamp_[of][static_cast<std::size_t>(v)] != generation_) return false;
      const auto known = [&](const WayOut& way) { return way.of == of && way.vertex == v; };
      if (std::ranges::any_of(ways_out_, known)) return true;
      ways_out_.push_back({of, v, exit_[of][static_cast<std::size_t>(v)]});
      shared_.push_back(vertex(of, v));
      return true;
    };
    for (const Index v : surface.edge(piercings_[i].edge).vertices)
      // Their neighbours too: edges that do not stick out go through the loop as well and are not looked at.
      if (leave(v))
        for (const Index w : surface.vertex_neighbours(v)) leave(w);
  }
}

// Of what bodies share next to a loop, and of the edges that would part there.
float FieldEdges::width(const Vec3f& way) const {
  float low = std::numeric_limits<float>::infinity(), high = -low, deepest = 0.0f;
  for (const Vec3f& point : shared_) {
    const float height = way.dot(point);
    low = std::min(low, height), high = std::max(high, height);
  }
  for (const EdgePair& crossing : crossings_)
    if (leaves_along(crossing, way)) deepest = std::max(deepest, crossing.distance);
  return std::max(high - low, deepest);
}

FeatureSide FieldEdges::on_edge(int of, Index edge, float along, const Vec3f& point) const {
  const CollisionSurface& surface = view_[of].mine->shell().surface();
  const Index t = surface.edge_triangles(edge).front();
  const auto corner = static_cast<std::size_t>(corner_of(surface, t, edge));
  const bool forward = surface.triangle(t)[corner] == surface.edge(edge).vertices[0];
  const double at_next = static_cast<double>(forward ? along : 1.0f - along);
  FeatureSide side{.key = feature_key(Feature::Kind::kEdge, edge), .triangle = t};
  side.weight[corner] = 1.0 - at_next, side.weight[(corner + 1) % 3] = at_next;
  side.point = (of == 0 ? point : view_[1].turned_back(point - view_[1].shift)).cast<double>();
  return side;
}

void FieldEdges::add(const EdgePair& pair, const Vec3f& normal) {
  contacts_.push_back(
      {{on_edge(0, pair.e, pair.s, pair.on_e), on_edge(1, pair.f, pair.t, pair.on_f)}, normal.cast<double>()});
}

void FieldEdges::finish(std::vector<FoundContact>& found) {
  find_loops();
  for (std::size_t first = 0, next = 0; first < piercings_.size(); first = next) {
    while (next < piercings_.size() && piercings_[next].loop == piercings_[first].loop) ++next;
    cross_loop(first, next);
  }
  std::ranges::sort(contacts_, {}, &FoundContact::id);
  const auto repeated = std::unique(contacts_.begin(), contacts_.end(),
                                    [](const FoundContact& c, const FoundContact& d) { return c.id() == d.id(); });
  found.insert(found.end(), contacts_.begin(), repeated);
}

}  // namespace limber::internal
