#include "narrow/surface_contacts.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace limber::internal {
namespace {

bool apart(const Aabb& a, const Aabb& b, double margin) {
  return ((a.low - b.high).array() > margin).any() || ((b.low - a.high).array() > margin).any();
}

// Whether one triangle lies beyond the margin on one side of the other's plane.
bool planes_separate(const PairSurface::Face& s, const PairSurface::Face& t, double margin) {
  const auto beyond = [&](const PairSurface::Face& plane, const TrianglePoints& x) {
    const double h0 = plane.normal.dot(x[0] - plane.x[0]), h1 = plane.normal.dot(x[1] - plane.x[0]),
                 h2 = plane.normal.dot(x[2] - plane.x[0]);
    return (h0 > margin && h1 > margin && h2 > margin) || (h0 < -margin && h1 < -margin && h2 < -margin);
  };
  return beyond(s, t.x) || beyond(t, s.x);
}

}  // namespace

void SurfaceContacts::begin(PairSurface& a, PairSurface& b, double margin, bool self,
                            std::vector<FeatureContact>& contacts) {
  tuning_ = &collision_tuning().narrow;
  side_[0] = &a, side_[1] = &b;
  margin_ = margin, tolerance_ = a.tolerance(), directionless_ = a.directionless(), self_ = self, overlap_ = false;
  contacts_ = &contacts;
  pairs_.clear(), cut_.piercings.clear();
  for (int of = 0; of < 2; ++of) {
    inside_[of].seeds.clear();
    const auto vertices = static_cast<std::size_t>(side_[of]->surface().vertices());
    constexpr std::size_t kSeedsOfAVertex = 8;  // its neighbours, and where edges come through the other surface
    if (inside_[of].visited.size() < vertices)
      inside_[of].visited.resize(vertices), inside_[of].exit_normal.resize(vertices);
    inside_[of].seeds.reserve(kSeedsOfAVertex * vertices);
  }
  if (generation_ > std::numeric_limits<std::uint32_t>::max() - 4) {
    for (Inside& side : inside_) std::fill(side.visited.begin(), side.visited.end(), 0u);
    generation_ = 0;
  }
  generation_ += 2;
}

void SurfaceContacts::find(PairSurface& a, PairSurface& b, const RigidTransform& X_AB, const ContactReach& reach,
                           OverlapRule* rule_a, OverlapRule* rule_b, std::vector<FeatureContact>& contacts) {
  begin(a, b, reach.margin, false, contacts);
  passed_ = reach.passed;
  find_pairs(X_AB, reach);
  for (const auto& [s, t] : pairs_) test_pair(s, t);
  spread_inside(0, rule_b);
  spread_inside(1, rule_a);
  find_enclosed(0, rule_b);
  find_enclosed(1, rule_a);
  cross_edges();
  if (!overlap_) push_out_of_faces();
}

void SurfaceContacts::find_self(PairSurface& a, double margin, SelfOverlapRule* places,
                                std::vector<FeatureContact>& contacts) {
  begin(a, a, margin, true, contacts);
  find_self_pairs(a.deformed(), margin, pairs_);
  for (const auto& [s, t] : pairs_) test_pair(s, t);
  if (places != nullptr) {
    spread_inside_itself(*places);
    cross_edges();
  }
  if (!a.sided()) push_out_of_faces();
}

// The way counts as far as gaps go.
void SurfaceContacts::find_pairs(const RigidTransform& X_AB, const ContactReach& reach) {
  DeformedSurface &a = side_[0]->deformed(), &b = side_[1]->deformed();
  if (reach.all_around()) {
    find_triangle_pairs(a, b, X_AB, reach.margin, pairs_);
    return;
  }
  const double way = reach.way_A.norm();
  const double share = way > 0.0 ? std::min(1.0, (reach.margin - reach.beside) / way) : 0.0;
  find_triangle_pairs(a, b, X_AB, reach.beside, pairs_, share * reach.way_A);
}

void SurfaceContacts::test_pair(Index s, Index t) {
  const PairSurface::Face &f = side_[0]->face(s), &g = side_[1]->face(t);
  if (apart(f.box, g.box, margin_) || planes_separate(f, g, margin_)) return;
  test_vertices(0, s, t);
  test_vertices(1, t, s);
  test_edges(s, t);
  if (apart(f.box, g.box, 0.0)) return;
  find_piercings(0, s, t);
  find_piercings(self_ ? 0 : 1, t, s);  // of itself a surface is one side
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
    if (mine.sees(v, minimum.at.point)) add_vertex(of, v, minimum);
  });
}

