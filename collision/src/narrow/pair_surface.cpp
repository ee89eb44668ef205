#include "narrow/pair_surface.h"

#include <algorithm>
#include <cmath>

#include "hierarchy/branch_and_bound.h"
#include "limber/collision/tree_traversal.h"
#include "tuning.h"

namespace limber::internal {
namespace {

// How far along a ray a box begins; infinite where the ray misses it.
double distance_along(const Vec3& p, const Vec3& direction, const Aabb& box) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  double first = 0.0, last = kInfinity;
  for (int axis = 0; axis < 3; ++axis) {
    if (direction[axis] == 0.0) {
      if (p[axis] < box.low[axis] || p[axis] > box.high[axis]) return kInfinity;
      continue;
    }
    const double to_low = (box.low[axis] - p[axis]) / direction[axis];
    const double to_high = (box.high[axis] - p[axis]) / direction[axis];
    first = std::max(first, std::min(to_low, to_high));
    last = std::min(last, std::max(to_low, to_high));
  }
  return first <= last ? first : kInfinity;
}

template <class T>
void grow(std::vector<T>& v, Index size) {
  if (v.size() < static_cast<std::size_t>(size)) v.resize(static_cast<std::size_t>(size));
}

int corner_of(const Triangle& t, Index v) { return t[0] == v ? 0 : t[1] == v ? 1 : 2; }

int corner_of_edge(const CollisionSurface& s, Index t, Index e) {
  return s.edge_of(t, 0) == e ? 0 : s.edge_of(t, 1) == e ? 1 : 2;
}

}  // namespace

void PairSurface::bind(DeformedSurface& deformed, const RigidTransform& X_PS, double tolerance,
                       const Vec3& solid_below) {
  deformed_ = &deformed;
  up_ = X_PS.q * solid_below;
  tolerance_ = tolerance, directionless_ = collision_tuning().narrow.directionless * tolerance;
  X_PS_ = X_PS, X_SP_ = X_PS.inverse();
  displacement_ = rotation_ = Vec3::Zero();
  sided_ = surface().closed() || surface().model() == nullptr;
  grow(vertices_, surface().vertices()), grow(vertex_stamp_, surface().vertices());
  grow(faces_, surface().triangles()), grow(face_stamp_, surface().triangles());
  if (++generation_ == 0) {  // after 2³² queries the old stamps would come to life again
    for (std::vector<std::uint32_t>* stamps : {&vertex_stamp_, &face_stamp_})
      std::fill(stamps->begin(), stamps->end(), 0u);
    generation_ = 1;
  }
}

void PairSurface::make_vertex(Index v) {
  const auto i = static_cast<std::size_t>(v);
  vertices_[i] = X_PS_ * deformed_->vertex(v);
  vertex_stamp_[i] = generation_;
}

void PairSurface::make_face(Index t) {
  const auto i = static_cast<std::size_t>(t);
  Face& f = faces_[i];
  f.box = {};
  for (std::size_t c = 0; c < 3; ++c) {
    f.x[c] = vertex(surface().triangle(t)[c]);
    f.box.include(f.x[c]);
  }
  const std::array<Vec3, 3> edge{f.x[1] - f.x[0], f.x[2] - f.x[1], f.x[0] - f.x[2]};
  f.normal = unit_normal(f.x);
  for (std::size_t c = 0; c < 3; ++c) {
    const double length = edge[c].norm();
    f.inward[c] = length > 0.0 ? Vec3(f.normal.cross(edge[c]) / length) : Vec3(Vec3::Zero());
  }
  face_stamp_[i] = generation_;
}

bool PairSurface::edge_minimum(const Vec3& p, Index e, double reach, Minimum& minimum) {
  const SurfaceEdge& edge = surface().edge(e);
  if (edge.triangle_count == 0) return false;
  const Vec3 &x0 = vertex(edge.vertices[0]), &x1 = vertex(edge.vertices[1]);
  const double length = (x1 - x0).norm();
  const double ahead0 = (p - x0).dot(x1 - x0), ahead1 = (p - x1).dot(x0 - x1);
  if (!(ahead0 > tolerance_ * length) || !(ahead1 > tolerance_ * length)) return false;
  for (const Index t : surface().edge_triangles(e)) {
    const auto c = static_cast<std::size_t>(corner_of_edge(surface(), t, e));
    if ((p - face(t).x[c]).dot(face(t).inward[c]) > tolerance_) return false;
  }
  const SurfaceFoot foot = closest_on_segment(p, {x0, x1});
  if (!((p - foot.point).norm() <= reach)) return false;
  minimum.at = on_edge(e, foot.weight[1], foot.point);
  return finish(p, edge_normal(e), reach, minimum);
}

