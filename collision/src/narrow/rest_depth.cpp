#include "narrow/rest_depth.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "limber/core/error.h"
#include "limber/mesh/tet_mesh.h"
#include "tuning.h"

namespace limber::internal {
namespace {

TetMesh rest_mesh(const ModalModel& model) {
  if (!model.data().volume_block)
    throw InvalidArgument("RestVolume: model \"" + model.name() + "\" has no volume block, bake it with one");
  return {model.data().volume_block->rest, model.data().volume_block->tets};
}

Mat3 edges(const std::array<Vec3, 4>& x) {
  Mat3 m;
  for (int i = 0; i < 3; ++i) m.col(i) = x[static_cast<std::size_t>(i) + 1] - x[0];
  return m;
}

}  // namespace

RestDepth::RestDepth(std::shared_ptr<const ModalModel> model)
    : model_(std::move(model)), locator_(rest_mesh(*model_)) {}

void RestDepthRule::bind(const RestDepth& rest, DeformedSurface& deformed, const RigidTransform& X_PB) {
  rest_ = &rest, deformed_ = &deformed, X_PB_ = X_PB;
  rest_is_bound_ = false;
}

Vec3 deformed_node(const ModalVolume& volume, std::span<const double> z, const SkinPose* skin, Index node) {
  const auto n = static_cast<std::size_t>(node);
  if (skin != nullptr) {
    Vec3 u = Vec3::Zero();
    for (std::size_t i = 0; i < z.size(); ++i)
      u += z[i] * volume.basis.shape(node, static_cast<Index>(i)).cast<double>();
    return skin->position(skin->skin().volume[n], volume.rest[n], u);
  }
  Vec3 p = volume.rest[n];
  for (std::size_t i = 0; i < z.size(); ++i) p += z[i] * volume.basis.shape(node, static_cast<Index>(i)).cast<double>();
  return p;
}

// Newton's method on rest + U(rest) z = p, which is linear within each tetrahedron: each step moves to the one that the
// last one points to. Bodies bent so far that this does not end are left to the nearest point.
bool RestDepthRule::carry_back(const Vec3& p_B, const Vec3& first_guess, Place& place) const {
  const ModalVolume& volume = rest_->volume();
  const NarrowTuning& tuning = collision_tuning().narrow;
  place.rest = first_guess;
  Index last = -1;
  for (int step = 0; step < tuning.rest_depth_steps; ++step) {
    const Index tet = rest_->locator().locate(place.rest).tet;
    if (tet == last) return true;
    std::array<Vec3, 4> at_rest, now;
    for (std::size_t i = 0; i < 4; ++i) {
      const Index node = volume.tets[static_cast<std::size_t>(tet)][i];
      at_rest[i] = volume.rest[static_cast<std::size_t>(node)],
      now[i] = deformed_node(volume, deformed_->amplitudes(), deformed_->skin(), node);
    }
    const Mat3 inverse = edges(at_rest).inverse();
    place.F = edges(now) * inverse;
    if (!(place.F.determinant() > tuning.least_stretch))
      return false;  // flat or inside out: nothing can be carried back
    place.rest = at_rest[0] + place.F.inverse() * (p_B - now[0]);
    last = tet;
  }
  return false;
}

void RestDepthRule::bind_rest(PairSurface& surface) {
  if (rest_is_bound_) return;
  const CollisionSurface& mesh = surface.surface();
  zeros_.assign(static_cast<std::size_t>(mesh.modes()), 0.0);
  // Not owned: the deformed surface that is bound to it outlives the query.
  at_rest_.bind(std::shared_ptr<const CollisionSurface>(std::shared_ptr<void>(), &mesh), zeros_);
  rest_surface_.bind(at_rest_, {}, surface.tolerance());
  rest_is_bound_ = true;
}

// The material point at p, and what of the rest surface is nearest to it. @param weight of the triangle's corners:
// where to begin @return false: there is none
bool RestDepthRule::find_at_rest(PairSurface& surface, const Vec3& p, Index triangle,
                                 const std::array<double, 3>& weight, Place& place, PairSurface::Nearest& rest) {
  bind_rest(surface);
  const CollisionSurface& mesh = surface.surface();
  Vec3 guess = Vec3::Zero();
  for (std::size_t c = 0; c < 3; ++c) guess += weight[c] * mesh.rest(mesh.triangle(triangle)[c]);
  if (!carry_back(X_PB_.inverse() * p, guess, place)) return false;
  rest = rest_surface_.nearest(place.rest,
                               rest_surface_.distance_from(triangle, place.rest) + rest_surface_.directionless());
  return true;
}

// By the nearest point of the rest surface, carried forward.
void RestDepthRule::lead_out(PairSurface& surface, const Place& place, const PairSurface::Nearest& rest,
                             Exit& exit) const {
  SurfaceFoot foot = rest.foot;
  foot.point.setZero();
  for (std::size_t c = 0; c < 3; ++c) foot.point += foot.weight[c] * surface.face(rest.triangle).x[c];
  exit.at = surface.at_foot(rest.triangle, foot);
  const Vec3 N = rest.distance > surface.directionless() ? Vec3(rest.foot.point - place.rest) : rest.outward;
  exit.normal = X_PB_.q * (place.F.inverse().transpose() * N).normalized();
}

bool RestDepthRule::exit(PairSurface& surface, const Vec3& p, const PairSurface::Nearest& nearest, Exit& exit) {
  Place place;
  PairSurface::Nearest rest;
  if (!find_at_rest(surface, p, nearest.triangle, nearest.foot.weight, place, rest)) return false;
  if (!rest.inside || rest.distance <= surface.directionless()) return false;
  lead_out(surface, place, rest, exit);
  return exit.normal.dot(p - exit.at.point) < 0.0;
}

bool RestDepthRule::exit_of(Index v, PairSurface& surface, const FeatureSide& near, Exit& exit) {
  Place place;
  PairSurface::Nearest rest;
  if (!find_at_rest(surface, surface.vertex(v), near.triangle, near.weight, place, rest)) return false;
  const Triangle& corners = surface.surface().triangle(rest.triangle);
  if (!rest.inside || std::find(corners.begin(), corners.end(), v) != corners.end()) return false;  // v itself
  lead_out(surface, place, rest, exit);
  return exit.normal.dot(surface.vertex(v) - exit.at.point) <= 0.0;
}

}  // namespace limber::internal
