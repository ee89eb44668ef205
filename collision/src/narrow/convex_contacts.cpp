#include "narrow/convex_contacts.h"
#include "tuning.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace limber::internal {
namespace {

// The two nearest points stand for no feature of theirs alone: bits of kind that no feature has.
constexpr FeatureKey kNearestPoints = 3u << 30;

ConvexSolid solid(std::span<const Vec3> points) { return {points, 0.0}; }

// How far a face of one of two boxes keeps them apart. @param h, k half extents of a, b
double between_boxes(const Vec3& h, const Vec3& k, const RigidTransform& X_AB) {
  const Mat3 R = to_matrix(X_AB.q), size = R.cwiseAbs();
  return std::max((X_AB.p.cwiseAbs() - h - size * k).maxCoeff(),
                  ((R.transpose() * X_AB.p).cwiseAbs() - k - size.transpose() * h).maxCoeff());
}

}  // namespace

ConvexContacts::Range ConvexContacts::along(const Side& side, const Vec3& axis) {
  if (side.is_box()) {
    const double middle = axis.dot(side.pose.p), half = side.half_width(axis);
    return {middle - half, middle + half};
  }
  Range r{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  for (const Vec3& p : side.points) {
    const double x = axis.dot(p);
    r.low = std::min(r.low, x), r.high = std::max(r.high, x);
  }
  return r;
}

// @param pose null: at the origin, bit for bit
void ConvexContacts::load(Side& side, const ConvexCore& core, const RigidTransform* pose) {
  side.core = &core, side.pose = pose != nullptr ? *pose : RigidTransform{}, side.turned = pose != nullptr;
  side.points = core.points, side.edge_directions = core.edge_directions;
  for (int i = 0; i < 3; ++i) side.half_axes[static_cast<std::size_t>(i)] = core.half_extents[i] * Vec3::Unit(i);
  if (pose == nullptr) return;
  const Mat3 R = to_matrix(pose->q);
  for (Vec3& axis : side.half_axes) axis = R * axis;
  side.turned_points.resize(core.points.size());
  side.turned_normals.resize(core.faces.size());
  side.turned_edges.resize(core.edge_directions.size());
  for (std::size_t i = 0; i < core.points.size(); ++i) side.turned_points[i] = R * core.points[i] + pose->p;
  for (std::size_t i = 0; i < core.faces.size(); ++i) side.turned_normals[i] = R * core.faces[i].normal;
  for (std::size_t i = 0; i < core.edge_directions.size(); ++i) side.turned_edges[i] = R * core.edge_directions[i];
  side.points = side.turned_points, side.edge_directions = side.turned_edges;
}

void ConvexContacts::load(const ConvexCore& a, const ConvexCore& b, const RigidTransform& X_AB,
                          std::vector<FeatureContact>& contacts) {
  load(side_[0], a, nullptr), load(side_[1], b, &X_AB);
  depths_.clear();
  contacts_ = &contacts, first_ = contacts.size();
  ground_ = -1;
}

void ConvexContacts::find(const ConvexCore& a, const ConvexCore& b, const RigidTransform& X_AB, double margin,
                          std::vector<FeatureContact>& contacts, const Passing& passing) {
  apart_ = 0.0;
  if (a.half_extents[0] > 0.0 && b.half_extents[0] > 0.0) {
    const double gap = between_boxes(a.half_extents, b.half_extents, X_AB) - a.radius - b.radius;
    if (gap > margin) return void(apart_ = gap);
  }
  load(a, b, X_AB, contacts);
  ground_ = passing.ground;
  const std::size_t face_tests = a.faces.size() * b.points.size() + b.faces.size() * a.points.size();
  const bool told = !a.faces.empty() && !b.faces.empty() && face_tests <= collision_tuning().convex.most_face_tests &&
                    faces_tell(margin);
  if (!told) find_by_distance(margin);
  if (!passing.way.isZero(0.0)) let_pass(passing, margin);
}

// Where a face keeps the two apart all along the way, contacts that close on it are none, but those with that face.
void ConvexContacts::let_pass(const Passing& passing, double margin) {
  const auto closes = [&](const FeatureContact& c) { return c.gap >= -passing.touching && passing.closes(c.normal); };
  const auto first = contacts_->begin() + static_cast<std::ptrdiff_t>(first_);
  if (std::none_of(first, contacts_->end(), closes)) return;
  const Direction kept = keeping_apart(passing);
  const auto stands_in_the_way = [&](const FeatureContact& c) {
    return closes(c) && c.normal.dot(kept.normal) < collision_tuning().convex.face_alignment;
  };
  if (!std::isfinite(kept.depth) || std::none_of(first, contacts_->end(), stands_in_the_way)) return;
  contacts_->resize(first_);
  if (side_[0].points.size() > 1 && side_[1].points.size() > 1) clip_faces(kept.normal, margin);
}

void ConvexContacts::find_along(const ConvexCore& a, const ConvexCore& b, const RigidTransform& X_AB,
                                const Vec3& normal, double margin, int ground, std::vector<FeatureContact>& contacts) {
  load(a, b, X_AB, contacts);
  ground_ = ground;
  if (a.points.size() > 1 && b.points.size() > 1) clip_faces(normal, margin);
}

void ConvexContacts::find_on_triangle(const ConvexCore& a, const ConvexCore& triangle, const TriangleQuery& query,
                                      DirectionFilter& leaves, std::vector<FeatureContact>& contacts) {
  load(side_[0], a, nullptr), load(side_[1], triangle, nullptr);
  depths_.clear();
  contacts_ = &contacts, first_ = contacts.size(), ground_ = 1;
  const ConvexFace& face = triangle.faces.front();
  const double gap = lowest(side_[0], face.normal) - face.offset - a.radius, touching = query.passing.touching;
  const Range whole = along(side_[0], face.normal);
  if (gap > query.margin || 0.5 * (whole.low + whole.high) < face.offset) return;  // in front, or behind
  if (gap >= -touching || query.face_alone) {
    clip_faces(face.normal, query.margin);
    if (!query.rim || least_gap() <= gap + round_off()) return;
  } else {
    Direction best{face.normal, -gap - a.radius};
    if (leave_triangle(best, leaves)) {
      const auto end = query.beyond.begin() + static_cast<std::ptrdiff_t>(query.beyond_count);
      if (std::any_of(query.beyond.begin(), end, [&](const TriangleQuery::Plane& plane) {
            return plane.offset - lowest(side_[0], plane.normal) < best.depth;
          }))
        return;
      best.normal == face.normal ? clip_faces(best.normal, query.margin) : touch(best, nullptr, query.margin);
      return;
    }
  }
  const ConvexDistance nearest = distance(solid(side_[0].points), solid(side_[1].points));
  if (nearest.cores_intersect || nearest.distance - a.radius > query.margin || !leaves.allows(nearest.normal)) return;
  const bool kept_apart = std::min(gap, gap + face.normal.dot(query.passing.way)) >= -touching;
  if (kept_apart && query.passing.closes(nearest.normal)) return;
  first_ = contacts.size();
  const Deepest points{nearest.a, nearest.b};
  touch({nearest.normal, -nearest.distance}, &points, query.margin);
}

// The direction of least depth of those that are allowed.
// @return false: the triangle does not reach into the other at all
bool ConvexContacts::leave_triangle(Direction& best, DirectionFilter& leaves) {
  bool apart = false;
  const auto look = [&](double preference) {
    return [&, preference](const Vec3& normal, double depth) {
      apart = apart || depth + side_[0].core->radius < 0.0;
      if (!apart && depth < preference * best.depth && leaves.allows(normal)) best = {normal, depth};
    };
  };
  for_faces(look(1.0));
  if (!apart) for_edges(look(collision_tuning().convex.edge_preference));
  return !apart;
}

// Of the faces behind which the other body is, and stays all along the way, the one that keeps it farthest; of infinite
// depth if there is none.
ConvexContacts::Direction ConvexContacts::keeping_apart(const Passing& passing) {
  Direction best;
  const double most = passing.touching - side_[0].core->radius - side_[1].core->radius;
  for_faces([&](const Vec3& normal, double depth) {
    const double deepest = std::max(depth, depth - normal.dot(passing.way));
    if (deepest <= most && deepest < best.depth) best = {normal, deepest};
  });
  return best;
}

// Two polytopes that touch with a face, or whose faces keep them apart: what the planes of their faces tell. Where the
// least deep of them has a point of the other body over the face itself, no direction is better.
// @return false: edges or corners decide; nothing has been added
bool ConvexContacts::faces_tell(double margin) {
  const Direction face = across_faces();
  const double radii = side_[0].core->radius + side_[1].core->radius;
  if (-face.depth - radii > margin) {
    apart_ = -face.depth - radii;
    return true;
  }
  if (face.depth > 0.0) {
    const Direction least = least_penetration(face);
    if (least.depth < 0.0) return false;
    touch(least, nullptr, margin);
    return true;
  }
  clip_faces(face.normal, margin);
  if (contacts_->size() > first_ && least_gap() <= -face.depth - radii + round_off()) return true;
  contacts_->resize(first_);
  return false;
}

void ConvexContacts::find_by_distance(double margin) {
  const double most = margin + side_[0].core->radius + side_[1].core->radius;
  const ConvexDistance nearest = distance(solid(side_[0].points), solid(side_[1].points), most);
  if (!(nearest.distance <= most))
    return void(apart_ = nearest.distance - side_[0].core->radius - side_[1].core->radius);
  // Cores that are apart by little more than round-off may have any normal by their nearest points.
  if (nearest.cores_intersect || !(depth_along(nearest.normal) < 0.0)) {
    touch(least_penetration(across_faces()), nullptr, margin);
    return;
  }
  const Deepest points{nearest.a, nearest.b};
  touch({nearest.normal, -nearest.distance}, &points, margin);
}

// Contacts of bodies that touch along a direction. @param known the deepest points; null: they are to be found
void ConvexContacts::touch(const Direction& d, const Deepest* known, double margin) {
  const ConvexCore &a = *side_[0].core, &b = *side_[1].core;
  if (a.faces.empty() && b.faces.empty())
    touch_along(d.normal, margin);
  else if (a.points.size() > 1 && b.points.size() > 1)
    clip_faces(d.normal, margin);
  if (least_gap() <= -d.depth - a.radius - b.radius + round_off()) return;
  const Deepest points = known != nullptr ? *known : deepest_along(d);
  add({kNearestPoints, -1, {}, points.a - a.radius * d.normal},
      {kNearestPoints, -1, {}, points.b + b.radius * d.normal}, d.normal);
}

void ConvexContacts::add(const FeatureSide& a, const FeatureSide& b, const Vec3& normal) {
  contacts_->push_back({a, b, normal, normal.dot(a.point - b.point)});
}

double ConvexContacts::least_gap() const {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = first_; i < contacts_->size(); ++i) least = std::min(least, (*contacts_)[i].gap);
  return least;
}

