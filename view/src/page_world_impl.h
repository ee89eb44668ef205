/// @file page_world_impl.h
/// What stands behind PageWorld, for the files that hold its functions.
#pragma once

#include <algorithm>
#include <array>
#include <map>
#include <optional>

#include "description.h"
#include "limber/core/error.h"
#include "limber/core/stage_times.h"
#include "limber/scene/scene_player.h"
#include "limber/view/page_world.h"
#include "page_history.h"
#include "page_joints.h"
#include "page_sound.h"

namespace limber {

struct PageWorld::Impl {
  explicit Impl(const std::filesystem::path& path)
      : told(read_scene(path)), baked(load_models(told, {.keep = {LeftOut::kVertexRows}})) {
    settings.gravity = told.gravity;
    settings.step = told.step;
    settings.substeps = told.substeps;
    settings.solver = told.contacts.solver;
    if (told.contacts.options) settings.friction = told.contacts.options->friction;
  }

  void start();
  void list_kinds();
  World& world() { return player->world(); }
  const World& world() const { return player->world(); }
  BodyId id(int body) const { return bodies[static_cast<std::size_t>(body)].id; }
  /// −1: a static body.
  int number(BodyId id) const {
    const auto body = std::find_if(bodies.begin(), bodies.end(), [&](const auto& b) { return b.id == id; });
    return body == bodies.end() ? -1 : static_cast<int>(body - bodies.begin());
  }
  std::size_t dropped() const {
    return static_cast<std::size_t>(
        std::count_if(bodies.begin(), bodies.end(), [](const internal::PageBody& b) { return b.dropped; }));
  }
  std::vector<int> dropped_models() const {
    return {drops.begin(), drops.begin() + static_cast<std::ptrdiff_t>(dropped())};
  }
  void check_model(int model, const char* function) const {
    if (model < 0 || static_cast<std::size_t>(model) >= kinds.size())
      throw InvalidArgument(std::string("PageWorld::") + function + ": model " + std::to_string(model) +
                            ", expected 0 to " + std::to_string(kinds.size() - 1));
  }
  void add_dropped(std::size_t count);
  void forget_removed();

  const Scene told;
  const SceneModels baked;  // as they come from the assets
  PageSettings settings;
  Scene scene;         // with the settings
  SceneModels models;  // the same
  std::vector<std::shared_ptr<const ModalModel>> kinds;
  std::vector<PageModel> shown;
  StageTimes times;
  std::optional<ScenePlayer> player;
  std::vector<internal::PageBody> bodies;
  std::vector<int> drops;  // model of each body dropped so far, in this history
  internal::Hands hands;
  internal::PageHistory history;
  std::optional<internal::PageJoints> joints;
  internal::PageSound sound;
  struct {
    std::vector<float> frame;
    std::array<std::vector<float>, 2> bent;
    std::vector<double> numbers, joint_frames, joint_wishes, contacts, sensor_counts, ray_places, amplitudes,
        stage_seconds = std::vector<double>(kStages, 0.0);
    std::map<int, PageModel> touching;
  } told_to_page;  // what spans of the page point into
};

}  // namespace limber
