#include "page_model.h"

#include <algorithm>
#include <numeric>

#include "limber/scene/scene_model.h"

namespace limber::internal {
namespace {

/// Twice each triangle's area along its normal, summed at its vertices.
std::vector<Vec3f> summed_normals(const ModalSurface& surface) {
  std::vector<Vec3f> normals(surface.rest.size(), Vec3f::Zero());
  for (const Triangle& t : surface.triangles) {
    const auto at = [&](std::size_t corner) { return surface.rest[static_cast<std::size_t>(t[corner])]; };
    const Vec3f n = (at(1) - at(0)).cross(at(2) - at(0));
    for (const Index v : t) normals[static_cast<std::size_t>(v)] += n;
  }
  return normals;
}

/// How these change per unit amplitude of a mode, at rest.
std::vector<Vec3f> normal_changes(const ModalSurface& surface, Index mode) {
  std::vector<Vec3f> changes(surface.rest.size(), Vec3f::Zero());
  for (const Triangle& t : surface.triangles) {
    const auto at = [&](std::size_t corner) { return surface.rest[static_cast<std::size_t>(t[corner])]; };
    const auto u = [&](std::size_t corner) { return surface.basis.shape(t[corner], mode); };
    const Vec3f change = (u(1) - u(0)).cross(at(2) - at(0)) + (at(1) - at(0)).cross(u(2) - u(0));
    for (const Index v : t) changes[static_cast<std::size_t>(v)] += change;
  }
  return changes;
}

}  // namespace

PageModel page_model(const ModalModel& model, const ModalSurface& surface) {
  constexpr float kShown = 0.1f;  // of the model's size
  PageModel page{.name = model.name(), .mass = model.data().mass};
  const std::vector<Vec3f> normals = summed_normals(surface);
  std::vector<float> length;
  float size = 0.0f;
  for (std::size_t v = 0; v < surface.rest.size(); ++v) {
    size = std::max(size, surface.rest[v].norm());
    length.push_back(std::max(normals[v].norm(), 1e-30f));
    for (int i = 0; i < 3; ++i) page.rest.push_back(surface.rest[v][i]);
    for (int i = 0; i < 3; ++i) page.normals.push_back(normals[v][i] / length.back());
  }
  for (const Triangle& t : surface.triangles)
    for (const Index v : t) page.triangles.push_back(static_cast<std::uint32_t>(v));
  page.shapes.reserve(8 * surface.rest.size() * static_cast<std::size_t>(model.modes()));
  for (Index mode = 0; mode < model.modes(); ++mode) {
    const std::vector<Vec3f> changes = normal_changes(surface, mode);
    float largest = 0.0f;
    for (std::size_t v = 0; v < surface.rest.size(); ++v) {
      const Vec3f u = surface.basis.shape(static_cast<Index>(v), mode), n = changes[v] / length[v];
      largest = std::max(largest, u.norm());
      page.shapes.insert(page.shapes.end(), {u.x(), u.y(), u.z(), 0.0f, n.x(), n.y(), n.z(), 0.0f});
    }
    page.frequencies.push_back(model.frequency_hz(mode));
    page.visible_amplitudes.push_back(largest > 0.0f ? static_cast<double>(kShown * size / largest) : 0.0);
  }
  return page;
}

std::shared_ptr<const ModalModel> with_settings(const std::shared_ptr<const ModalModel>& model,
                                                const PageSettings& settings) {
  if (settings.modes >= model->modes() && settings.damping == 1.0) return model;
  std::vector<Index> kept(static_cast<std::size_t>(std::min(settings.modes, model->modes())));
  std::iota(kept.begin(), kept.end(), Index{0});
  return reduce_model(*model, kept, settings.damping);
}

}  // namespace limber::internal
