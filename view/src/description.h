/// @file description.h
/// Description of a live scene.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "limber/scene/scene_file.h"
#include "limber/scene/scene_model.h"
#include "limber/view/live_scene.h"
#include "live_sound.h"

namespace limber::internal {

/// JSON in ASCII; what is no UTF-8 in names is replaced.
std::string describe(const Scene& scene, const SceneModels& models,
                     std::span<const std::shared_ptr<const ModalModel>> kinds, const LiveSound& sound,
                     std::span<const LiveScene::Body> bodies, const LiveSettings& settings);

}  // namespace limber::internal