bool PairSurface::vertex_minimum(const Vec3& p, Index v, double reach, Minimum& minimum) {
  const Vec3& q = vertex(v);
  if (!((p - q).norm() <= reach)) return false;
  for (const Index w : surface().vertex_neighbours(v)) {
    const Vec3& y = vertex(w);
    if ((p - q).dot(y - q) > tolerance_ * (y - q).norm()) return false;
  }
  minimum.at = at_vertex(v);
  return finish(p, vertex_normal(v), reach, minimum);
}

// Direction and distance of a minimum on an edge or vertex.
bool PairSurface::finish(const Vec3& p, const Vec3& outward, double reach, Minimum& minimum) const {
  const Vec3 d = p - minimum.at.point;
  if (sided_ && outward.dot(d) < -tolerance_) return false;
  const double length = d.norm();
  minimum.direction = length > directionless_ ? Vec3(d / length) : unit_or(outward, Vec3::UnitZ());
  minimum.distance = minimum.direction.dot(d);
  return minimum.distance <= reach;
}

bool PairSurface::sees(Index v, const Vec3& q) {
  if (!sided_) return true;
  const Vec3 d = q - vertex(v);
  const auto triangles = surface().vertex_triangles(v);
  return std::any_of(triangles.begin(), triangles.end(), [&](Index t) { return face(t).normal.dot(d) >= -tolerance_; });
}

bool PairSurface::in_normal_cone(Index e, const Vec3& direction) {
  Vec3 sum = Vec3::Zero();
  double worst = -1.0;
  for (const Index t : surface().edge_triangles(e)) {
    const Vec3& inward = face(t).inward[static_cast<std::size_t>(corner_of_edge(surface(), t, e))];
    sum += inward;
    worst = std::max(worst, inward.dot(direction));
  }
  if (worst > kRoundOff + collision_tuning().narrow.rocking * sum.norm()) return false;
  return !sided_ || edge_normal(e).dot(direction) >= -kRoundOff;
}

bool PairSurface::in_front(Index v, const Vec3& n, double leaning) {
  const Vec3& p = vertex(v);
  const auto neighbours = surface().vertex_neighbours(v);
  return std::all_of(neighbours.begin(), neighbours.end(), [&](Index w) {
    const Vec3 d = vertex(w) - p;
    return n.dot(d) >= -leaning * d.norm();
  });
}

bool PairSurface::behind(const FeatureSide& feature, const Vec3& n, double leaning) {
  const Index index = index_of(feature.key);
  switch (kind_of(feature.key)) {
    case Feature::Kind::kVertex:
      return in_front(index, -n, leaning);
    case Feature::Kind::kEdge:
      for (const Index t : surface().edge_triangles(index))
        if (n.dot(face(t).inward[static_cast<std::size_t>(corner_of_edge(surface(), t, index))]) > leaning)
          return false;
      return std::abs(n.dot(edge_vector(index))) <= leaning * edge_vector(index).norm();
    case Feature::Kind::kFace:
      break;
  }
  return n.dot(face(index).normal) >= std::sqrt(1.0 - leaning * leaning);
}

double PairSurface::shortest_edge(Index v) {
  double shortest = std::numeric_limits<double>::infinity();
  for (const Index w : surface().vertex_neighbours(v)) shortest = std::min(shortest, (vertex(w) - vertex(v)).norm());
  return shortest;
}

Vec3 PairSurface::edge_normal(Index e) {
  Vec3 sum = Vec3::Zero();
  for (const Index t : surface().edge_triangles(e)) sum += face(t).normal;
  return sum;
}

Vec3 PairSurface::vertex_normal(Index v) {
  Vec3 sum = Vec3::Zero();
  for (const Index t : surface().vertex_triangles(v)) {
    const Face& f = face(t);
    const auto c = static_cast<std::size_t>(corner_of(surface().triangle(t), v));
    const Vec3 u = f.x[(c + 1) % 3] - f.x[c], w = f.x[(c + 2) % 3] - f.x[c];
    sum += std::atan2(u.cross(w).norm(), u.dot(w)) * f.normal;
  }
  return sum;
}

Vec3 PairSurface::normal_at(Index t, const Feature& feature) {
  switch (feature.kind) {
    case Feature::Kind::kVertex:
      return vertex_normal(surface().triangle(t)[feature.index]);
    case Feature::Kind::kEdge:
      return edge_normal(surface().edge_of(t, feature.index));
    case Feature::Kind::kFace:
      break;
  }
  return face(t).normal;
}

FeatureSide PairSurface::at_vertex(Index v) {
  FeatureSide side{feature_key(Feature::Kind::kVertex, v), surface().vertex_triangles(v).front(), {}, vertex(v)};
  side.weight[static_cast<std::size_t>(corner_of(surface().triangle(side.triangle), v))] = 1.0;
  return side;
}