double ConvexContacts::round_off() const {
  return kRoundOff * (side_[0].core->radius + side_[1].core->radius + side_[0].points.front().norm() +
                      side_[1].points.front().norm());
}

// -- Direction of two cores that intersect ----------------------------------------------------------------------------

// Calls visit(normal, depth) for the faces of both. Depths are found when they are first asked for.
template <class Visit>
void ConvexContacts::for_faces(const Visit& visit) {
  if (depths_.empty())
    for (std::size_t s = 0; s < 2; ++s)
      for (const ConvexFace& f : side_[s].core->faces)
        depths_.push_back(side_[s].offset(f) - lowest(side_[1 - s], side_[s].normal(f)));
  auto depth = depths_.begin();
  for (const ConvexFace& f : side_[0].core->faces) visit(Vec3(-side_[0].normal(f)), *depth++);
  for (const ConvexFace& f : side_[1].core->faces) visit(side_[1].normal(f), *depth++);
}

// Of the faces of both, the one along which they overlap least.
ConvexContacts::Direction ConvexContacts::across_faces() {
  Direction best;
  for_faces([&](const Vec3& normal, double depth) { take_shallower(best, normal, depth, 1.0); });
  return best;
}

// Calls visit(normal, depth) both ways along what is across an edge of each.
template <class Visit>
void ConvexContacts::for_edges(const Visit& visit) const {
  const double least_cross = collision_tuning().convex.least_cross;
  for (const Vec3& u : side_[0].edge_directions)
    for (const Vec3& w : side_[1].edge_directions) {
      const Vec3 axis = u.cross(w);
      const double length = axis.norm();
      if (length < least_cross) continue;
      const Range a = along(side_[0], axis), b = along(side_[1], axis);
      visit(Vec3(axis / length), (b.high - a.low) / length);
      visit(Vec3(-axis / length), (a.high - b.low) / length);
    }
}

