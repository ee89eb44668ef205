#include "fcl_body.h"

#include <fcl/geometry/shape/box.h>
#include <fcl/geometry/shape/capsule.h>
#include <fcl/geometry/shape/convex.h>
#include <fcl/geometry/shape/sphere.h>
#include <fcl/math/detail/project.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "finder/world_bounds.h"

namespace limber::internal {
namespace {

using Project = fcl::detail::Project<double>;
using FclShape = std::shared_ptr<fcl::CollisionGeometry<double>>;

/// The rim of a feature that counts as the feature, in parts of it: round-off of FCL's barycentric coordinates.
constexpr double kRim = 1e-9;

FclShape hull_of(const CollisionSurface& surface) {
  auto points = std::make_shared<std::vector<Vec3>>();
  for (Index v = 0; v < surface.vertices(); ++v) points->push_back(surface.rest(v));
  auto faces = std::make_shared<std::vector<int>>();
  for (Index t = 0; t < surface.triangles(); ++t) {
    faces->push_back(3);
    for (const Index v : surface.triangle(t)) faces->push_back(v);
  }
  return std::make_shared<fcl::Convex<double>>(points, surface.triangles(), faces);
}

FclShape convex_of(const RigidGeometry& geometry) {
  if (const auto* ball = std::get_if<Sphere>(&geometry.shape()))
    return std::make_shared<fcl::Sphere<double>>(ball->radius);
  if (const auto* capsule = std::get_if<Capsule>(&geometry.shape()))
    return std::make_shared<fcl::Capsule<double>>(capsule->radius, 2.0 * capsule->half_length);
  if (const auto* box = std::get_if<Box>(&geometry.shape()))
    return std::make_shared<fcl::Box<double>>(Vec3(2.0 * box->half_extents));
  if (std::holds_alternative<ConvexHull>(geometry.shape())) return hull_of(*geometry.surface());
  return nullptr;
}

/// Of an edge, vertex or the inside of a triangle, by the corners that have a part in the foot.
FeatureKey key_of(const CollisionSurface& surface, Index t, const std::array<double, 3>& weight) {
  std::array<int, 3> part{};
  int parts = 0;
  for (int c = 0; c < 3; ++c)
    if (weight[static_cast<std::size_t>(c)] > 0.0) part[static_cast<std::size_t>(parts++)] = c;
  if (parts == 1) return feature_key(Feature::Kind::kVertex, surface.triangle(t)[static_cast<std::size_t>(part[0])]);
  if (parts == 3) return feature_key(Feature::Kind::kFace, t);
  return feature_key(Feature::Kind::kEdge, surface.edge_of(t, part[0] == 0 && part[1] == 2 ? 2 : part[0]));
}

/// Of a triangle without area, which FCL's projection leaves out.
Project::ProjectResult project_on_edges(const TrianglePoints& x, const Vec3& p) {
  Project::ProjectResult best;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t next = (k + 1) % 3;
    Project::ProjectResult r = Project::projectLine(x[k], x[next], p);
    if (r.encode == 0u) r.encode = 1u, r.parameterization[0] = 1.0, r.sqr_distance = (p - x[k]).squaredNorm();
    if (best.encode != 0u && best.sqr_distance <= r.sqr_distance) continue;
    best.sqr_distance = r.sqr_distance;
    best.encode = ((r.encode & 1u) != 0u ? 1u << k : 0u) | ((r.encode & 2u) != 0u ? 1u << next : 0u);
    best.parameterization[k] = r.parameterization[0], best.parameterization[next] = r.parameterization[1];
  }
  return best;
}

template <class Visit, class Cull>
void walk(const FclTree& tree, int node, const Cull& beyond, const Visit& visit) {
  const auto& n = tree.getBV(node);
  if (beyond(n.bv)) return;
  if (n.isLeaf()) {
    visit(static_cast<Index>(n.primitiveId()));
    return;
  }
  walk(tree, n.leftChild(), beyond, visit);
  walk(tree, n.rightChild(), beyond, visit);
}

}  // namespace

FclPlace::FclPlace(Index body)
    : fcl::CollisionObject<double>(std::make_shared<fcl::Sphere<double>>(1.0)), body_(body) {}

FclBody::FclBody(Index index, std::shared_ptr<const ModalGeometry> modal)
    : modal_(std::move(modal)), surface_(modal_->surface), place_(index) {
  diagonal_ = 2.0 * surface_->rest_bounds().half_extents().norm();
  make_tree();
}

