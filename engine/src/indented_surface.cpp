#include "indented_surface.h"

#include <algorithm>

#include "limber/mesh/surface_locator.h"

namespace limber::internal {

IndentedSurface::IndentedSurface(const ModalModel& model) : model_(&model) {
  const auto vertices = static_cast<std::size_t>(model.collision().vertices());
  forces_.resize(vertices, Vec3::Zero());
  moved_.resize(vertices);
  if (model.data().collision) find_places();
}

void IndentedSurface::find_places() {
  const ModalSurface& touching = model_->collision();
  std::vector<Vec3> rest;
  for (const Vec3f& x : touching.rest) rest.push_back(x.cast<double>());
  const SurfaceLocator locator(rest, touching.triangles);
  for (const Vec3f& x : model_->render().rest) {
    const SurfaceLocation found = locator.nearest(x.cast<double>());
    Place place{touching.triangles[static_cast<std::size_t>(found.triangle)], {}};
    std::ranges::transform(found.weight, place.weight.begin(), [](double w) { return static_cast<float>(w); });
    places_.push_back(place);
  }
}

void IndentedSurface::displacements(std::span<const IndentationLoad> before, std::span<const IndentationLoad> now,
                                    double s, std::span<float> d) {
  add_forces(before, 1.0 - s);
  add_forces(now, s);
  move_vertices();
  for (std::size_t v = 0; v < d.size() / 3; ++v) {
    Eigen::Map<Vec3f> out(&d[3 * v]);
    if (places_.empty()) {
      out = moved_[v];
      continue;
    }
    const Place& at = places_[v];
    out.setZero();
    for (std::size_t i = 0; i < 3; ++i) out += at.weight[i] * moved_[static_cast<std::size_t>(at.vertex[i])];
  }
}

void IndentedSurface::add_forces(std::span<const IndentationLoad> loads, double part) {
  if (part == 0.0) return;
  for (const IndentationLoad& load : loads) {
    Vec3& force = forces_[static_cast<std::size_t>(load.vertex)];
    if (force.isZero(0.0)) pressed_.push_back(load.vertex);
    force += part * load.force;
  }
  std::ranges::sort(pressed_);  // a force may have been taken away and come again
  pressed_.erase(std::unique(pressed_.begin(), pressed_.end()), pressed_.end());
}

/// Under the forces gathered, which are then forgotten.
void IndentedSurface::move_vertices() {
  const ResidualCompliance& compliance = *model_->data().residual_compliance;
  std::ranges::fill(moved_, Vec3f(Vec3f::Zero()));
  const auto move = [&](Index vertex, Index by) {
    moved_[static_cast<std::size_t>(vertex)] +=
        Vec3f((compliance.block(vertex, by) * forces_[static_cast<std::size_t>(by)]).cast<float>());
  };
  for (const Index by : pressed_) {
    if (compliance.form() == ResidualCompliance::Form::kLocal) {
      move(by, by);
      continue;
    }
    for (Index vertex = 0; vertex < compliance.vertices(); ++vertex) move(vertex, by);
  }
  for (const Index by : pressed_) forces_[static_cast<std::size_t>(by)].setZero();
  pressed_.clear();
}

IndentedSurface::Place IndentedSurface::place(Index render_vertex) const {
  if (!places_.empty()) return places_[static_cast<std::size_t>(render_vertex)];
  return {{render_vertex, render_vertex, render_vertex}, {1.0f, 0.0f, 0.0f}};
}

Vec3 IndentedSurface::displacement(std::span<const IndentationLoad> loads, Index vertex) const {
  Vec3 u = Vec3::Zero();
  for (const IndentationLoad& load : loads)
    u += model_->data().residual_compliance->block(vertex, load.vertex) * load.force;
  return u;
}

Vec3 IndentedSurface::displacement(std::span<const IndentationLoad> loads, const SurfacePoint& at) const {
  const bool drawn = at.surface == SurfacePoint::Surface::kRender;
  const ModalSurface& surface = drawn ? model_->render() : model_->collision();
  const Triangle& t = surface.triangles[static_cast<std::size_t>(at.triangle)];
  Vec3 u = Vec3::Zero();
  for (std::size_t i = 0; i < 3; ++i) {
    if (!drawn) {
      u += at.weight[i] * displacement(loads, t[i]);
      continue;
    }
    const Place p = place(t[i]);
    for (std::size_t j = 0; j < 3; ++j)
      u += at.weight[i] * static_cast<double>(p.weight[j]) * displacement(loads, p.vertex[j]);
  }
  return u;
}

}  // namespace limber::internal
