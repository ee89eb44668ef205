/// @file limber/view/page_world.h
/// A scene as the page drives it: stepped, dragged, poked, pinned, set anew and taken back. The page compiles this to
/// WebAssembly (view/engine); it works natively too.
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

/// Settings for a person. The first three act at once, the others when the scene starts anew.
struct PageSettings {
  Vec3 gravity = {0.0, 0.0, -9.80665};           ///< m/s²
  double drag_frequency = 3.0;                   ///< Hz, of a body's mass on the spring by which it is dragged; > 0
  double poke_speed = 1.0;                       ///< m/s, that a poke gives a body's mass; ≥ 0
  double step = 1.0 / 60.0;                      ///< s; > 0
  int substeps = 1;                              ///< ≥ 1
  Index modes = 256;                             ///< of each model at most; ≥ 0
  double damping = 1.0;                          ///< factor on the decay of every mode; ≥ 0
  double friction = 0.5;                         ///< ≥ 0, where the scene has contact
  ContactSolver solver = kDefaultContactSolver;  ///< not where the scene has one of [H03]'s rules
  double joint_friction = 1.0;                   ///< factor on the friction in joints; ≥ 0
  /// By model a factor on Young's modulus; > 0, infinite: rigid. Damping ratios stay. Models beyond the end: 1.
  std::vector<double> stiffness{};
};

/// A model once for all its bodies.
struct PageModel {
  std::string name{};
  double mass = 0.0;                       ///< kg
  std::vector<float> rest{}, normals{};    ///< 3 V each: of the rest shape, m; unit
  std::vector<std::uint32_t> triangles{};  ///< 3 T
  std::vector<double> frequencies{};       ///< Hz, k
  /// The amplitude at which a mode moves some vertex by a tenth of the model's size, k.
  std::vector<double> visible_amplitudes{};
  std::shared_ptr<const SoundModes> sound{};  ///< null: one does not hear it
};

/// A surface as it is drawn, in its body's frame.
struct PageSurface {
  Index modes = 0;                                ///< by so many of the first; 0: it is at rest, and nothing follows
  std::span<const float> positions{}, normals{};  ///< 3 V each
};

/// The first point of any body that moves, as contact has it, which a ray meets within 10 km: World::cast_ray().
struct PageHit {
  int body = -1;  ///< −1: none
  SurfacePoint at{};
  Vec3 point = Vec3::Zero();  ///< world
  double distance = 0.0;      ///< m
};

class PageWorld {
 public:
  /// @param begins false: bodies may be looked at as they are placed, by description(), models(), frame() and bent(),
  /// until begin() makes the world, which takes longer @throws InputError as read_scene() and load_models()
  explicit PageWorld(const std::filesystem::path& scene, bool begins = true);
  void begin();
  ~PageWorld();

  /// Contents of the scene as JSON: settings, models, bodies (model, name), statics and sensors with their triangles,
  /// joints. Names are text of the scene and its assets: nothing that may become markup.
  std::string description() const;
  const std::vector<PageModel>& models() const;
  /// The surface by which bodies of a model touch, unless they wear a shape; that of models() where there is no other.
  const PageModel& touching(int model);
  /// A body's surface, drawn or touching, by as few modes as put no vertex off by more than the tolerance, m
  /// (drawn_modes()).
  PageSurface bent(int body, double tolerance, bool touching = false);
  const World& world() const;

  PageSettings settings() const;
  /// Gravity and hands at once.
  void set_live(const PageSettings& settings);
  /// Starts the scene anew. @throws InvalidArgument for numbers out of range, and then changes nothing
  void restart(const PageSettings& settings);
  /// PageSettings::stiffness of a model. The clock begins at 0; bodies keep their places and speeds, and their bending
  /// unless the model becomes rigid or was. Hands and pins let go; joints are led on.
  /// @throws InvalidArgument for a model that there is not, or a number out of range, and then changes nothing
  void set_stiffness(int model, double factor);

  void step();
  std::int64_t steps_taken() const;
  std::uint64_t state_hash() const;