FclBody::FclBody(Index index, std::shared_ptr<const RigidGeometry> rigid)
    : rigid_(std::move(rigid)), surface_(rigid_->surface()), convex_(convex_of(*rigid_)), place_(index) {
  diagonal_ = 2.0 * rigid_->bounds().half_extents().norm();
  below_is_solid_ = std::holds_alternative<HeightField>(rigid_->shape());
  if (const auto* ball = std::get_if<Sphere>(&rigid_->shape())) radius_ = ball->radius, points_.resize(1);
  if (const auto* capsule = std::get_if<Capsule>(&rigid_->shape()))
    radius_ = capsule->radius, points_.resize(capsule->half_length > 0.0 ? 2 : 1);
  if (surface_ != nullptr) make_tree();
}

void FclBody::make_tree() {
  points_.resize(static_cast<std::size_t>(surface_->vertices()));
  for (Index v = 0; v < surface_->vertices(); ++v) points_[static_cast<std::size_t>(v)] = surface_->rest(v);
  std::vector<fcl::Triangle> triangles;
  for (Index t = 0; t < surface_->triangles(); ++t) {
    const Triangle& corners = surface_->triangle(t);
    triangles.emplace_back(static_cast<std::size_t>(corners[0]), static_cast<std::size_t>(corners[1]),
                           static_cast<std::size_t>(corners[2]));
  }
  tree_ = std::make_unique<FclTree>();
  tree_->beginModel(surface_->triangles(), surface_->vertices());
  tree_->addSubModel(points_, triangles);
  tree_->endModel();
}

void FclBody::place(const RigidTransform& X_WB, std::span<const double> amplitudes) {
  X_WB_ = X_WB;
  if (half_space() != nullptr) return;
  if (surface_ == nullptr) {
    const auto* capsule = std::get_if<Capsule>(&rigid_->shape());
    const Vec3 end = capsule != nullptr ? Vec3(X_WB.q * Vec3(0.0, 0.0, capsule->half_length)) : Vec3(Vec3::Zero());
    points_.front() = X_WB.p - end;
    points_.back() = X_WB.p + end;
    box_ = world_box(*rigid_, X_WB);
    return;
  }
  if (modal_) deformed_.bind(surface_, amplitudes);
  box_ = {};
  for (Index v = 0; v < surface_->vertices(); ++v) {
    const Vec3 p = X_WB * (modal_ ? deformed_.vertex(v) : surface_->rest(v));
    points_[static_cast<std::size_t>(v)] = p;
    if (is_corner(v)) box_.include(p);
  }
  tree_->beginReplaceModel();
  tree_->replaceSubModel(points_);
  tree_->endReplaceModel(true, true);
}

double FclBody::round_off(const Vec3& p) const {
  return kRoundOff * (p.cwiseAbs().maxCoeff() + (half_space() ? 0.0 : diagonal_));
}

Vec3 FclBody::face_normal(Index t) const {
  const Triangle& c = surface_->triangle(t);
  return unit_or((point(c[1]) - point(c[0])).cross(point(c[2]) - point(c[0])), Vec3::Zero());
}

Vec3 FclBody::normal_at(FeatureKey key) const {
  if (surface_ == nullptr) return Vec3::Zero();
  const Index i = index_of(key);
  if (kind_of(key) == Feature::Kind::kFace) return face_normal(i);
  Vec3 sum = Vec3::Zero();
  if (kind_of(key) == Feature::Kind::kEdge) {
    for (const Index t : surface_->edge_triangles(i)) sum += face_normal(t);
    return unit_or(sum, Vec3::Zero());
  }
  for (const Index t : surface_->vertex_triangles(i)) {
    const Triangle& c = surface_->triangle(t);
    for (std::size_t k = 0; k < 3; ++k) {
      if (c[k] != i) continue;
      const Vec3 u = point(c[(k + 1) % 3]) - point(i), w = point(c[(k + 2) % 3]) - point(i);
      sum += std::atan2(u.cross(w).norm(), u.dot(w)) * face_normal(t);
    }
  }
  return unit_or(sum, Vec3::Zero());
}