// The separating axis test over all faces and pairs of edges: the nearest face of the difference of the two polytopes.
ConvexContacts::Direction ConvexContacts::least_penetration(const Direction& across_faces) const {
  Direction best = across_faces;
  const double preference = collision_tuning().convex.edge_preference;
  for_edges([&](const Vec3& normal, double depth) { take_shallower(best, normal, depth, preference); });
  if (!std::isfinite(best.depth)) {
    const Vec3 across = across_edges();
    best = {across, depth_along(across)};
  }
  return best;
}

// How far the cores would have to move apart along the normal; below 0: how far apart they are along it.
double ConvexContacts::depth_along(const Vec3& normal) const {
  return -lowest(side_[1], -normal) - lowest(side_[0], normal);
}

void ConvexContacts::take_shallower(Direction& best, const Vec3& normal, double depth, double preference) {
  if (depth < (best.depth > 0.0 ? preference * best.depth : best.depth / preference)) best = {normal, depth};
}

// For balls and capsules about one point: any direction across the axes there are.
Vec3 ConvexContacts::across_edges() const {
  for (const Side& side : side_)
    if (!side.edge_directions.empty()) return side.edge_directions[0].unitOrthogonal();
  return Vec3::UnitZ();
}

// Moved apart along the normal, the deepest points are the nearest.
ConvexContacts::Deepest ConvexContacts::deepest_along(const Direction& d) const {
  const double size = (side_[0].points[0] - side_[1].points[0]).norm() + side_[0].core->radius + side_[1].core->radius;
  const Vec3 shift = (d.depth + size) * d.normal;
  std::vector<Vec3>& moved = moved_;
  moved.clear();
  for (const Vec3& p : side_[0].points) moved.push_back(p + shift);
  const ConvexDistance apart = distance(solid(moved), solid(side_[1].points));
  return {apart.a - shift, apart.b};
}