  /// Per body its pose (position, then quaternion w, x, y, z) and its amplitudes; bodies in order.
  std::span<const float> frame();
  /// time (s), kinetic energy of the frames, of the modes, elastic, potential (J), bodies asleep, contacts that press,
  /// rows, iterations, solved (0 or 1, ConstraintReport::solved).
  std::span<const double> numbers();
  /// Times of the stages of the last step, s, in the order of Stage (limber/core/stage_times.h).
  std::span<const double> stage_seconds() const;
  /// Positions of a body as World::reconstruct() makes them: 3 V floats, world.
  void reconstruct(int body, float* positions) const;
  /// Per joint: origin and x axis in the world, coordinates (3).
  std::span<const double> joint_frames();

  /// What pressed in the last step: position (world, m) and mean force on the first body (world, N), 3 each.
  std::span<const double> contacts();
  /// Per sensor how many bodies are in it.
  std::span<const double> sensor_counts();

  // Hands.
  /// All that a ray meets, static bodies too, the first place on each, by distance: World::cast_ray(). Per place the
  /// body (−1: one that does not move), position and normal (3 each, world).
  std::span<const double> ray_places(const Vec3& from, const Vec3& direction);
  PageHit cast_ray(const Vec3& from, const Vec3& direction) const;
  /// Takes hold of a point softly; one at a time. @return whether there was one to take
  bool grab(const PageHit& hit);
  void drag_to(const Vec3& target);
  void let_go();
  bool holds() const;
  /// Force on the body, N, the point held and its target, world, m.
  HandleView hand() const;
  Vec3 held_point() const;
  /// Holds a point where it is for good, or lets all such points go.
  void pin(const PageHit& hit);
  void unpin();
  int pins() const;
  /// @param contact_time s, for the ear alone: Blow::contact_time
  void poke(const PageHit& hit, const Vec3& direction, double contact_time = 1e-3);
  /// A coordinate of a joint (joint_constraint.h) goes to a place, m or rad, and is held there as by a spring; or goes
  /// on at a speed, m/s or rad/s; or is left to what the scene has acting on it.
  /// @throws InvalidArgument for a joint or coordinate that there is not
  void lead_joint(int joint, int coordinate, double place);
  void run_joint(int joint, int coordinate, double speed);
  void leave_joint(int joint, int coordinate);
  /// Per joint and coordinate (3) where it is led, and its speed; NaN: nowhere, none.
  std::span<const double> joint_wishes();
  /// Another body of a model.
  void drop(int model, const Vec3& position);
  /// Shows a mode by itself: all others of the body are at rest.
  void show_mode(int body, Index mode, double amplitude);

  // Sound, for a synthesizer elsewhere (limber/sound/synthesizer.h).
  /// The body that models()[model].sound is of. @throws InvalidArgument where there is none
  const SoundingBody& sounding(int model);
  /// Pa at one metre that no poke at 1 m/s exceeds, however a body of the model is turned.
  double loudness(int model, double contact_time);
  /// Whether blows are noted from now on.
  void listen(bool on);
  static constexpr std::size_t kBlowNumbers = 15;
  /// Blows on bodies that have a sound since the last call: body, vertices and weights (3 each), impulse on it (3, body
  /// frame, N·s), contact time (s), delay after the step's start (s), place (3, world, m).
  std::span<const double> take_blows();

  // History: states at steps taken, the oldest thinned out when there are too many.
  void keep();
  int kept() const;
  std::int64_t kept_step(int key) const;
  /// Back, or forth again, to a kept state, to the bit: a hand that held something then holds it again.
  void go_to(int key);
  /// All that is to be known to go on from here, settings and hands too, for the same scene in the same build.
  std::vector<std::byte> saved() const;
  /// Goes on from there, to the bit; what was kept before is forgotten.
  /// @throws InvalidArgument for bytes that are damaged or of another scene, which then starts anew
  void restore(std::span<const std::byte> saved);
  /// The kept states, from the first to the last, as an animated GLB (limber/scene/recording.h). A body that
  /// was dropped on the way waits at its place. The world stays where it is.
  std::string recording();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limber
