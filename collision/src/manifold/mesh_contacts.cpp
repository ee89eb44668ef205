#include "manifold/mesh_contacts.h"

#include <algorithm>
#include <limits>

#include "limber/collision/tree_traversal.h"
#include "tuning.h"

namespace limber::internal {
namespace {

/// Whether it reaches to the plane and no farther.
bool reaches_to(PairSurface& mesh, Index t, const SupportPlane& plane) {
  const TrianglePoints x = mesh.corners(t);
  double highest = -std::numeric_limits<double>::infinity();
  for (const Vec3& p : x) highest = std::max(highest, plane.normal.dot(p) - plane.offset);
  return std::abs(highest) <= plane.tolerance;
}

/// Whether a contact along a direction goes: all that meets at the feature reaches to a plane that the body rests on.
bool is_beneath(PairSurface& mesh, std::span<const SupportPlane> planes, FeatureKey feature, const Vec3& out) {
  const double same_normal = collision_tuning().manifold.same_normal;
  return std::ranges::any_of(planes, [&](const SupportPlane& plane) {
    if ((out - plane.normal).norm() <= same_normal) return false;
    bool all = true;
    mesh.for_faces_at(feature, [&](Index t) { all = all && reaches_to(mesh, t, plane); });
    return all;
  });
}

/// Whether a point is inside of what a surface bounds.
bool holds(PairSurface& mesh, const Vec3& p) {
  return mesh.may_hold(p) && mesh.nearest(p, std::numeric_limits<double>::infinity()).inside;
}

}  // namespace

/// The vertices that reach farthest along the direction are a vertex or an edge; nothing beside it may reach farther.
bool MeshContacts::Cone::allows(const Vec3& out) {
  const PairSurface::Face& face = mesh->face(triangle);
  const double leaning = collision_tuning().manifold.leaning;
  if (face.normal.dot(out) < -leaning) return false;
  std::array<double, 3> height;
  for (std::size_t c = 0; c < 3; ++c) height[c] = out.dot(face.x[c]);
  const auto top = static_cast<std::size_t>(std::max_element(height.begin(), height.end()) - height.begin());
  for (std::size_t c = 0; c < 3; ++c) {
    const std::size_t d = (c + 1) % 3;
    const double level = leaning * (face.x[d] - face.x[c]).norm();
    if (std::min(height[c], height[d]) < height[top] - level) continue;
    nearest = feature_key(Feature::Kind::kEdge, mesh->surface().edge_of(triangle, static_cast<int>(c)));
    FeatureSide edge;
    edge.key = nearest;
    if (mesh->behind(edge, out, leaning)) return true;
  }
  FeatureSide vertex;
  vertex.key = nearest = feature_key(Feature::Kind::kVertex, mesh->surface().triangle(triangle)[top]);
  return mesh->behind(vertex, out, leaning);
}

void MeshContacts::find(const Query& q, std::vector<FeatureContact>& found) {
  found_ = &found;
  const std::size_t first = found.size();
  if (q.core.faces.empty())
    find_rounded(q);
  else if (!leave_as_a_whole(q))
    find_polytope(q);
  rest_on_own_faces(q, first);
}

/// Where the body rests on a face, edges and vertices that reach to its plane and no farther are nothing beside it: of
/// triangles that only lie side by side.
void MeshContacts::rest_on_own_faces(const Query& q, std::size_t first) {
  own_planes_.clear();
  const auto begin = found_->begin() + static_cast<std::ptrdiff_t>(first);
  for (auto c = begin; c != found_->end(); ++c)
    if (kind_of(c->b.key) == Feature::Kind::kFace && c->gap <= q.passing.touching)
      own_planes_.push_back({c->normal, c->normal.dot(c->b.point), q.passing.touching});
  const auto goes = [&](const FeatureContact& c) {
    return kind_of(c.b.key) != Feature::Kind::kFace && is_beneath(q.mesh, own_planes_, c.b.key, c.normal);
  };
  if (!own_planes_.empty()) found_->erase(std::remove_if(begin, found_->end(), goes), found_->end());
}

// -- Balls and capsules -----------------------------------------------------------------------------------------------

/// The local minima of the distance. What goes through a thin wall leaves it on the side of its middle.
void MeshContacts::find_rounded(const Query& q) {
  const std::size_t first = found_->size();
  core_contacts_.find(q.mesh, {{q.core.points.front(), q.core.points.back()}, q.core.points.size() == 2, q.core.radius},
                      q.reach, *found_);
  const Vec3 middle = q.core.middle();
  const auto is_behind = [&](const FeatureContact& c) { return c.normal.dot(middle - c.a.point) > 0.0; };
  const bool crosses = std::any_of(found_->begin() + static_cast<std::ptrdiff_t>(first), found_->end(), is_behind) &&
                       !holds(q.mesh, middle);
  const double leaning = collision_tuning().manifold.leaning;
  const auto goes = [&](const FeatureContact& c) {
    return !q.mesh.behind(c.a, -c.normal, leaning) || is_beneath(q.mesh, q.planes, c.a.key, -c.normal) ||
           (crosses && is_behind(c));
  };
  found_->erase(std::remove_if(found_->begin() + static_cast<std::ptrdiff_t>(first), found_->end(), goes),
                found_->end());
  for (std::size_t i = first; i < found_->size(); ++i) {
    FeatureContact& c = (*found_)[i];
    c = {c.b, c.a, -c.normal, c.gap};
    c.b.key = named(q.facets, c.b.key);
  }
}

// -- Boxes and hulls --------------------------------------------------------------------------------------------------

/// A body whose middle is inside of what the mesh bounds goes out along one direction, to the nearest point of it.
bool MeshContacts::leave_as_a_whole(const Query& q) {
  const Vec3 middle = q.core.middle();
  if (!q.mesh.may_hold(middle)) return false;
  const PairSurface::Nearest nearest = q.mesh.nearest(middle, std::numeric_limits<double>::infinity());
  if (!nearest.inside) return false;
  const Vec3 out = nearest.distance > q.mesh.directionless() ? Vec3((nearest.foot.point - middle) / nearest.distance)
                                                             : unit_or(nearest.outward, Vec3::UnitZ());
  const FeatureKey facet = feature_key(Feature::Kind::kFace, q.facets.facet(nearest.triangle));
  for (std::size_t v = 0; v < q.core.points.size(); ++v) {
    const Vec3& p = q.core.points[v];
    const double gap = out.dot(p - nearest.foot.point);
    found_->push_back({{feature_key(Feature::Kind::kVertex, static_cast<Index>(v)), -1, {}, p},
                       {facet, -1, {}, p - gap * out},
                       out,
                       gap});
  }
  return true;
}

void MeshContacts::find_polytope(const Query& q) {
  const RigidTransform X_SP = q.mesh.pose().inverse();
  Aabb box, box_S;
  for (const Vec3& p : q.core.points) box.include(p), box_S.include(X_SP * p);
  box = box.grown(q.reach);
  triangles_.clear();
  find_triangles_in_box(q.mesh.deformed(), box_S.grown(q.reach), triangles_);
  for (const Index t : triangles_)
    if (box.overlaps(q.mesh.face(t).box)) on_triangle(q, t);
}

void MeshContacts::on_triangle(const Query& q, Index t) {
  const PairSurface::Face& face = q.mesh.face(t);
  if (face.normal.isZero(0.0)) return;
  const double offset = face.normal.dot(face.x[0]);
  const std::size_t first = found_->size();
  if (triangle_.faces.empty()) {
    triangle_.points.resize(3), triangle_.edge_directions.resize(3);
    triangle_.loops = triangle_.loop_edges = {0, 1, 2};
    triangle_.faces.resize(1);
  }
  triangle_.faces[0] = {face.normal, offset, 0, 3};
  for (std::size_t c = 0; c < 3; ++c) {
    triangle_.points[c] = face.x[c];
    triangle_.edge_directions[c] = (face.x[(c + 1) % 3] - face.x[c]).normalized();
  }
  cone_.mesh = &q.mesh, cone_.triangle = t;
  bool flush = false;
  for (const SupportPlane& plane : q.planes) {
    if (!reaches_to(q.mesh, t, plane)) continue;
    if ((face.normal - plane.normal).norm() > collision_tuning().manifold.same_normal) return;
    flush = true;
  }
  ConvexContacts::TriangleQuery query{q.reach, q.passing, q.facets.has_active_edge(t) && !flush, flush};
  for (int c = 0; c < 3; ++c) {
    const Index next = q.facets.active(t, c) ? q.mesh.surface().neighbour(t, c) : -1;
    if (next < 0) continue;
    const PairSurface::Face& beyond = q.mesh.face(next);
    query.beyond[query.beyond_count++] = {beyond.normal, beyond.normal.dot(beyond.x[0])};
  }
  convex_.find_on_triangle(q.core, triangle_, query, cone_, *found_);
  name(q, t, first);
}

/// Features of the triangle become those of the mesh. Cuts along an edge within a facet, and its vertices there, are no
/// corners of what touches.
void MeshContacts::name(const Query& q, Index t, std::size_t first) {
  std::size_t kept = first;
  for (std::size_t i = first; i < found_->size(); ++i) {
    FeatureContact c = (*found_)[i];
    const Index local = index_of(c.b.key);
    switch (c.b.key >> 30) {
      case static_cast<FeatureKey>(Feature::Kind::kFace):
        c.b.key = feature_key(Feature::Kind::kFace, q.facets.facet(t));
        break;
      case static_cast<FeatureKey>(Feature::Kind::kEdge):
        c.b.key = feature_key(Feature::Kind::kEdge, q.mesh.surface().edge_of(t, static_cast<int>(local)));
        if (q.facets.around_edge(index_of(c.b.key)) >= 0) continue;
        break;
      case static_cast<FeatureKey>(Feature::Kind::kVertex):
        c.b.key = feature_key(Feature::Kind::kVertex, q.mesh.surface().triangle(t)[static_cast<std::size_t>(local)]);
        if (q.facets.around_vertex(index_of(c.b.key)) >= 0) continue;
        break;
      default:  // nearest points
        c.b.key = cone_.nearest;
    }
    (*found_)[kept++] = c;
  }
  found_->resize(kept);
}

/// What is within a facet is called by it.
FeatureKey MeshContacts::named(const MeshFacets& facets, FeatureKey key) {
  const Index index = index_of(key);
  const Index facet = kind_of(key) == Feature::Kind::kFace   ? facets.facet(index)
                      : kind_of(key) == Feature::Kind::kEdge ? facets.around_edge(index)
                                                             : facets.around_vertex(index);
  return facet >= 0 ? feature_key(Feature::Kind::kFace, facet) : key;
}

}  // namespace limber::internal
