#include "fcl_touches.h"

#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/detail/primitive_shape_algorithm/triangle_distance.h>
#include <fcl/narrowphase/detail/traversal/collision/bvh_collision_traversal_node.h>
#include <fcl/narrowphase/detail/traversal/traversal_recurse.h>
#include <fcl/narrowphase/distance.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>

#include "finder/world_bounds.h"

namespace limber::internal {
namespace {

/// Sine of 15°: a vertex pushes along a normal that its own neighbours lie behind, or all but. Faces that rest on each
/// other keep the vertices they have there while they bend and rock; sides of a solid, at 45° and more, are told.
constexpr double kLeaning = 0.26;
/// Sine up to which an edge is none: its two faces are one. And part of its length by which it may miss another one.
constexpr double kFlat = 1e-6;
/// Sine below which two edges have no common perpendicular.
constexpr double kParallel = 1e-9;
/// Depth in parts of a vertex's shortest edge up to which solids lie on each other, face to face.
constexpr double kFaceOnFace = 0.01;
/// How much deeper than the nearest way out a pair of crossed edges may be: within 60° of a face.
constexpr double kDetour = 2.0;
/// Part of the sizes of two convex shapes that FCL's and libccd's distances and depths may be off by.
constexpr double kConvexTolerance = 1e-6;
/// Round-offs up to which a point lies on a surface, and the way to it has no direction.
constexpr double kTouching = 1e3;

/// FCL's walk down two trees in one frame, to the triangles whose boxes come within a distance.
class NearTriangles final : public fcl::detail::BVHCollisionTraversalNode<FclBox> {
 public:
  NearTriangles(const FclTree& a, const FclTree& b, double reach, std::vector<std::pair<Index, Index>>& pairs)
      : reach_(reach), pairs_(pairs) {
    model1 = &a, model2 = &b;
  }
  // True where the pair of nodes can be left out.
  bool BVTesting(int a, int b) const override { return model1->getBV(a).bv.distance(model2->getBV(b).bv) > reach_; }
  void leafTesting(int a, int b) const override {
    pairs_.emplace_back(model1->getBV(a).primitiveId(), model2->getBV(b).primitiveId());
  }
  bool canStop() const override { return false; }

