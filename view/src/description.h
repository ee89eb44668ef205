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

/// Body of a joint's frame: part a, or b where a is the world, which moves rigidly here.
struct JointPlace {
  BodyId on{};  ///< none: the world
  Vec3 origin = Vec3::Zero(), axis = Vec3::UnitX();
};

/// As bodies stand now.
std::vector<JointPlace> joint_places(const Scene& scene, const World& world, std::span<const PageBody> bodies);

/// JSON in ASCII; what is no UTF-8 in names is replaced.
std::string describe(const Scene& scene, const SceneModels& models, std::span<const PageModel> shown,
                     std::span<const PageBody> bodies, const PageSettings& settings);

}  // namespace limber::internal
