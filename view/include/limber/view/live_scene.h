/// @file limber/view/live_scene.h
/// A scene that somebody reaches into while it goes on, through its World: what the npm package's limber/scene is made
/// of, and the page of limber-view by that.
///
///   LiveScene scene("falls.json");
///   World world(scene.world_options());  // gone before the scene is
///   scene.begin(world);
///   scene.step();
///
/// Numbers for drawing are in single precision, everything else in double.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "limber/engine/world.h"
#include "limber/scene/blows.h"
#include "limber/scene/scene_file.h"

namespace limber {

/// What may be other than the scene says.
struct LiveSettings {
  Vec3 gravity = {0.0, 0.0, -9.80665};           ///< m/s²
  double step = 1.0 / 60.0;                      ///< s; > 0
  int substeps = 1;                              ///< ≥ 1
  Index modes = 256;                             ///< of each model at most; ≥ 0
  double damping = 1.0;                          ///< factor on the decay of every mode; ≥ 0
  double friction = 0.5;                         ///< ≥ 0, where the scene has contact
  ContactSolver solver = kDefaultContactSolver;  ///< not where the scene has one of [H03]'s rules
  double joint_friction = 1.0;                   ///< factor on the friction in joints; ≥ 0
  /// By model a factor on Young's modulus; > 0, infinite: rigid. Damping ratios stay. Models beyond the end: 1.
  std::vector<double> stiffness{};
  void validate() const;  ///< @throws InvalidArgument naming the field and its value
};

/// A body's surface in its own frame.
struct BentSurface {
  Index modes = 0;                                ///< by so many of the first; 0: it is at rest, and nothing follows
  std::span<const float> positions{}, normals{};  ///< 3 V each
};

/// Over all bodies that move.
struct LiveSums {
  BodyEnergy energy{};
  std::size_t asleep = 0;    ///< bodies
  std::size_t pressing = 0;  ///< contacts
};

class LiveScene {
 public:
  struct Body {
    BodyId id{};
    std::size_t model = 0;
    std::string name{};
    bool added = false;  ///< by add_body()
  };

  /// As it stands before begin(): with models(), and bodies where they are placed.
  /// @throws InputError as read_scene() and load_models()
  explicit LiveScene(const std::filesystem::path& scene);
  ~LiveScene();

  const LiveSettings& settings() const;
  /// Models and bodies as they begin with these settings. The world of before is gone.
  /// @throws InvalidArgument for numbers out of range, and then changes nothing
  void prepare(const LiveSettings& settings);
  WorldOptions world_options() const;
  /// Bodies bend by their modes, without a modal skin.
  /// @param world empty, with world_options(); gone before the next prepare(), and before the scene is
  void begin(World& world);

  /// Contents of the scene as JSON: settings, models, bodies, statics and sensors with their triangles, joints with
  /// what hangs on them. Names are text of the scene and its assets: nothing that may become markup.
  std::string description() const;
  std::span<const std::shared_ptr<const ModalModel>> models() const;
  std::span<const Body> bodies() const;
  // Of the world, in the order of the scene.
  std::span<const BodyId> statics() const;
  std::span<const BodyId> sensors() const;
  std::span<const JointId> joints() const;

  /// Another body of a model, at rest.
  BodyId add_body(std::size_t model, const Vec3& position, std::string name);
  /// What the scene lets act in this step, and World::step().
  void step();
  std::int64_t steps_taken() const;
  /// The state of the world and what the scene has begun, as World::save_state() and restore_state().
  void save_state(std::vector<std::byte>& state) const;
  void restore_state(std::span<const std::byte> state);

  // To draw and to tell, of all bodies at once; spans are valid until the next call.
  /// Per body its pose (position, then quaternion w, x, y, z) and its amplitudes.
  std::span<const float> frame();
  /// A body's surface, drawn or touching, by as few modes as put no vertex off by more than the tolerance, m
  /// (drawn_modes()).
  BentSurface bent(std::size_t body, double tolerance, bool touching = false);
  LiveSums sums() const;
  /// What pressed in the last step: position (world, m) and mean force on the first body (world, N), 3 each.
  std::span<const double> contacts();

  /// Adds the state as it is to what recording() makes an animated GLB of (limber/scene/recording.h), and forgets. A
  /// body that was added on the way waits at its place.
  void record();
  std::string recording();

  // Sound, for a synthesizer elsewhere (limber/sound/synthesizer.h).
  /// Null: one does not hear the model.
  const SoundingBody* sounding(std::size_t model);
  /// Whether blows are noted from now on.
  void listen(bool on);
  static constexpr std::size_t kBlowNumbers = 15;
  /// Notes a blow by somebody. @param at, impulse world, m, N·s @param contact_time s: Blow::contact_time
  void note_blow(std::size_t body, const Vec3& at, const Vec3& impulse, double contact_time);
  /// Blows on bodies that have a sound since the last call: body, vertices and weights (3 each), impulse on it (3, body
  /// frame, N·s), contact time (s), delay after the step's start (s), place (3, world, m).
  std::span<const double> take_blows();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limber