// How near a vertex and a face must be for the faces at hand to tell the normal.
double SurfaceContacts::nearness(int of, Index v, Index t) {
  const std::array<Vec3, 3>& x = side_[1 - of]->face(t).x;
  double shortest = side_[of]->shortest_edge(v);
  for (std::size_t c = 0; c < 3; ++c) shortest = std::min(shortest, (x[(c + 1) % 3] - x[c]).norm());
  return tuning_->touching * shortest;
}

void SurfaceContacts::add_vertex(int of, Index v, PairSurface::Minimum minimum) {
  PairSurface& mine = *side_[of];
  const bool solids = mine.sided() && side_[1 - of]->sided();
  const bool near = solids && minimum.distance <= nearness(of, v, minimum.at.triangle);
  if (near && rests_on_faces(of, v, minimum)) return;
  if (near && kind_of(minimum.at.key) == Feature::Kind::kVertex) {  // or the other's corner on my faces
    PairSurface::Minimum back = minimum;
    back.at = mine.at_vertex(v);
    if (rests_on_faces(1 - of, index_of(minimum.at.key), back)) return;
  }
  if (near && kind_of(minimum.at.key) != Feature::Kind::kFace && minimum.distance <= directionless_)
    minimum.direction = unit_or(minimum.direction - unit_or(mine.vertex_normal(v), Vec3::Zero()), minimum.direction);
  const Vec3 n = solids ? unhindered(of, v, minimum) : minimum.direction;
  if (n.isZero()) return;
  add(of, mine.at_vertex(v), minimum.at, n, n.dot(mine.vertex(v) - minimum.at.point));
}

// The normal of touching features lies in the cones of both. Where faces touch it is theirs, one contact for each
// direction in which they do (in a corner there are several); where they only have a rim in common there is none:
// bodies side by side, or on a floor of boxes, press on each other's faces but not on their edges.
// Returns whether faces decide it.
bool SurfaceContacts::rests_on_faces(int of, Index v, const PairSurface::Minimum& minimum) {
  PairSurface &mine = *side_[of], &other = *side_[1 - of];
  const Vec3& p = mine.vertex(v);
  const FeatureSide& at = minimum.at;
  bool rim = false;
  std::size_t count = 0;
  std::array<Index, 3> touching{};  // one face for each direction
  other.for_faces_at(at.key, [&](Index t) {
    if (kind_of(at.key) == Feature::Kind::kFace) return;
    const Touch found = touch(of, v, at, t);
    rim = rim || found == Touch::kRim;
    if (found != Touch::kArea || count == touching.size()) return;
    for (std::size_t i = 0; i < count; ++i)
      if (other.face(touching[i]).normal.dot(other.face(t).normal) > 1.0 - tuning_->flat) return;
    touching[count++] = t;
  });
  for (std::size_t i = 0; i < count; ++i) {
    const FeatureSide side = count > 1 ? other.on_face(touching[i], at.point) : at;
    const Vec3& n = other.face(touching[i]).normal;
    add(of, mine.at_vertex(v), side, n, n.dot(p - at.point));
  }
  if (count > 0) return true;
  const bool aligned = flush(of, v, at);
  if (!aligned && (rim || mine.in_front(v, minimum.direction, tuning_->leaning))) return rim;
  OverlapRule::Exit exit;
  if (!find_supporting_face(of, v, at.triangle, aligned, exit)) return rim;
  const double gap = exit.normal.dot(p - exit.at.point);
  // Beside a rim and below the face's plane nothing overlaps unless the surface goes in from there.
  if (gap < -tolerance_ && !aligned && !enters(of, v, at.triangle)) return rim;
  add(of, mine.at_vertex(v), exit.at, exit.normal, gap);
  return true;
}

// Whether an edge of a vertex that is not inside goes in through one of the faces around.
bool SurfaceContacts::enters(int of, Index v, Index near) {
  PairSurface &mine = *side_[of], &other = *side_[1 - of];
  const Vec3& p = mine.vertex(v);
  for (const Index w : mine.surface().vertex_neighbours(v))
    for (const Index corner : other.surface().triangle(near))
      for (const Index t : other.surface().vertex_triangles(corner)) {
        const PairSurface::Face& f = other.face(t);
        const double from = f.normal.dot(p - f.x[0]), to = f.normal.dot(mine.vertex(w) - f.x[0]);
        if (!(from >= -tolerance_ && to < -tolerance_)) continue;
        const Vec3 through = p + std::clamp(from / (from - to), 0.0, 1.0) * (mine.vertex(w) - p);
        bool within = true;
        for (std::size_t c = 0; c < 3; ++c) within = within && (through - f.x[c]).dot(f.inward[c]) >= -tolerance_;
        if (within) return true;
      }
  return false;
}

