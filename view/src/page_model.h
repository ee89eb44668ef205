/// @file page_model.h
/// A model as a vertex shader takes it.
#pragma once

#include "limber/model/modal_model.h"
#include "limber/view/page_world.h"

namespace limber::internal {

/// @param surface of the model: what is drawn, or what touches. @param extent of it
PageModel page_model(const ModalModel& model, const ModalSurface& surface, const SurfaceExtent& extent);

/// With the first modes alone, and other damping. Residual compliance answers for those left out.
/// @param stiffness factor on Young's modulus; infinite: without modes
std::shared_ptr<const ModalModel> with_settings(const std::shared_ptr<const ModalModel>& model,
                                                const PageSettings& settings, double stiffness);
/// @param stiffness the same; infinite: as it was
std::shared_ptr<const SoundModes> as_stiff(const std::shared_ptr<const SoundModes>& sound, double stiffness);

}  // namespace limber::internal
