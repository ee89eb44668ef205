/// @file limber/scene/scene_player.h
/// A scene as a world that goes on step by step, with what the scene says acting at its times; for programs that show a
/// scene and let a person reach into it.
///
///   ScenePlayer player(scene, load_models(scene));
///   while (drawing) {
///     player.step();
///     player.world().body(player.bodies()[0]);
///   }
///
/// run_scene() plays a scene from start to end with this.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "limber/core/jobs.h"
#include "limber/engine/world.h"
#include "limber/scene/scene_file.h"
#include "limber/scene/scene_model.h"

namespace limber {

/// A load that acted.
struct LoadReport {
  std::string body;
  std::int64_t step = 0;      ///< 0-based step in which it began
  double delay = 0.0;         ///< s after that step's start (strikes)
  Vec3 point = Vec3::Zero();  ///< where it acted, world, m
  std::size_t load = 0;       ///< which of Scene::strikes, or of Scene::forces
  std::size_t number = 0;     ///< of the body in Scene::bodies
};

/// Record of a handle.
struct HandleReport {
  std::string body;
  std::int64_t step = 0;       ///< 0-based step in which it took hold
  Vec3 point = Vec3::Zero();   ///< where it took hold, world, m
  double largest_error = 0.0;  ///< distance from the target along the held directions at the end of a step, m
  Vec3 force = Vec3::Zero();   ///< on the body in the last step that it held, world, N
  double largest_force = 0.0;  ///< N
};

/// How a body starts: where a first pose key at time 0 says, if it has one.
BodyPlacement start_of(const SceneBody& body);
/// Those of a scene's world.
WorldOptions world_options(const Scene& scene);

class ScenePlayer {
 public:
  /// Contacts are found by Scene::finder, where the scene has contact.
  /// @param scene, models outlive this
  /// @param steps after which nothing of the scene acts any more; its own number, or another
  /// @throws InputError naming the place in the scene file: a motion for a body without fixed nodes. InvalidArgument
  /// where `models` are not those of the scene
  ScenePlayer(const Scene& scene, const SceneModels& models, std::int64_t steps, Jobs& jobs = serial_jobs());
  /// Plays in a world of the caller's, which is empty, has world_options() and is gone before the player is.
  ScenePlayer(const Scene& scene, const SceneModels& models, std::int64_t steps, World& world);
  ~ScenePlayer();
  ScenePlayer(ScenePlayer&&) noexcept;
  ScenePlayer& operator=(ScenePlayer&&) noexcept;

  World& world();
  const World& world() const;
  std::span<const BodyId> bodies() const;   ///< per Scene::bodies
  std::span<const BodyId> statics() const;  ///< per Scene::statics
  std::span<const BodyId> sensors() const;  ///< per Scene::sensors
  std::span<const JointId> joints() const;  ///< per Scene::joints
  std::int64_t steps_taken() const;

  /// Lets act what the scene wants in the coming step; then World::step() of world(); then end_step().
  /// @throws InputError as run_scene()
  void begin_step();
  void end_step();
  /// All three.
  void step();

  /// Loads and handles reached so far, in the order of the scene's lists (then of the bodies); filled in as they act.
  std::span<const LoadReport> strikes() const;
  std::span<const LoadReport> forces() const;
  std::span<const HandleReport> handles() const;

  /// The state of the world and what the scene has begun, as World::save_state(). Between steps.
  void save_state(std::vector<std::byte>& state) const;
  /// @throws InvalidArgument as World::restore_state(), and then changes nothing
  void restore_state(std::span<const std::byte> state);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limber
