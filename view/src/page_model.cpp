#include "page_model.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "limber/dynamics/reconstruct.h"
#include "limber/scene/scene_model.h"

namespace limber::internal {

PageModel page_model(const ModalModel& model, const ModalSurface& surface, const SurfaceExtent& extent) {
  constexpr double kShown = 0.1;  // of the model's size
  PageModel page{.name = model.name(), .mass = model.data().mass};
  for (const Vec3f& at_rest : surface.rest) page.rest.insert(page.rest.end(), at_rest.begin(), at_rest.end());
  for (const Triangle& t : surface.triangles)
    for (const Index v : t) page.triangles.push_back(static_cast<std::uint32_t>(v));
  page.normals.resize(page.rest.size());
  vertex_normals(surface.triangles, page.rest, page.normals);
  for (Index mode = 0; mode < model.modes(); ++mode) {
    const double largest = extent.shape[static_cast<std::size_t>(mode)];
    page.frequencies.push_back(model.frequency_hz(mode));
    page.visible_amplitudes.push_back(largest > 0.0 ? kShown * extent.radius / largest : 0.0);
  }
  return page;
}

std::shared_ptr<const ModalModel> with_settings(const std::shared_ptr<const ModalModel>& model,
                                                const PageSettings& settings, double stiffness) {
  if (settings.modes >= model->modes() && settings.damping == 1.0 && stiffness == 1.0) return model;
  if (std::isinf(stiffness)) return reduce_model(*model, {});
  std::vector<Index> kept(static_cast<std::size_t>(std::min(settings.modes, model->modes())));
  std::iota(kept.begin(), kept.end(), Index{0});
  return reduce_model(*model, kept, settings.damping, stiffness);
}

std::shared_ptr<const SoundModes> as_stiff(const std::shared_ptr<const SoundModes>& sound, double stiffness) {
  if (stiffness == 1.0 || std::isinf(stiffness)) return sound;
  SoundModes out = *sound;
  for (double& eigenvalue : out.eigenvalues) eigenvalue *= stiffness;
  for (double& decay : out.decays) decay *= std::sqrt(stiffness);
  out.contact_modulus *= stiffness;
  return std::make_shared<const SoundModes>(std::move(out));
}

}  // namespace limber::internal