// -- Manifolds --------------------------------------------------------------------------------------------------------

// Two capsules side by side: where each one's ends are over the other.
void ConvexContacts::touch_along(const Vec3& normal, double margin) {
  const std::span<const Vec3> p = side_[0].points, q = side_[1].points;
  if (p.size() < 2 || q.size() < 2) return;
  const Vec3 u = p[1] - p[0], w = q[1] - q[0];
  if (u.cross(w).norm() > collision_tuning().convex.side_by_side * u.norm() * w.norm()) return;
  const double ra = side_[0].core->radius, rb = side_[1].core->radius;
  const auto touch = [&](const Vec3& on_a, FeatureKey key_a, const Vec3& on_b, FeatureKey key_b) {
    const Vec3 n = unit_or(on_a - on_b, normal);
    if ((on_a - on_b).norm() - ra - rb <= margin)
      add({key_a, -1, {}, on_a - ra * n}, {key_b, -1, {}, on_b + rb * n}, n);
  };
  const FeatureKey edge = feature_key(Feature::Kind::kEdge, 0);
  for (int i = 0; i < 2; ++i) {
    const auto end = static_cast<std::size_t>(i);
    const FeatureKey vertex = feature_key(Feature::Kind::kVertex, i);
    if (const SurfaceFoot f = closest_on_segment(p[end], {q[0], q[1]}); f.feature.kind == Feature::Kind::kEdge)
      touch(p[end], vertex, f.point, edge);
    if (const SurfaceFoot f = closest_on_segment(q[end], {p[0], p[1]}); f.feature.kind == Feature::Kind::kEdge)
      touch(f.point, edge, q[end], vertex);
  }
}

const ConvexFace* ConvexContacts::facing(const Side& side, const Vec3& out) {
  const auto& faces = side.core->faces;
  if (faces.empty()) return nullptr;
  return &*std::max_element(faces.begin(), faces.end(), [&](const ConvexFace& f, const ConvexFace& g) {
    return side.normal(f).dot(out) < side.normal(g).dot(out);
  });
}

// Of faces that fit alike: that of what stands still, or of the larger body. What lies on it is not pushed along by its
// own tilt.
int ConvexContacts::reference_of_like_faces() const {
  if (ground_ >= 0) return ground_;
  return side_[0].core->extent > side_[1].core->extent ? 0 : 1;
}