FeatureSide PairSurface::on_edge(Index e, double fraction, const Vec3& point) {
  const SurfaceEdge& edge = surface().edge(e);
  FeatureSide side{feature_key(Feature::Kind::kEdge, e), surface().edge_triangles(e).front(), {}, point};
  const Triangle& t = surface().triangle(side.triangle);
  side.weight[static_cast<std::size_t>(corner_of(t, edge.vertices[0]))] = 1.0 - fraction;
  side.weight[static_cast<std::size_t>(corner_of(t, edge.vertices[1]))] = fraction;
  return side;
}

FeatureSide PairSurface::on_face(Index t, const Vec3& point) {
  return {feature_key(Feature::Kind::kFace, t), t, closest_on_triangle(point, face(t).x).weight, point};
}

FeatureSide PairSurface::at_foot(Index t, const SurfaceFoot& foot) {
  Index index = t;
  if (foot.feature.kind == Feature::Kind::kVertex) return at_vertex(surface().triangle(t)[foot.feature.index]);
  if (foot.feature.kind == Feature::Kind::kEdge) index = surface().edge_of(t, foot.feature.index);
  return {feature_key(foot.feature.kind, index), t, foot.weight, foot.point};
}

bool PairSurface::on_rim(Index t, const Feature& feature) const {
  if (surface().closed() || feature.kind == Feature::Kind::kFace) return false;
  if (feature.kind == Feature::Kind::kEdge) return surface().edge(surface().edge_of(t, feature.index)).boundary();
  const Index v = surface().triangle(t)[feature.index];
  for (const Index u : surface().vertex_triangles(v))
    for (int c = 0; c < 3; ++c) {
      const SurfaceEdge& e = surface().edge(surface().edge_of(u, c));
      if (e.boundary() && (e.vertices[0] == v || e.vertices[1] == v)) return true;
    }
  return false;
}

double PairSurface::distance_from(Index t, const Vec3& p) {
  return (p - closest_on_triangle(p, corners(t)).point).norm();
}

// Of equally near triangles the first by number, whichever boxes are at hand and in whatever order that leads there.
PairSurface::Nearest PairSurface::nearest(const Vec3& p, double max_distance) {
  constexpr double kSurely = 1.0 - 1e-9;  // so that what is equally near is looked at
  const auto box_distance2 = [](const Vec3& q, const Vec3& low, const Vec3& high) {
    return kSurely * (low - q).cwiseMax(q - high).cwiseMax(0.0).squaredNorm();
  };
  Nearest r;
  r.distance = max_distance;
  const Vec3 p_S = X_SP_ * p;
  branch_and_bound(
      *deformed_, [&](const Aabb& box) { return box_distance2(p_S, box.low, box.high); },
      [&](Index t, double best2) {
        const TrianglePoints x = corners(t);
        if (!(box_distance2(p, x[0].cwiseMin(x[1]).cwiseMin(x[2]), x[0].cwiseMax(x[1]).cwiseMax(x[2])) < best2))
          return best2;
        const SurfaceFoot foot = closest_on_triangle(p, x);
        const double d = (p - foot.point).norm();
        if (!(d < r.distance) && !(d == r.distance && t < r.triangle)) return best2;
        r.triangle = t, r.foot = foot, r.distance = d;
        return d * d;
      },
      max_distance * max_distance);
  if (r.triangle < 0) return r;
  r.outward = normal_at(r.triangle, r.foot.feature);
  r.inside = !up_.isZero(0.0) ? is_below(p)
                              : sided_ && r.outward.dot(p - r.foot.point) < 0.0 && !on_rim(r.triangle, r.foot.feature);
  return r;
}

PairSurface::WayOut PairSurface::way_out(const Vec3& p, const Vec3& direction) {
  WayOut way;
  const double grazing = collision_tuning().narrow.grazing;
  const Vec3 p_S = X_SP_ * p, direction_S = X_SP_.q * direction;
  branch_and_bound(
      *deformed_, [&](const Aabb& box) { return distance_along(p_S, direction_S, box.grown(tolerance_)); },
      [&](Index t, double best) {
        const Face& f = face(t);
        const double slope = f.normal.dot(direction), height = f.normal.dot(f.x[0] - p);
        if (!(slope > grazing) || height < -tolerance_) return best;
        const double d = std::max(height / slope, 0.0);
        if (!(d < best)) return best;
        const Vec3 q = p + d * direction;
        for (std::size_t c = 0; c < 3; ++c)
          if ((q - f.x[c]).dot(f.inward[c]) < -tolerance_ / slope) return best;  // q is as uncertain as that
        way = {t, d};
        return d;
      });
  return way;
}

}  // namespace limber::internal