 private:
  double reach_;
  std::vector<std::pair<Index, Index>>& pairs_;
};

/// Whether the surface about a vertex lies in front of it along n, leaning back by no more than kLeaning.
bool in_front(const FclBody& body, Index v, const Vec3& n) {
  if (body.surface() == nullptr) return true;
  for (const Index w : body.surface()->vertex_neighbours(v)) {
    const Vec3 d = body.point(w) - body.point(v);
    if (n.dot(d) < -kLeaning * d.norm()) return false;
  }
  return true;
}

double shortest_edge(const FclBody& body, Index v) {
  if (body.surface() == nullptr) return 0.0;
  double least = std::numeric_limits<double>::infinity();
  for (const Index w : body.surface()->vertex_neighbours(v))
    least = std::min(least, (body.point(w) - body.point(v)).norm());
  return least;
}

/// Whether no neighbour of a vertex is nearer to a core.
bool is_nearest(const FclBody& body, Index v, const FclBody& core) {
  if (body.surface() == nullptr) return true;
  const double distance = core.nearest(body.point(v)).distance;
  return std::ranges::none_of(body.surface()->vertex_neighbours(v),
                              [&](Index w) { return core.nearest(body.point(w)).distance < distance; });
}

/// The third corner of a triangle at an edge.
Index apex(const CollisionSurface& surface, Index t, Index e) {
  const auto& ends = surface.edge(e).vertices;
  for (const Index v : surface.triangle(t))
    if (v != ends[0] && v != ends[1]) return v;
  return ends[0];
}

std::array<Vec3, 2> ends_of(const FclBody& body, Index e) {
  if (body.surface() == nullptr) return {body.point(0), body.point(1)};
  const auto& ends = body.surface()->edge(e).vertices;
  return {body.point(ends[0]), body.point(ends[1])};
}

/// The same of an edge, at its point x, by no more than a sine.
bool in_front_at_edge(const FclBody& body, Index e, const Vec3& x, const Vec3& n, double leaning) {
  const auto in_front = [&](const Vec3& p) { return n.dot(p - x) >= -leaning * (p - x).norm(); };
  if (!std::ranges::all_of(ends_of(body, e), in_front)) return false;
  if (body.surface() == nullptr) return true;
  return std::ranges::all_of(body.surface()->edge_triangles(e),
                             [&](Index t) { return in_front(body.point(apex(*body.surface(), t, e))); });
}

/// How far an edge's surface may lean back in a contact: in parts of how sharp the edge is, 12° at a right angle, so
/// that what rests on each other keeps the crossings of its outlines while it rocks.
double leaning_of(const FclBody& body, Index e) {
  constexpr double kPerSharpness = 0.15;
  if (body.surface() == nullptr) return kFlat;
  const auto at = body.surface()->edge_triangles(e);
  if (at.size() != 2) return kFlat;
  return std::max(kFlat, kPerSharpness * (body.face_normal(at[0]) - body.face_normal(at[1])).norm());
}

bool is_crease(const FclBody& body, Index e) {
  if (body.surface() == nullptr) return true;
  const auto at = body.surface()->edge_triangles(e);
  if (at.size() != 2) return !at.empty();
  return (body.face_normal(at[0]) - body.face_normal(at[1])).norm() > kFlat;
}

FeatureSide on_edge(const FclBody& body, Index e, const Vec3& x) {
  FeatureSide side{feature_key(Feature::Kind::kEdge, e), -1, {}, x};
  if (body.surface() == nullptr) return side;
  const auto ends = ends_of(body, e);
  const Vec3 along = ends[1] - ends[0];
  const double t = along.dot(x - ends[0]) / along.squaredNorm();
  side.triangle = body.surface()->edge_triangles(e).front();
  const Triangle& corners = body.surface()->triangle(side.triangle);
  for (std::size_t k = 0; k < 3; ++k) {
    if (corners[k] == body.surface()->edge(e).vertices[0]) side.weight[k] = 1.0 - t;
    if (corners[k] == body.surface()->edge(e).vertices[1]) side.weight[k] = t;
  }
  return side;
}

FeatureSide on_vertex(const FclBody& body, Index v) {
  FeatureSide side{feature_key(Feature::Kind::kVertex, v), -1, {}, body.point(v)};
  if (body.surface() == nullptr) return side;
  side.triangle = body.surface()->vertex_triangles(v).front();
  const Triangle& corners = body.surface()->triangle(side.triangle);
  for (std::size_t k = 0; k < 3; ++k) side.weight[k] = corners[k] == v ? 1.0 : 0.0;
  return side;
}

/// Whether a point of an edge that has crossed another one lies in the other's body, which it leaves there about as
/// soon as anywhere: not on the far side. Where solids all but touch the point may lie on the side below the rim.
bool leads_out(const FclBody& body, Index rim, const Vec3& x, double depth) {
  if (body.surface() == nullptr) return true;
  if (!body.sided()) return false;
  const FclFoot nearest = body.nearest(x);
  const auto ends = ends_of(body, rim);
  if (depth <= kFaceOnFace * (ends[1] - ends[0]).norm() && nearest.distance <= kLeaning * depth) return true;
  return body.is_behind(x, nearest) && depth <= kDetour * nearest.distance;
}

bool holds(const FclBody& body, const Vec3& x) {
  return body.surface() == nullptr || (body.sided() && body.is_behind(x, body.nearest(x)));
}

/// What two features of a pair are called; kinds: vertex of a, vertex of b, edges, whole shapes.
std::uint64_t feature_id(std::uint64_t kind, Index i, std::uint64_t j) {
  return kind << 62 | static_cast<std::uint64_t>(i) << 31 | j;
}

/// Of two convex shapes: by FCL's GJK, or where they overlap by libccd's Minkowski portals. Not by FCL's signed
/// distance, which stops the whole program where its expanding polytope degenerates (assertions of libfcl 0.7, which
/// Debian leaves in).
std::optional<FclTouches::Direction> convex_direction(const FclBody& a, const FclBody& b) {
  const auto transform = [](const RigidTransform& X) {
    fcl::Transform3<double> T = fcl::Transform3<double>::Identity();
    T.linear() = to_matrix(X.q);
    T.translation() = X.p;
    return T;
  };
  const fcl::Transform3<double> X_WA = transform(a.pose()), X_WB = transform(b.pose());
  FclTouches::Direction d;
  try {
    fcl::DistanceRequest<double> ask(true);
    ask.distance_tolerance = 1e-9 * (a.diagonal() + b.diagonal());
    fcl::DistanceResult<double> nearest;
    d.gap = fcl::distance(a.convex(), X_WA, b.convex(), X_WB, ask, nearest);
    if (d.gap > 0.0) {
      d.normal = (nearest.nearest_points[0] - nearest.nearest_points[1]).normalized();
      d.foot.at.point = nearest.nearest_points[1];
    } else {
      const fcl::CollisionRequest<double> ask_depth(1, true);
      fcl::CollisionResult<double> depth;
      if (fcl::collide(a.convex(), X_WA, b.convex(), X_WB, ask_depth, depth) == 0) return {};
      const auto& c = depth.getContact(0);
      d.gap = -c.penetration_depth;
      d.normal = -c.normal;
      d.foot.at.point = c.pos + 0.5 * c.penetration_depth * d.normal;
    }
  } catch (const std::exception&) {
    return {};  // FCL throws on simplices without volume
  }
  if (!std::isfinite(d.gap) || !d.normal.allFinite() || !d.foot.at.point.allFinite()) return {};
  return d;
}

}  // namespace

void FclTouches::find(const FclBody& a, const FclBody& b, double reach, const Vec3& origin,
                      std::vector<ContactPoint>& contacts) {
  a_ = &a, b_ = &b, reach_ = reach;
  touches_.clear(), crossings_.clear();
  if (b.half_space() != nullptr) {
    touch_plane(a, world_half_space(*b.half_space(), b.pose()), true);
  } else if (a.half_space() != nullptr) {
    touch_plane(b, world_half_space(*a.half_space(), a.pose()), false);
  } else {
    std::optional<Direction> convex;
    if (a.convex() != nullptr && b.convex() != nullptr) {
      convex = convex_direction(a, b);
      if (convex && convex->gap > reach + kConvexTolerance * (a.diagonal() + b.diagonal())) return;
    }
    touch_by_vertices(a, b, true);
    touch_by_vertices(b, a, false);
    touch_by_edges(a, b);
    keep_a_crossing();
    if (convex) add_deepest(a, b, *convex);
  }
  for (const Touch& t : touches_) {
    ContactPoint c;
    const auto side = [&](const FeatureSide& from, const FclBody& body, const Vec3& point) {
      ContactSide s{.body = body.index(), .radius = body.radius()};
      if (body.modal() != nullptr) s.triangle = from.triangle, s.weight = from.weight;
      s.point_B = body.pose().inverse() * point;
      return s;
    };
    const Vec3 on_a = t.a.point - a.radius() * t.normal, on_b = t.b.point + b.radius() * t.normal;
    c.a = side(t.a, a, on_a), c.b = side(t.b, b, on_b);
    c.normal = t.normal;
    c.gap = t.gap - a.radius() - b.radius();
    c.position = 0.5 * (on_a + on_b) - origin;
    c.id = t.id;
    if (c.gap <= reach) contacts.push_back(c);
  }
}

void FclTouches::add(const FclBody& of, Index v, const Direction& d, std::uint64_t rank, bool first) {
  const FeatureSide mine = on_vertex(of, v);
  touches_.push_back({first ? mine : d.foot.at, first ? d.foot.at : mine, first ? d.normal : Vec3(-d.normal), d.gap,
                      feature_id(first ? 0 : 1, v, rank)});
}

void FclTouches::touch_plane(const FclBody& of, const HalfSpace& plane, bool first) {
  for (Index v = 0; v < of.points(); ++v) {
    if (!of.is_corner(v)) continue;
    Direction d;
    d.gap = plane.normal.dot(of.point(v)) - plane.offset;
    if (!(d.gap - of.radius() <= reach_)) continue;
    d.normal = plane.normal;
    d.foot.at.point = of.point(v) - d.gap * plane.normal;
    add(of, v, d, 0, first);
  }
}

void FclTouches::touch_by_vertices(const FclBody& of, const FclBody& other, bool first) {
  const double reach = reach_ + of.radius() + other.radius();
  const Aabb about = other.box().grown(reach);
  // An open sheet is pushed back out of only where something crosses it; a height field is solid below.
  bool crosses = other.solid();
  for (Index v = 0; !crosses && other.sided() && v < of.points(); ++v)
    crosses =
        of.is_corner(v) && about.contains(of.point(v)) && !other.is_behind(of.point(v), other.nearest(of.point(v)));
  for (Index v = 0; v < of.points(); ++v) {
    const Vec3& p = of.point(v);
    if (!of.is_corner(v) || !about.contains(p)) continue;
    if (other.sided()) {
      const FclFoot nearest = other.nearest(p);
      if (other.is_behind(p, nearest)) {
        if (crosses || (of.points() < 3 && nearest.distance <= of.radius())) touch_inside(of, v, other, nearest, first);
        continue;
      }
      if (nearest.distance > reach) continue;
      if (nearest.distance <= kTouching * other.round_off(p)) {
        touch_inside(of, v, other, nearest, first);
        continue;
      }
    }
    other.near(p, reach, feet_);
    touch_outside(of, v, other, first);
  }
}

/// No triangle that the foot lies on comes nearer.
bool FclTouches::is_minimum(const FclBody& other, const FclFoot& foot) const {
  if (other.surface() == nullptr) return true;
  const double least = foot.distance - other.round_off(foot.at.point);
  const auto nearer = [&](Index t) {
    const auto found = std::lower_bound(feet_.begin(), feet_.end(), t,
                                        [](const FclFoot& f, Index triangle) { return f.at.triangle < triangle; });
    return found != feet_.end() && found->at.triangle == t && found->distance < least;
  };
  const Index i = index_of(foot.at.key);
  if (kind_of(foot.at.key) == Feature::Kind::kFace) return true;
  if (kind_of(foot.at.key) == Feature::Kind::kEdge)
    return std::ranges::none_of(other.surface()->edge_triangles(i), nearer);
  return std::ranges::none_of(other.surface()->vertex_triangles(i), nearer);
}

void FclTouches::touch_outside(const FclBody& of, Index v, const FclBody& other, bool first) {
  const Vec3& p = of.point(v);
  directions_.clear();
  for (const FclFoot& foot : feet_) {
    const bool vertex = kind_of(foot.at.key) == Feature::Kind::kVertex;
    // Two vertices that are nearest to each other are told once: by the core, else by a.
    const bool tells = (of.surface() == nullptr) == (other.surface() == nullptr) ? first : of.surface() == nullptr;
    if ((vertex && !tells) || !is_minimum(other, foot)) continue;
    if (std::ranges::any_of(directions_, [&](const Direction& d) { return d.foot.at.key == foot.at.key; })) continue;
    const Vec3 straight = p - foot.at.point;
    const Vec3 outward = other.normal_at(foot.at.key);
    Direction d{foot, unit_or(straight, outward), foot.distance};
    if (kind_of(foot.at.key) == Feature::Kind::kFace && !outward.isZero())
      d.normal = outward.dot(straight) < 0.0 ? Vec3(-outward) : outward;
    if (d.normal.isZero()) d.normal = Vec3::UnitZ();
    d.gap = d.normal.dot(straight);
    if (other.surface() == nullptr ? is_nearest(of, v, other) : in_front(of, v, d.normal)) directions_.push_back(d);
  }
  std::ranges::stable_sort(directions_, {}, [](const Direction& d) { return d.gap; });
  for (std::size_t i = 0; i < directions_.size(); ++i) add(of, v, directions_[i], i, first);
}

/// By the nearest point; where solids all but touch by that which the vertex's own surface is in front of, or the
/// nearest face as near that it is in front of: what lies on a solid near its rim is not pushed out sideways.
void FclTouches::touch_inside(const FclBody& of, Index v, const FclBody& other, const FclFoot& nearest, bool first) {
  const Vec3& p = of.point(v);
  const Vec3 outward = other.normal_at(nearest.at.key);
  const bool on_face = kind_of(nearest.at.key) == Feature::Kind::kFace;
  Direction best{nearest, on_face ? outward : unit_or(nearest.at.point - p, outward), 0.0};
  const double touching = kTouching * other.round_off(p);
  const double nearby = kFaceOnFace * shortest_edge(of, v) + touching;
  const auto found = [&](const FclFoot& foot) {
    const Vec3 n = other.face_normal(foot.at.triangle);
    const double depth = n.dot(foot.at.point - p);
    if (depth < -touching || depth > nearby || n.isZero() || !in_front(of, v, n)) return false;
    best = {foot, n, 0.0};
    best.foot.at.point = p + depth * n;
    return true;
  };
  if (nearest.distance <= nearby && !in_front(of, v, best.normal)) {
    other.near(p, nearby, feet_);
    std::ranges::stable_sort(feet_, {}, &FclFoot::distance);
    static_cast<void>(std::ranges::any_of(feet_, found));
  }
  best.gap = best.normal.dot(p - best.foot.at.point);
  add(of, v, best, 0, first);
}

void FclTouches::touch_by_edges(const FclBody& a, const FclBody& b) {
  if (a.points() < 2 || b.points() < 2) return;
  const double reach = reach_ + a.radius() + b.radius();
  triangle_pairs_.clear();
  if (a.tree() != nullptr && b.tree() != nullptr) {
    NearTriangles walk(*a.tree(), *b.tree(), reach, triangle_pairs_);
    fcl::detail::collisionRecurse(&walk, 0, 0, nullptr);
  } else if (const FclBody& with = a.tree() != nullptr ? a : b; with.tree() != nullptr) {
    with.triangles_near((&with == &a ? b : a).box().grown(reach), triangles_);
    for (const Index t : triangles_) triangle_pairs_.emplace_back(&with == &a ? t : 0, &with == &a ? 0 : t);
  } else {
    triangle_pairs_.emplace_back(0, 0);
  }
  edge_pairs_.clear();
  const auto edges_of = [](const FclBody& body, Index t) {
    std::array<Index, 3> edges{0, -1, -1};
    if (body.surface() != nullptr)
      for (int c = 0; c < 3; ++c) edges[static_cast<std::size_t>(c)] = body.surface()->edge_of(t, c);
    return edges;
  };
  const auto owned = [](const FclBody& body, Index t, Index e) {
    if (e < 0) return false;
    if (body.surface() == nullptr) return true;
    const auto at = body.surface()->edge_triangles(e);
    return !at.empty() && at.front() == t;
  };
  for (const auto& [t, u] : triangle_pairs_)
    for (const Index e : edges_of(a, t))
      for (const Index f : edges_of(b, u))
        if (owned(a, t, e) && owned(b, u, f)) edge_pairs_.emplace_back(e, f);
  std::ranges::sort(edge_pairs_);
  for (const auto& [e, f] : edge_pairs_)
    if (is_crease(a, e) && is_crease(b, f)) touch_by_edges(a, e, b, f);
}

void FclTouches::touch_by_edges(const FclBody& a, Index e, const FclBody& b, Index f) {
  const auto p = ends_of(a, e), q = ends_of(b, f);
  const Vec3 u = p[1] - p[0], w = q[1] - q[0], across = u.cross(w);
  if (across.norm() <= kParallel * u.norm() * w.norm()) return;
  Vec3 between, x, y;
  fcl::detail::TriangleDistance<double>::segPoints(p[0], u, q[0], w, between, x, y);
  // The ends belong to the edges: a vertex that lies beside a rim by a hair is in front of no face there.
  const Vec3 straight = x - y, along = across.normalized();
  if ((straight - along.dot(straight) * along).norm() > kFlat * std::max(u.norm(), w.norm())) return;
  for (const double sign : {1.0, -1.0}) {
    const Vec3 n = sign * along;
    const double gap = n.dot(straight);
    if (gap - a.radius() - b.radius() > reach_) continue;
    if (a.surface() == nullptr && b.surface() == nullptr && gap < 0.0) continue;
    if (!in_front_at_edge(a, e, x, n, leaning_of(a, e)) || !in_front_at_edge(b, f, y, -n, leaning_of(b, f))) continue;
    const bool out = gap >= 0.0 || (leads_out(b, f, x, -gap) && leads_out(a, e, y, -gap));
    if (!out && !(holds(b, x) && holds(a, y))) continue;
    (out ? touches_ : crossings_)
        .push_back({on_edge(a, e, x), on_edge(b, f, y), n, gap, feature_id(2, e, static_cast<std::uint64_t>(f))});
    return;
  }
}

/// Bodies that overlap by crossed edges alone, none of which leads out soon, are pushed apart by the shallowest.
void FclTouches::keep_a_crossing() {
  const auto inside = [](const Touch& t) { return t.gap < 0.0; };
  if (crossings_.empty() || std::ranges::any_of(touches_, inside)) return;
  touches_.push_back(*std::ranges::max_element(crossings_, {}, &Touch::gap));
}

/// Where the features of two convex shapes show less than their distance or depth.
void FclTouches::add_deepest(const FclBody& a, const FclBody& b, const Direction& d) {
  const double size = a.diagonal() + b.diagonal(), radii = a.radius() + b.radius();
  double least = std::numeric_limits<double>::infinity();
  for (const Touch& t : touches_) least = std::min(least, t.gap - radii);
  if (!touches_.empty() && least <= d.gap + kConvexTolerance * size) return;
  Touch t{.normal = d.normal, .gap = d.gap + radii, .id = feature_id(3, 0, 0)};
  t.b.point = d.foot.at.point - b.radius() * d.normal;
  t.a.point = d.foot.at.point + (d.gap + a.radius()) * d.normal;
  touches_.push_back(t);
}

}  // namespace limber::internal