// Whether a face at a vertex lies in one plane with a face of the other's, the one solid within the other there.
bool SurfaceContacts::flush(int of, Index v, const FeatureSide& at) {
  PairSurface &mine = *side_[of], &other = *side_[1 - of];
  bool any = false;
  other.for_faces_at(at.key, [&](Index t) {
    for (const Index g : mine.surface().vertex_triangles(v))
      any = any || mine.face(g).normal.dot(other.face(t).normal) > 1.0 - tuning_->flat * tuning_->flat;
  });
  if (!any) return false;
  const Vec3 into = -unit_or(mine.vertex_normal(v), Vec3::Zero());
  bool within = true;
  other.for_faces_at(at.key, [&](Index t) { within = within && other.face(t).normal.dot(into) < -tuning_->flat; });
  return within;
}

// Whether the surface at a vertex lies on a face of the other's, at a point of its rim: flat on it with an area or an
// edge, or along the rim alone.
SurfaceContacts::Touch SurfaceContacts::touch(int of, Index v, const FeatureSide& at, Index t) {
  PairSurface &mine = *side_[of], &other = *side_[1 - of];
  const PairSurface::Face& f = other.face(t);
  if (!mine.in_front(v, f.normal, tuning_->flat)) return Touch::kNone;
  // Directions that lead from the point into a face are those along all inward normals of its edges there.
  const auto leads_into = [into = tuning_->leads_into](const PairSurface::Face& face, const std::array<bool, 3>& edges,
                                                       const Vec3& d) {
    for (std::size_t c = 0; c < 3; ++c)
      if (edges[c] && !(d.dot(face.inward[c]) > into)) return false;
    return true;
  };
  std::array<bool, 3> rim{};
  for (std::size_t c = 0; c < 3; ++c) rim[c] = std::abs((at.point - f.x[c]).dot(f.inward[c])) <= tolerance_;
  const auto direction = [](const Vec3& d) { return unit_or(d, Vec3::Zero()); };
  const Vec3& p = mine.vertex(v);
  bool flat = false;
  for (const Index w : mine.surface().vertex_neighbours(v)) {
    const Vec3 d = direction(mine.vertex(w) - p);
    if (std::abs(d.dot(f.normal)) <= tuning_->flat && leads_into(f, rim, d)) return Touch::kArea;
  }
  // Or what leads into the face lies within a face of mine.
  for (const Index g : mine.surface().vertex_triangles(v)) {
    const PairSurface::Face& own = mine.face(g);
    if (own.normal.dot(f.normal) > -1.0 + tuning_->flat * tuning_->flat) continue;
    flat = true;
    std::array<bool, 3> at_v{};
    std::array<Vec3, 5> rays;
    std::size_t count = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      at_v[c] = mine.surface().triangle(g)[c] == v || mine.surface().triangle(g)[(c + 1) % 3] == v;
      if (mine.surface().triangle(g)[c] != v) rays[count++] = direction(own.x[c] - p);
      if ((f.x[c] - at.point).norm() > tolerance_) rays[count++] = direction(f.x[c] - at.point);
    }
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t j = 0; j < i; ++j)
        if (const Vec3 d = direction(rays[i] + rays[j]); leads_into(f, rim, d) && leads_into(own, at_v, d))
          return Touch::kArea;
  }
  return flat ? Touch::kRim : Touch::kNone;
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
  const double parallel = collision_tuning().convex.parallel_lines;
  if (!(n2 > parallel * parallel * u2 * w2)) return pair;
  const double along_e = r.cross(w).dot(n), along_f = r.cross(u).dot(n);
  if (!(along_e > 0.0 && along_e < n2 && along_f > 0.0 && along_f < n2)) return pair;
  const double s = along_e / n2, t = along_f / n2;
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
  const Vec3 u = side_[0]->edge_vector(pair.e), w = side_[1]->edge_vector(pair.f);
  if (pair.distance <= tuning_->touching * shorter_edge(pair) &&
      u.cross(w).norm() <= tuning_->parallel_touching * u.norm() * w.norm())
    return;
  if (pair.distance <= directionless_ && pair.direction.dot(side_[1]->edge_normal(pair.f)) < 0.0)
    pair.direction = -pair.direction;
  if (!side_[1]->in_normal_cone(pair.f, pair.direction) || !side_[0]->in_normal_cone(pair.e, -pair.direction)) return;
  if (const Vec3 n = unhindered(pair); !n.isZero()) add_edges(pair, n);
}

double SurfaceContacts::shorter_edge(const EdgePair& pair) {
  return std::min(side_[0]->edge_vector(pair.e).norm(), side_[1]->edge_vector(pair.f).norm());
}