FclFoot FclBody::foot_on_core(const Vec3& p) const {
  FclFoot foot;
  if (points_.size() == 1) {
    foot.at = {feature_key(Feature::Kind::kVertex, 0), -1, {}, points_[0]};
  } else {
    const auto r = Project::projectLine(points_[0], points_[1], p);
    const bool inside = r.encode == 3u;
    foot.at = {inside ? feature_key(Feature::Kind::kEdge, 0) : feature_key(Feature::Kind::kVertex, r.encode == 2u),
               -1,
               {},
               points_[0] + r.parameterization[1] * (points_[1] - points_[0])};
  }
  foot.distance = (p - foot.at.point).norm();
  return foot;
}

FclFoot FclBody::foot_in(Index t, const Vec3& p) const {
  const Triangle& c = surface_->triangle(t);
  Project::ProjectResult r = Project::projectTriangle(point(c[0]), point(c[1]), point(c[2]), p);
  if (r.encode == 0u) r = project_on_edges({point(c[0]), point(c[1]), point(c[2])}, p);
  FclFoot foot;
  foot.at.triangle = t;
  double sum = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const double part = (r.encode >> k & 1u) != 0u ? r.parameterization[k] : 0.0;
    sum += foot.at.weight[k] = part > kRim ? part : 0.0;
  }
  for (std::size_t k = 0; k < 3; ++k) {
    foot.at.weight[k] /= sum;
    foot.at.point += foot.at.weight[k] * point(c[k]);
  }
  foot.at.key = key_of(*surface_, t, foot.at.weight);
  foot.distance = (p - foot.at.point).norm();
  return foot;
}

void FclBody::near(const Vec3& p, double reach, std::vector<FclFoot>& feet) const {
  feet.clear();
  if (surface_ == nullptr) {
    feet.push_back(foot_on_core(p));
    if (!(feet.back().distance <= reach)) feet.clear();
    return;
  }
  const FclBox at(p);
  walk(
      *tree_, 0, [&](const FclBox& box) { return box.distance(at) > reach; },
      [&](Index t) {
        const FclFoot foot = foot_in(t, p);
        if (foot.distance <= reach) feet.push_back(foot);
      });
  std::sort(feet.begin(), feet.end(), [](const FclFoot& f, const FclFoot& g) { return f.at.triangle < g.at.triangle; });
}

FclFoot FclBody::nearest(const Vec3& p) const {
  if (surface_ == nullptr) return foot_on_core(p);
  const FclBox at(p);
  FclFoot best;
  best.distance = std::numeric_limits<double>::infinity();
  const auto look = [&](const auto& self, int node) -> void {
    const auto& n = tree_->getBV(node);
    if (n.isLeaf()) {
      const FclFoot foot = foot_in(static_cast<Index>(n.primitiveId()), p);
      if (foot.distance < best.distance || (foot.distance == best.distance && foot.at.triangle < best.at.triangle))
        best = foot;
      return;
    }
    std::array<int, 2> child{n.leftChild(), n.rightChild()};
    std::array<double, 2> distance{tree_->getBV(child[0]).bv.distance(at), tree_->getBV(child[1]).bv.distance(at)};
    if (distance[1] < distance[0]) std::swap(child[0], child[1]), std::swap(distance[0], distance[1]);
    for (std::size_t i = 0; i < 2; ++i)
      if (distance[i] <= best.distance) self(self, child[i]);
  };
  look(look, 0);
  return best;
}

bool FclBody::is_behind(const Vec3& p, const FclFoot& nearest) const {
  if (!sided()) return false;
  const FeatureKey key = nearest.at.key;
  const auto on_rim = [&](Index e) { return surface_->edge(e).boundary(); };
  if (!surface_->closed() && kind_of(key) == Feature::Kind::kEdge && on_rim(index_of(key))) return false;
  if (!surface_->closed() && kind_of(key) == Feature::Kind::kVertex)
    for (const Index t : surface_->vertex_triangles(index_of(key)))
      for (int c = 0; c < 3; ++c) {
        const Index e = surface_->edge_of(t, c);
        const auto& ends = surface_->edge(e).vertices;
        if ((ends[0] == index_of(key) || ends[1] == index_of(key)) && on_rim(e)) return false;
      }
  return normal_at(key).dot(p - nearest.at.point) < 0.0;
}

void FclBody::triangles_near(const Aabb& box, std::vector<Index>& triangles) const {
  triangles.clear();
  const FclBox about = fcl_box(box);
  walk(
      *tree_, 0, [&](const FclBox& node) { return !node.overlap(about); }, [&](Index t) { triangles.push_back(t); });
  std::sort(triangles.begin(), triangles.end());
}

}  // namespace limber::internal
