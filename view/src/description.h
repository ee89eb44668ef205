/// @file description.h
/// Description of a scene for the page.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "limber/scene/scene_file.h"
#include "limber/scene/scene_model.h"
#include "limber/view/page_world.h"

namespace limber::internal {

struct PageBody {
  BodyId id{};
  int model = 0;  ///< in PageWorld::models()
  std::string name{};
  bool dropped = false;  ///< by a person
};

/// JSON in ASCII; what is no UTF-8 in names is replaced.
std::string describe(const Scene& scene, const SceneModels& models, std::span<const PageModel> shown,
                     std::span<const PageBody> bodies, const PageSettings& settings);

}  // namespace limber::internal
