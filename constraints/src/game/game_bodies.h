// The bodies of a step by small steps: their state, in double, and the coordinates of the rows, in single precision.
//
//   y = y_free + q,   q = Σ Jᵀf
//
// Coordinates of a frame: √m v (three) and I^½ ω (three; one for a body on a line) about the principal axes as they are
// in the middle of the step, for what keeps its rows, else at the substep's start; of a mode z/√ρ (substep_modes.h). f
// are forces held over the substep; a unit of one moves each by the row again: rows are h M^-½ n for frames and √ρ U
// for modes, so that J y is a displacement over the substep, and the effective mass 1/(J Jᵀ).
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "frame_kernels.h"
#include "limber/constraints/body_response.h"
#include "limber/core/jobs.h"
#include "limber/dynamics/surface_point.h"
#include "substep_modes.h"

namespace limber::internal {

/// A step, and how it is divided.
struct SubstepPlan {
  double step = 0.0;  ///< s, the whole step
  int count = 1;      ///< substeps
  Vec3 gravity = Vec3::Zero();
  bool seen = true;  // whether anybody looks at the bodies between substeps
  double length() const { return step / count; }
};

/// A led or hung body: its parent at the step's two ends, and where it would be at the substep's end by itself.
struct LedBody {
  KinematicFrame start, target;
  bool told = false;  // where the parent goes; else it goes on as it does
  RigidFrame free;
};

struct GameBody {
  BodyGroup* group = nullptr;
  Index slot = 0;
  const SubstepModes* modes = nullptr;  // null: none
  std::int32_t first = 0, blocks = 1;   // of its coordinates
  std::int32_t led = -1;                // its number among those that are
  bool keeps_axes = false;              // its coordinates are those of the whole step
  bool turns_locked = false;            // about any axis of the world
  double root_mass = 0.0;               // √m; 0: its origin is carried
  Vec3 goes = Vec3::Ones();             // along each axis of the world: 0 where its origin is locked, 1 else
  Vec3 shift = Vec3::Zero();            // likewise: h/√m, 0 where its origin is locked or carried
  Mat3 turn_scale = Mat3::Zero();       // coordinates of the turn = turn_scale L, ω = turn_scaleᵀ coordinates
  Vec3 roots = Vec3::Zero();            // of the inertia about the axes of the turn's coordinates
  struct Start {
    Vec3 p = Vec3::Zero();
    Mat3 R = Mat3::Identity();
  } start{};                         // pose at the step's start
  double along = 0.0, square = 0.0;  // q·y₀, and twice the energy of q, by find_answers()
};

class GameBodies {
 public:
  /// The bodies of a step as it begins. @param members ascending, all that move
  void begin_step(std::span<const ConstrainedBody> table, std::span<const Index> members, const SubstepPlan& plan);
  /// Something has rows in its coordinates for the whole step.
  void keep_axes(std::int32_t at);
  /// The inertia of the others becomes that of the coming substep's start; of what locks or a line hold, its middle.
  void turn_axes();
  /// Free motion of all, and with the forces of the substep before. @param number 0 …
  void begin_substep(int number, Jobs& jobs);
  /// By body, sums over q = y − y₀, what contacts move, y₀ = y_free + moved. @param moved y by joints; none: nothing
  void find_answers(std::span<const double> moved, Jobs& jobs);
  /// Leaves a share of q.
  void scale_answer(std::size_t at, float share, std::span<const double> moved);
  /// Moves them by what the sweeps found, and by pushes.
  void end_substep(bool pushed, Jobs& jobs);
  /// Moves one of them further. @param speed, place changes of its coordinates: with the speed that goes with them, and
  /// without
  void displace(std::int32_t number, const double* speed, const double* place);
  /// Turns all that have been displaced. @param again whether any speed has changed
  void end_displacing(bool again);
  /// Coordinates of one of them as they are now. @param to as many as it has, whole blocks
  void write_motion(std::int32_t number, double* to) const;
  /// Tells its group where one of them is.
  void tell(std::int32_t number);
  /// Their groups take over.
  void end_step();

  /// −1: does not move.
  std::int32_t of(Index number) const { return number < 0 ? -1 : by_number_[static_cast<std::size_t>(number)]; }
  std::span<const GameBody> bodies() const { return bodies_; }
  const GameBody& body(std::int32_t at) const { return bodies_[static_cast<std::size_t>(at)]; }
  const SubstepPlan& plan() const { return plan_; }

  // Arrays by block or by body have one at their end that stands.
  std::vector<Block8>& motion() { return motion_; }  ///< y
  const std::vector<Block8>& motion() const { return motion_; }
  std::vector<Block8>& answers() { return answers_; }            ///< q, of what keeps its rows for the step
  const std::vector<Block8>& shapes() const { return shapes_; }  ///< modes at the substep's start
  std::vector<Block8>& pushes() { return pushes_; }  ///< by body: displacements of frames that leave no speed
  const std::vector<Block8>& pushes() const { return pushes_; }
  const std::vector<FrameShift>& shifts() const { return shifts_; }

  /// The derivative of a body's energy by its coordinates, frame and modes, J. @param frames y of the frames
  void write_energy_slopes(std::int32_t at, const std::vector<Block8>& frames, double* to) const;
  const std::vector<Block8>& free_motion() const { return free_; }  ///< y_free

  /// By how much more held forces move the origin of a body that is free in a substep than in the last one, m; of
  /// others 0.
  Vec3 fall_of(std::int32_t number) const;

  /// Writes a force's or torque's part of a row in a frame's coordinates. @param linear, moment world
  void write_frame_row(const GameBody& body, const Vec3& linear, const Vec3& moment, Block8& row) const;
  /// Whether all that moves has numbers.
  bool all_finite() const;

 private:
  /// Calls visit(i) of each body, in parts.
  template <class Visit>
  void for_all(Jobs& jobs, const Visit& visit) const;
  /// Calls visit(frames) of all, in parts.
  template <class Visit>
  void for_all_frames(Jobs& jobs, const Visit& visit);
  void begin_beside_frame(std::size_t at, int number);
  void end_beside_frame(std::size_t at);
  void place_frame(std::size_t at, const RigidFrame& frame);
  void take_axes();
  void set_axes(std::size_t at, const Quaternion& attitude);
  static const FrameSettings& settings(const GameBody& body) { return body.group->frame(body.slot).settings(); }
  void tell_loads(std::size_t at);
  FrameExcitation lead(std::size_t at, int number);
  void swing(std::size_t at);
  void turn_led(std::size_t at, const Quaternion& turned);
  void tell_led(std::size_t at);
  FrameLoad load_of(const GameBody& body) const;
  void write_modes(const GameBody& body, std::vector<Block8>& to) const;
  void move_modes(GameBody& body);
  void leave_resting_rates(const GameBody& body) const;
  void show(std::size_t at);
  RigidTransform pose_of(std::size_t at) const;
  Vec3 momentum_of(std::size_t at) const;
  SubstepModes& modes_of(const ModalModel& model);

  SubstepPlan plan_;
  std::vector<GameBody> bodies_;
  std::vector<EightFrames> frames_;  // of all, eight by eight
  std::vector<std::int32_t> by_number_;
  std::vector<std::unique_ptr<SubstepModes>> modes_;  // by model
  std::vector<LedBody> led_;
  std::vector<Block8> motion_, free_, answers_, shapes_, pushes_;
  std::vector<FrameShift> shifts_;
};

}  // namespace limber::internal
