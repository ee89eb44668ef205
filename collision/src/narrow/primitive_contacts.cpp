#include "narrow/primitive_contacts.h"

#include <limits>

#include "limber/collision/tree_traversal.h"

namespace limber::internal {
namespace {

// Of a core: its ends and the segment between.
FeatureKey end_key(int end) { return feature_key(Feature::Kind::kVertex, end); }

}  // namespace

void half_space_contacts(PairSurface& surface, const Vec3& normal, double offset, double margin,
                         std::vector<Index>& scratch, std::vector<FeatureContact>& contacts) {
  const RigidTransform X_SP = surface.pose().inverse();
  scratch.clear();
  find_triangles_in_half_space(surface.deformed(), X_SP.q * normal, offset + margin - normal.dot(surface.pose().p),
                               scratch);
  for (const Index t : scratch)
    for (int c = 0; c < 3; ++c) {
      if (!surface.owns_vertex(t, c)) continue;
      const FeatureSide mine = surface.at_vertex(surface.surface().triangle(t)[static_cast<std::size_t>(c)]);
      const double height = normal.dot(mine.point) - offset;
      if (!(height <= margin)) continue;
      const FeatureSide below{feature_key(Feature::Kind::kFace, 0), -1, {}, mine.point - height * normal};
      contacts.push_back({mine, below, normal, height});
    }
}

void half_space_contacts(const ConvexCore& core, const Vec3& normal, double offset, double margin,
                         std::vector<FeatureContact>& contacts) {
  for (std::size_t i = 0; i < core.points.size(); ++i) {
    const Vec3 p = core.points[i] - core.radius * normal;
    const double height = normal.dot(p) - offset;
    if (height <= margin)
      contacts.push_back({{feature_key(Feature::Kind::kVertex, static_cast<Index>(i)), -1, {}, p},
                          {feature_key(Feature::Kind::kFace, 0), -1, {}, p - height * normal},
                          normal,
                          height});
  }
}

void CoreContacts::find(PairSurface& surface, const RoundedCore& core, double margin,
                        std::vector<FeatureContact>& contacts) {
  surface_ = &surface, core_ = core, contacts_ = &contacts;
  reach_ = core.radius + margin;
  const RigidTransform X_SP = surface.pose().inverse();
  Aabb box;
  for (const Vec3& end : core.ends) box.include(X_SP * end);
  triangles_.clear();
  find_triangles_in_box(surface.deformed(), box.grown(reach_), triangles_);
  Aabb core_box;
  for (const Vec3& end : core.ends) core_box.include(end);
  core_box = core_box.grown(reach_);
  for (const Index t : triangles_) {
    Aabb triangle_box;
    for (const Vec3& corner : surface.corners(t)) triangle_box.include(corner);
    if (!core_box.overlaps(triangle_box)) continue;
    for (int end = 0; end < (core.segment ? 2 : 1); ++end) end_against_face(end, t);
    for (int c = 0; c < 3; ++c) {
      if (surface.owns_vertex(t, c)) vertex_against_core(surface.surface().triangle(t)[static_cast<std::size_t>(c)]);
      if (core.segment && surface.owns_edge(t, c)) edge_against_core(surface.surface().edge_of(t, c));
    }
  }
  for (int end = 0; end < (core.segment ? 2 : 1); ++end) end_inside(end);
}

// Faces and edges only: a vertex is the business of vertex_against_core.
void CoreContacts::end_against_face(int end, Index t) {
  const Vec3& p = core_.ends[static_cast<std::size_t>(end)];
  surface_->for_each_minimum(p, t, reach_, false, [&](const PairSurface::Minimum& minimum) {
    if (kind_of(minimum.at.key) != Feature::Kind::kVertex) add(minimum.at, end_key(end), p, minimum.direction);
  });
}

void CoreContacts::vertex_against_core(Index v) {
  const Vec3& p = surface_->vertex(v);
  const SurfaceFoot foot = core_.segment ? closest_on_segment(p, core_.ends) : SurfaceFoot{core_.ends[0]};
  const double d = (foot.point - p).norm();
  if (!(d <= reach_) || !surface_->sees(v, foot.point)) return;
  const bool on_core = d <= surface_->directionless();
  add(surface_->at_vertex(v), feature_key(foot.feature.kind, foot.feature.index), foot.point,
      on_core ? unit_or(surface_->vertex_normal(v), Vec3::UnitZ()) : Vec3((foot.point - p) / d));
}

void CoreContacts::edge_against_core(Index e) {
  const SurfaceEdge& edge = surface_->surface().edge(e);
  const ClosestPoints pair =
      closest_points(SegmentPoints{surface_->vertex(edge.vertices[0]), surface_->vertex(edge.vertices[1])}, core_.ends);
  if (!(pair.distance <= reach_) || pair.a.feature.kind != Feature::Kind::kEdge ||
      pair.b.feature.kind != Feature::Kind::kEdge)
    return;
  const bool touching = pair.distance <= surface_->directionless();
  const Vec3 n =
      touching ? unit_or(surface_->edge_normal(e), Vec3::UnitZ()) : Vec3((pair.b.point - pair.a.point) / pair.distance);
  if (!surface_->in_normal_cone(e, n)) return;
  add(surface_->on_edge(e, pair.a.weight[1], pair.a.point), feature_key(Feature::Kind::kEdge, 0), pair.b.point, n);
}

void CoreContacts::end_inside(int end) {
  const Vec3& p = core_.ends[static_cast<std::size_t>(end)];
  if (!surface_->may_hold(p)) return;
  const PairSurface::Nearest nearest = surface_->nearest(p, std::numeric_limits<double>::infinity());
  if (!nearest.inside) return;
  const Vec3 n = nearest.distance > surface_->directionless() ? Vec3((nearest.foot.point - p) / nearest.distance)
                                                              : unit_or(nearest.outward, Vec3::UnitZ());
  add(surface_->at_foot(nearest.triangle, nearest.foot), end_key(end), p, n);
}

// @param normal unit, out of the surface
void CoreContacts::add(const FeatureSide& of_surface, FeatureKey of_core, const Vec3& core_point, const Vec3& normal) {
  const FeatureSide core{of_core, -1, {}, core_point - core_.radius * normal};
  contacts_->push_back({of_surface, core, -normal, normal.dot(core.point - of_surface.point)});
}

}  // namespace limber::internal