// The face that the normal fits better is the reference; the other's face, or its segment, is clipped to what lies over
// it (Ericson 2005, 5.5).
void ConvexContacts::clip_faces(const Vec3& normal, double margin) {
  const ConvexFace *on_a = facing(side_[0], -normal), *on_b = facing(side_[1], normal);
  const double fit_a = on_a == nullptr ? -1.0 : -side_[0].normal(*on_a).dot(normal);
  const double fit_b = on_b == nullptr ? -1.0 : side_[1].normal(*on_b).dot(normal);
  const ConvexTuning& tuning = collision_tuning().convex;
  const double alike = tuning.reference_preference;
  const int reference = fit_a > fit_b + (reference_of_like_faces() == 0 ? -alike : alike) ? 0 : 1;
  if (std::max(fit_a, fit_b) < tuning.face_alignment) return;
  const Side &side = side_[reference], &other = side_[1 - reference];
  const ConvexFace* best = reference == 0 ? on_a : on_b;
  if (best == nullptr) return;
  const ConvexFace& face = *best;
  const Vec3 out = side.normal(face);
  load_incident(other, -out);
  for (Index edge = 0; edge < face.count; ++edge) clip_by_edge(side, face, edge);
  for (const Corner& c : corners_) {
    const Vec3 point = c.point - other.core->radius * out;
    const double height = out.dot(point) - side.offset(face);
    if (!(height <= margin)) continue;
    const FeatureSide incident{c.incident, -1, {}, point}, below{c.reference, -1, {}, point - height * out};
    reference == 1 ? add(incident, below, out) : add(below, incident, -out);
  }
}

// The face of a polytope that looks along `out`, or a segment there and back.
void ConvexContacts::load_incident(const Side& side, const Vec3& out) {
  corners_.clear();
  const FeatureKey on_face = feature_key(Feature::Kind::kFace, 0);
  const auto corner = [&](Index v, Index line) {
    corners_.push_back(
        {side.points[static_cast<std::size_t>(v)], feature_key(Feature::Kind::kVertex, v), on_face, line});
  };
  if (const ConvexFace* face = facing(side, out)) {
    for (Index i = 0; i < face->count; ++i)
      corner(side.core->loop(*face)[static_cast<std::size_t>(i)], face->first + i);
  } else {
    corner(0, 0), corner(1, 0);
  }
}

// Sutherland and Hodgman, against the plane through one edge of the reference face.
void ConvexContacts::clip_by_edge(const Side& reference, const ConvexFace& face, Index edge) {
  const auto loop = reference.core->loop(face);
  const Vec3& x0 = reference.points[static_cast<std::size_t>(loop[static_cast<std::size_t>(edge)])];
  const Vec3& x1 = reference.points[static_cast<std::size_t>(loop[static_cast<std::size_t>((edge + 1) % face.count)])];
  const Vec3 outward = (x1 - x0).cross(reference.normal(face)).normalized();
  const double tolerance = kRoundOff * (x0.norm() + x1.norm());
  heights_.clear();
  for (const Corner& c : corners_) heights_.push_back(outward.dot(c.point - x0));
  if (std::ranges::all_of(heights_, [&](double h) { return h <= tolerance; })) return;
  clipped_.clear();
  for (std::size_t i = 0; i < corners_.size(); ++i) {
    const std::size_t next = i + 1 < corners_.size() ? i + 1 : 0;
    const Corner &from = corners_[i], &to = corners_[next];
    const double h0 = heights_[i], h1 = heights_[next];
    const bool in0 = h0 <= tolerance, in1 = h1 <= tolerance;
    if (in0) clipped_.push_back(from);
    if (in0 == in1) continue;
    Corner cut{from.point + h0 / (h0 - h1) * (to.point - from.point), from.incident, from.reference, from.line};
    name_cut(cut, from.line, reference, face, edge);
    // Where the outline leaves the kept side it goes on along the cut.
    if (in0) cut.line = -1 - edge;
    clipped_.push_back(cut);
  }
  corners_.swap(clipped_);
}

// An edge of the incident face over an edge of the reference face; or, where both lines are the reference's, its
// corner.
void ConvexContacts::name_cut(Corner& cut, Index line, const Side& reference, const ConvexFace& face, Index edge) {
  const auto at = [](Index i) { return static_cast<std::size_t>(i); };
  if (line >= 0) {
    const ConvexCore& incident = *(&reference == &side_[0] ? side_[1] : side_[0]).core;
    cut.incident = feature_key(Feature::Kind::kEdge, incident.faces.empty() ? 0 : incident.loop_edges[at(line)]);
    cut.reference = feature_key(Feature::Kind::kEdge, reference.core->loop_edges[at(face.first + edge)]);
    return;
  }
  cut.incident = feature_key(Feature::Kind::kFace, 0);
  const Index other = -1 - line;  // consecutive edges meet in the corner that the later one starts from
  const bool wraps = (edge + 1) % face.count == other;
  cut.reference = feature_key(Feature::Kind::kVertex, reference.core->loops[at(face.first + (wraps ? other : edge))]);
}

}  // namespace limber::internal