void SurfaceContacts::add_edges(const EdgePair& pair, const Vec3& normal) {
  add(0, side_[0]->on_edge(pair.e, pair.s, pair.on_e), side_[1]->on_edge(pair.f, pair.t, pair.on_f), normal,
      normal.dot(pair.on_e - pair.on_f));
}

// -- What the bodies' motion meets ------------------------------------------------------------------------------------

// A contact stands for a plane, which may end where it was found: something that moves along the top of a box is not to
// be stopped by the plane of its side, nor by the next box's. Where the expected motion would pass the plane, another
// one of the same two features is taken if it passes that less: one of a face, in the cones of both. Zero: it does not
// pass that one, so the two will not meet.
Vec3 SurfaceContacts::unhindered(int of, Index v, const PairSurface::Minimum& minimum) {
  PairSurface &mine = *side_[of], &other = *side_[1 - of];
  const Vec3& p = mine.vertex(v);
  const Vec3 motion = mine.expected_motion(p) - other.expected_motion(minimum.at.point);
  Vec3 best = minimum.direction;
  double end = minimum.distance + best.dot(motion);
  if (!(end < 0.0)) return best;
  const double passed = std::max(passed_, tuning_->passed / tuning_->touching * nearness(of, v, minimum.at.triangle));
  const auto try_normal = [&](const FeatureSide& at, const Vec3& n) {
    const double gap = n.dot(p - at.point);
    if (!(gap >= -passed) || !(gap + n.dot(motion) > end)) return;
    if (!mine.in_front(v, n, tuning_->leaning) || !other.behind(at, n, tuning_->leaning)) return;
    best = n, end = gap + n.dot(motion);
  };
  const auto try_faces_at = [&](Feature::Kind kind, Index index) {
    FeatureSide at = minimum.at;
    at.key = feature_key(kind, index);
    other.for_faces_at(at.key, [&](Index t) { try_normal(at, other.face(t).normal); });
    for (const Index t : mine.surface().vertex_triangles(v)) try_normal(at, -mine.face(t).normal);
  };
  // The edges and corners of the face that are met or all but met.
  const Index t = minimum.at.triangle;
  const PairSurface::Face& f = other.face(t);
  for (int i = 0; i < 3; ++i) {
    const auto c = static_cast<std::size_t>(i);
    const Vec3 from_corner = minimum.at.point - f.x[c];
    if (from_corner.dot(f.inward[c]) <= passed) try_faces_at(Feature::Kind::kEdge, other.surface().edge_of(t, i));
    if (from_corner.norm() <= passed) try_faces_at(Feature::Kind::kVertex, other.surface().triangle(t)[c]);
  }
  if (end >= -passed && best != minimum.direction) return Vec3::Zero();
  return best;
}

Vec3 SurfaceContacts::unhindered(const EdgePair& pair) {
  const Vec3 motion = side_[0]->expected_motion(pair.on_e) - side_[1]->expected_motion(pair.on_f);
  const Vec3 apart = pair.on_e - pair.on_f;
  Vec3 best = pair.direction;
  double end = best.dot(apart + motion);
  if (self_ || !(end < 0.0)) return best;
  const double passed = std::max(passed_, tuning_->passed * shorter_edge(pair));
  const double room_s = std::min(pair.s, 1.0 - pair.s), room_t = std::min(pair.t, 1.0 - pair.t);
  if (room_s * side_[0]->edge_vector(pair.e).norm() <= passed ||
      room_t * side_[1]->edge_vector(pair.f).norm() <= passed)
    return Vec3::Zero();  // the vertex there tells of it
  const auto try_normal = [&](const Vec3& n) {
    if (!(n.dot(apart) >= -passed) || !(n.dot(apart + motion) > end)) return;
    if (!side_[1]->in_normal_cone(pair.f, n) || !side_[0]->in_normal_cone(pair.e, -n)) return;
    best = n, end = n.dot(apart + motion);
  };
  side_[0]->for_faces_at(feature_key(Feature::Kind::kEdge, pair.e),
                         [&](Index t) { try_normal(-side_[0]->face(t).normal); });
  side_[1]->for_faces_at(feature_key(Feature::Kind::kEdge, pair.f),
                         [&](Index t) { try_normal(side_[1]->face(t).normal); });
  if (end >= -passed && best != pair.direction) return Vec3::Zero();
  return best;
}

void SurfaceContacts::add(int of, const FeatureSide& mine, const FeatureSide& other, const Vec3& out_of_other,
                          double gap) {
  const bool first = self_ ? mine.key < other.key : of == 0;
  if (first)
    contacts_->push_back({mine, other, out_of_other, gap});
  else
    contacts_->push_back({other, mine, -out_of_other, gap});
}

}  // namespace limber::internal
