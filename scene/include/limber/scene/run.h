/// @file limber/scene/run.h
/// Plays a scene: builds a world, lets every load act at its time, and keeps the states at regular times.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "limber/core/jobs.h"
#include "limber/engine/world.h"
#include "limber/scene/blows.h"
#include "limber/scene/scene_file.h"
#include "limber/scene/scene_model.h"
#include "limber/scene/scene_player.h"

namespace limber {

struct RunOptions {
  std::int64_t steps = -1;  ///< −1: as the scene says. Loads after the end do not act.
  /// Hz, keys kept per second of the simulation: every n-th step, n = max(1, round(1 / (key_rate · step))), the start
  /// and the end always. 0: keys are kept at the start and the end only. ≥ 0.
  double key_rate = 60.0;
  bool reconstruct = false;                         ///< also reconstruct every body at every key, to time it
  bool reconstruct_every_step = false;              ///< the same after every step
  bool keep_contacts = false;                       ///< fill Trajectory::contacts
  bool keep_blows = false;                          ///< fill Trajectory::blows
  std::function<void(double fraction)> progress{};  ///< called now and then; may be empty
  Jobs* jobs = nullptr;                             ///< null: serial
  void validate() const;                            ///< @throws InvalidArgument naming the field and its value
};

/// The states of one body at the keys of a trajectory. k modes; array i holds key i.
struct BodyTrack {
  std::string name;
  std::shared_ptr<const ModalModel> model;
  std::vector<RigidTransform> poses;     ///< X_WB
  std::vector<Vec3> angular_velocities;  ///< world, rad/s
  std::vector<double> amplitudes;        ///< z, kg^½·m; k per key
  std::vector<double> rates;             ///< ż, kg^½·m/s; k per key
  std::vector<BodyEnergy> energies;      ///< J
  bool modal_skin = false;               ///< bends by its model's modal skin

  std::span<const double> amplitudes_at(std::size_t key) const;
  std::span<const double> rates_at(std::size_t key) const;
};

/// A shape of a scene that never moves.
struct StaticShape {
  std::string name;
  std::shared_ptr<const Shape> shape;
  RigidTransform pose{};
};

/// A contact that pressed, or ceased to, in a step.
struct ContactRecord {
  double time = 0.0;  ///< s, of the step's end
  /// Numbers of bodies in Trajectory::bodies, and from bodies.size() on in Trajectory::statics; a < b.
  std::size_t a = 0, b = 0;
  ContactPhase phase = ContactPhase::kBegun;
  Vec3 position = Vec3::Zero();  ///< world, m
  Vec3 normal = Vec3::Zero();    ///< world, out of b into a
  Vec3 impulse = Vec3::Zero();   ///< on a over the step, world, N·s
};

/// A body that came into a sensor in a step, or left it.
struct SensorRecord {
  double time = 0.0;       ///< s, of the step's end
  std::size_t sensor = 0;  ///< in Trajectory::sensors
  std::size_t body = 0;    ///< as those of ContactRecord
  bool began = true;       ///< false: left
};

struct Trajectory {
  std::string scene;          ///< name
  double step = 0.0;          ///< s, of the simulation
  double key_interval = 0.0;  ///< s between keys: a multiple of the step (the last interval may be shorter)
  std::vector<double> times;  ///< s, of the keys: ascending from 0, each a whole number of steps
  std::vector<BodyTrack> bodies;
  std::vector<StaticShape> statics;
  std::vector<std::string> sensors;         ///< names
  std::vector<ContactRecord> contacts;      ///< of every step, with RunOptions::keep_contacts
  std::vector<SensorRecord> sensor_events;  ///< of every step
  std::vector<BlowRecord> blows;            ///< by step, with RunOptions::keep_blows

  const std::string& name(std::size_t body) const;  ///< of a body or, from bodies.size() on, of a static shape
};

/// State of a joint at the end, and its largest errors.
struct JointReport {
  std::string a, b;
  JointView view;                                                  ///< as of the last step
  double largest_distance_error = 0.0, largest_angle_error = 0.0;  ///< at the end of a step; m, rad
  double largest_limit_excess = 0.0;  ///< how far a coordinate was beyond its limits at the end of a step, m or rad
};

/// Sums over the constraints of all steps.
struct ConstraintSummary {
  std::int64_t limit_steps = 0;       ///< steps in which some island ended at a limit, and none failed (IslandStatus)
  std::int64_t failed_steps = 0;      ///< steps in which some island failed
  double largest_residual = 0.0;      ///< ConstraintReport::residual of the worst step
  double energy_removed = 0.0;        ///< J; see ConstraintReport
  std::int64_t begun = 0, ended = 0;  ///< contacts
  double largest_impulse = 0.0;       ///< of a contact in a step, N·s
};

struct RunResult {
  Trajectory trajectory;
  std::int64_t steps = 0;
  std::uint64_t state_hash = 0;   ///< World::state_hash() at the end
  std::int64_t asleep = 0;        ///< bodies that sleep at the end
  std::int64_t asleep_steps = 0;  ///< Σ over the steps of the bodies that sleep after it
  /// Loads that acted, in the order of the scene's lists (then of the bodies).
  std::vector<LoadReport> strikes, forces;
  std::vector<HandleReport> handles;  ///< the same
  std::vector<JointReport> joints;    ///< in the order of the scene's list
  ConstraintSummary constraints;
  double energy_before = 0.0, energy_after = 0.0;  ///< total of all bodies at the first and last key, J
  double seconds_advance = 0.0;                    ///< wall clock, World::step() alone
  double seconds_reconstruct = 0.0;                ///< wall clock, with RunOptions::reconstruct
  std::int64_t reconstructed_vertices = 0;         ///< vertices times keys
};

/// Contacts are found by Scene::finder, where the scene has contact.
/// @throws InputError naming the place in the scene file: a triangle or vertex that the surface does not have, a ray
/// that misses, a motion for a body without fixed nodes. InvalidArgument for options.
RunResult run_scene(const Scene& scene, const SceneModels& models, const RunOptions& options = {});

/// Energies as CSV: a row per key and body with time_s, body, kinetic_rigid_J, potential_J, kinetic_modal_J, elastic_J,
/// total_J.
std::string energies_csv(const Trajectory& trajectory);

/// Contacts as CSV: a row per step and contact that pressed in it or ceased to, with time_s, phase (begun, lasting or
/// ended), a, b, x_m, y_m, z_m, normal_x, normal_y, normal_z, impulse_x_Ns, impulse_y_Ns, impulse_z_Ns (on a).
std::string contacts_csv(const Trajectory& trajectory);

/// Who came into a scene's sensors and left them, as CSV: a row per event with time_s, event (entered or left), sensor,
/// body.
std::string sensors_csv(const Trajectory& trajectory);

/// Energy of every mode, ½(ż² + λz²), as CSV: a row per key; a column time_s, one "BODY elastic+kinetic_J" with the sum
/// over the body's modes, and one "BODY modeNN FREQUENCYHz_J" per mode.
std::string mode_energies_csv(const Trajectory& trajectory);

}  // namespace limber
