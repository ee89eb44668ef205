/// @file limber/dynamics/body_group.h
/// All instances of one model: amplitudes k × B, frames in arrays, advanced with one table of propagators.
///
/// The modes of a body with fixed nodes also feel gravity and what carries them:
///   g_i = p_i·Rᵀ(g − a) − α·∫ρ x × w_i + Σ_ab ω_a ω_b (δ_ab tr S_i − S_i,ab)          p_i = ∫ρ w_i,  S_i = ∫ρ x w_iᵀ
/// (a, ω, α of the parent; the mean of the values at the step's two ends is held over the step). These are the inertial
/// forces on the rest shape; those on the deformation itself (Coriolis, Euler and centrifugal of u, of relative size
/// |ω|/√λ and |ω|²/λ) are left out as in [H03], and so is all coupling of a *dynamic* rotation to the modes: taken
/// without its reaction on the rotation it would not conserve energy. Free bodies feel none of it, p_i = 0, unless they
/// are told to feel all of it (couple(); inertial_coupling.h).
#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "limber/core/state_archive.h"
#include "limber/dynamics/body_energy.h"
#include "limber/dynamics/body_shape.h"
#include "limber/dynamics/inertial_coupling.h"
#include "limber/dynamics/modal_step.h"
#include "limber/dynamics/rigid_frame.h"
#include "limber/dynamics/surface_point.h"
#include "limber/model/modal_model.h"

namespace limber {

class ExactMotion;

/// The action of constraints on one body over one step. Forces act on the deformed body; angular quantities are about
/// the body origin. World axes.
///
/// The frame gets impulses at the step's start (θ = 1: what stands stays, docs/derivations/constraints.md) and held
/// forces on top (θ = ½). The modes get both as one force held over the step: `modal`/Δt. A mode above the step's
/// Nyquist rate, √(λ − ξ²) Δt > π, answers by its static displacement g/λ instead, which lasts for that step alone: the
/// gain H of a held force would come to nothing at every √λ Δt = 2πn, and a constraint on it would whip the mode.
struct ConstraintLoad {
  Vec3 impulse = Vec3::Zero();      ///< N·s, at the step's start
  Vec3 moment = Vec3::Zero();       ///< N·m·s, at the step's start
  Vec3 force = Vec3::Zero();        ///< N, held over the step
  Vec3 torque = Vec3::Zero();       ///< N·m, held over the step
  std::span<const double> modal{};  ///< Σ Uᵀ Rᵀ (impulse + Δt force), k numbers, kg^½·m/s; empty: none
};

/// Slots 0 … slots() − 1 hold bodies or are vacant; a removed body's slot is used again. All functions that take a slot
/// expect one that is occupied, and finite numbers: World checks its callers' and gives ids that cannot go stale.
/// Different slots may be written to by different threads at the same time.
class BodyGroup {
 public:
  /// @param step length of every step, s. @throws InvalidArgument if model is null or step is not in (0, 1e100]
  BodyGroup(std::shared_ptr<const ModalModel> model, double step);

  const ModalModel& model() const { return *model_; }
  const std::shared_ptr<const ModalModel>& shared_model() const { return model_; }
  const FrameConstants& frame_constants() const { return constants_; }
  double step_length() const { return whole_.length(); }
  /// Changes the length of the steps to come. Modes that pass the Nyquist rate of the new step go on from where they
  /// are: what held them in the last step is taken for their static displacement. No impulse may be waiting for its
  /// time in the next one. Allocates nothing.
  /// @throws InvalidArgument if step is not in (0, 1e100]
  void set_step_length(double step);
  const ModalStep& modal_step() const { return whole_; }

  // Bodies. Adding may allocate; a vacant slot is used first. The new body is at rest shape.
  /// @param skinned whether it bends by its modal skin. @pre not so for a model that has none
  Index add(const RigidTransform& X_WB, const Vec3& velocity, const Vec3& angular_velocity, bool skinned = false);
  void remove(Index slot);
  /// From now on the body's turning and its modes feel each other's inertia, as in inertial_coupling.h: it flies
  /// freely, under loads. Neither predict() nor parts of steps are for it. Allocates; the first time for a model, the
  /// integrals.
  /// @throws InvalidArgument as InertialCoupling, and for a body that bends by its skin
  void couple(Index slot);
  bool coupled(Index slot) const { return coupled_[static_cast<std::size_t>(slot)] != nullptr; }
  Index slots() const { return static_cast<Index>(bodies_.size()); }
  Index count() const { return slots() - static_cast<Index>(vacant_.size()); }
  bool occupied(Index slot) const { return bodies_[static_cast<std::size_t>(slot)].occupied; }

  // State of one body. Setting it sets its previous state too: nothing is drawn between.
  const RigidFrame& frame(Index slot) const { return bodies_[static_cast<std::size_t>(slot)].frame; }
  std::span<const double> amplitudes(Index slot) const { return now_.amplitudes.modes(slot); }  ///< z
  std::span<const double> rates(Index slot) const {                                             ///< ż
    return coupled(slot) ? coupled_[static_cast<std::size_t>(slot)]->rates() : now_.rates.modes(slot);
  }
  Vec3 angular_velocity(Index slot) const;  ///< world, rad/s; of coupled bodies it is not frame()'s
  void set_pose(Index slot, const RigidTransform& X_WB);
  void set_velocity(Index slot, const Vec3& velocity, const Vec3& angular_velocity);
  void set_amplitudes(Index slot, std::span<const double> amplitudes, std::span<const double> rates);
  void set_parent(Index slot, const KinematicFrame& at_step_end);
  /// @pre locks and linear damping are for free bodies; coupled ones have neither locks nor damping
  void set_frame_settings(Index slot, const FrameSettings& settings) {
    body(slot).frame.set_settings(constants_, settings);
  }
  /// What the world's gravity is to the body, m/s².
  Vec3 own_gravity(Index slot, const Vec3& gravity) const { return frame(slot).settings().gravity_scale * gravity; }

  // State before the last step, for drawing between.
  const RigidTransform& previous_pose(Index slot) const {
    return bodies_[static_cast<std::size_t>(slot)].previous_pose;
  }
  std::span<const double> previous_amplitudes(Index slot) const { return previous_amplitudes_.modes(slot); }

  // Points of the surface and their motion with the amplitudes, now, at the predicted end of the step, and at any
  // amplitudes. Views of the slot's data.
  bool skinned(Index slot) const { return skin(slot) != nullptr; }
  BodyShape shape(Index slot) const { return shape_at(slot, amplitudes(slot)); }
  BodyShape predicted_shape(Index slot) const { return shape_at(slot, predicted_amplitudes(slot)); }
  BodyShape shape_at(Index slot, std::span<const double> z) const { return {*model_, z, skin(slot)}; }
  /// For means over the way between the two. @pre skinned
  std::array<ShapeBetween, kShapesBetween> shapes_between(Index slot) const;
  /// The last shapes of a body with a skin; null: none.
  SkinMemory* skin(Index slot) const;

  // Points of the surface, deformed.
  Vec3 position(Index slot, const SurfacePoint& at) const;  ///< world, m
  Vec3 velocity(Index slot, const SurfacePoint& at) const;  ///< world, m/s, deformation included

  // Loads, at the deformed point.
  /// Held over the next step, with the arm and the axes at its start; on coupled bodies with the mean of both ends'.
  /// @param newtons world axes
  void apply_force(Index slot, const SurfacePoint& at, const Vec3& newtons);
  /// Changes the velocities of frame and modes at once; the modes' only `delay` seconds into the next step if that is
  /// positive (exactly: the response to an impulse at that time is added). Allocates nothing but the body's first
  /// places for delayed impulses.
  /// @param newton_seconds world axes. @param delay in [0, step), s
  void apply_impulse(Index slot, const SurfacePoint& at, const Vec3& newton_seconds, double delay);

  // Gravity is the world's in advance(), energy() and predicted_energy(), and the body's own in all that predicts.

  /// One step of the occupied slots in [begin, end) that are awake. Allocates and throws nothing.
  void advance(Index begin, Index end, const Vec3& gravity);

  /// True: the steps that follow are parts of one that has begun, so previous_pose() and previous_amplitudes() stay
  /// those of its start.
  void set_within_step(bool within) { within_step_ = within; }

  /// Stops a body where it is: frame and modes at rest, loads forgotten. advance() leaves it alone until it is woken.
  void put_to_sleep(Index slot);
  void wake(Index slot) { body(slot).asleep = false; }

  /// The motion that advance() would give one body, at any time within the step. The body stays as it is.
  void predict_motion(Index slot, const Vec3& gravity, ExactMotion& motion) const {
    predict_motion(slot, gravity, step_length(), motion);
  }
  /// The same over another length, s: what is left of a step that is cut.
  void predict_motion(Index slot, const Vec3& gravity, double length, ExactMotion& motion) const {
    predict_motion(slot, gravity, length, {}, {}, motion);
  }
  /// The same under `load`: how the body gets to where predict() with the same arguments says that it ends. Modes that
  /// answer statically come to their answer at the end alone.
  void predict_motion(Index slot, const Vec3& gravity, const ConstraintLoad& load, const ModalStep& modes,
                      ExactMotion& motion) const {
    predict_motion(slot, gravity, modes.length(), load, modes.velocity_response(), motion);
  }

  /// True: advance() leaves the body alone; the solver of its constraints predicts and commits it.
  void set_constrained(Index slot, bool constrained) { body(slot).constrained = constrained; }

  // One step in two phases, for bodies under constraints: predict as often as wanted, then commit the last prediction.
  // predict() and commit() without a load come to the same bits as advance(). Neither allocates nor throws.
  /// Finds the state at the step's end under the body's own loads and `load`; the body itself does not change.
  void predict(Index slot, const Vec3& gravity, const ConstraintLoad& load = {}) {
    predict(slot, gravity, load, whole_);
  }
  /// The same for a step of the length of `modes`, in which they answer as it says: part of a step that is cut.
  /// Impulses with a delay are not to be waiting then, nor a parent's new place.
  void predict(Index slot, const Vec3& gravity, const ConstraintLoad& load, const ModalStep& modes);
  /// The same for a body whose frame's end is found by whoever solves its constraints; its modes go through the step as
  /// above. @param end the frame there. @param excitation what the modes feel of it. @param modal as
  /// ConstraintLoad::modal
  void predict(Index slot, const RigidFrame& end, const FrameExcitation& excitation, std::span<const double> modal,
               const ModalStep& modes);
  /// A step in which the modes do not move: as the body is, but for the frame.
  void predict_rest(Index slot, const RigidFrame& end);
  const RigidFrame& predicted_frame(Index slot) const { return predictions_[static_cast<std::size_t>(slot)].frame; }
  std::span<const double> predicted_amplitudes(Index slot) const { return predicted_.amplitudes.modes(slot); }
  std::span<const double> predicted_rates(Index slot) const { return predicted_.rates.modes(slot); }
  /// Changes the predicted velocities of frame and modes. Arguments as for apply_generalized_impulse().
  void adjust_prediction(Index slot, const Vec3& impulse, const Vec3& moment, std::span<const double> modal);
  /// Makes the last prediction the state, and clears the loads, as advance() does.
  /// @param begins, ends whether it is the first and the last part of a step: held loads stay until the last
  void commit(Index slot, bool begins = true, bool ends = true);
  /// Ends a step whose last part was committed without an end: the loads are cleared.
  void end_step(Index slot) { clear_loads(slot); }

  // One step in equal parts, taken by whoever solves the body's constraints (small_steps.h): begin_parts(); for each
  // part the frame and what constraints do to the modes are the caller's; end_parts(). Nothing allocates or throws.
  void begin_parts(Index slot);
  /// The modes go freely through one part, under what is held on them and the delayed impulses that come within it.
  /// @param part how they go. @param number of the part, 0 … count − 1. @param excitation what bodies with fixed nodes
  /// feel of their frame over it
  void advance_modes(Index slot, const ModalStep& part, int number, int count, const FrameExcitation& excitation);
  RigidFrame& frame_in_parts(Index slot) { return body(slot).frame; }
  std::span<double> amplitudes_in_parts(Index slot) { return now_.amplitudes.modes(slot); }
  std::span<double> rates_in_parts(Index slot) { return now_.rates.modes(slot); }
  /// The part of rates() that would be left if the modes rested under what acted on them in the last part: a force that
  /// comes as an impulse a part leaves them falling at its end. Zero after a step that was not taken in parts.
  std::span<const double> resting_rates(Index slot) const { return resting_rates_.modes(slot); }
  std::span<double> resting_rates_in_parts(Index slot) { return resting_rates_.modes(slot); }
  /// Twice the kinetic energy of the modes beyond that, J.
  double modal_motion(Index slot) const;
  void end_parts(Index slot) { clear_loads(slot); }

  /// Changes the velocities of frame and modes at once. @param impulse N·s, world. @param moment about the body origin,
  /// N·m·s, world. @param modal k numbers, kg^½·m/s, or none
  void apply_generalized_impulse(Index slot, const Vec3& impulse, const Vec3& moment, std::span<const double> modal);
  /// Lasts for the next step. @param modal k numbers, kg^½·m/s², or none
  void apply_generalized_force(Index slot, const Vec3& force, const Vec3& torque, std::span<const double> modal);
  /// The sum of apply_force() for the next step: world, N, and about the body origin, N·m.
  const Vec3& held_force(Index slot) const { return bodies_[static_cast<std::size_t>(slot)].force; }
  const Vec3& held_torque(Index slot) const { return bodies_[static_cast<std::size_t>(slot)].torque; }
  std::span<const double> held_modal_forces(Index slot) const { return now_.forces.modes(slot); }

  // The modes' answers to a constraint over a whole step, one number per mode; see ModalStep.
  std::span<const double> position_response() const { return whole_.position_response(); }
  std::span<const double> velocity_response() const { return whole_.velocity_response(); }
  /// The part of amplitudes() that is the static answer to the last step's constraints; zero for modes below the
  /// Nyquist rate. The mode's energy is ½(ż² + λ(z − c)²) + ½λc².
  std::span<const double> static_amplitudes(Index slot) const { return now_.answers.modes(slot); }

  BodyEnergy energy(Index slot, const Vec3& gravity) const;
  BodyEnergy predicted_energy(Index slot, const Vec3& gravity) const;
  /// Energy that the modes' damping takes over the predicted step, J: work of the forces held over it less what the
  /// modes gain.
  double predicted_dissipation(Index slot) const;
  /// True if an impulse with a delay acts part way into the next step.
  bool has_delayed_impulse(Index slot) const { return !bodies_[static_cast<std::size_t>(slot)].delayed.empty(); }

  /// Everything that the coming steps of one body depend on, and what is drawn between the last two states.
  void save_state(Index slot, StateWriter& state) const;
  /// @param state of the same slot or another one of the same model, between two steps
  void restore_state(Index slot, StateReader& state);

  /// First mass moment about the body origin, deformed: m c + Σ z_i p_i, body axes, kg·m.
  Vec3 first_moment(Index slot) const;
  Vec3 predicted_first_moment(Index slot) const;

 private:
  /// Data of a body with a skin. Not state: all of it follows from amplitudes.
  struct Skin {
    explicit Skin(const ModalSkin& of) : memory(of) {}
    SkinMemory memory;
    std::array<std::vector<double>, kShapesBetween> between;  // amplitudes
  };

  /// One row of padded, 64-byte aligned modes per slot.
  class ModeRows {
   public:
    explicit ModeRows(Index modes) : modes_(static_cast<std::size_t>(modes)), blocks_((modes_ + 7) / 8) {}
    void resize(std::size_t slots) { storage_.resize(slots * blocks_); }
    double* row(Index slot) {
      return blocks_ == 0 ? nullptr : storage_[static_cast<std::size_t>(slot) * blocks_].lanes;
    }
    std::span<double> modes(Index slot) { return {modes_ == 0 ? nullptr : row(slot), modes_}; }
    std::span<const double> modes(Index slot) const { return const_cast<ModeRows*>(this)->modes(slot); }
    void clear(Index slot);
    void copy_from(const ModeRows& other, Index slot);

   private:
    struct alignas(64) Block {
      double lanes[PropagatorTable::kPad] = {};
    };
    std::size_t modes_, blocks_;
    std::vector<Block> storage_;
  };

  /// The modes of all bodies at one time.
  struct ModalState {
    explicit ModalState(Index modes) : amplitudes(modes), rates(modes), forces(modes), answers(modes) {}
    ModeRows amplitudes;
    ModeRows rates;    // of coupled bodies: the modes' momenta π
    ModeRows forces;   // g, held over the step that begins then
    ModeRows answers;  // c, of the amplitudes: the static answer to the last step's constraints
  };

  struct DelayedImpulse {
    SurfacePoint at;
    Vec3 impulse_B;               // N·s
    double time;                  // s into the next step
    std::vector<double> modal{};  // Jᵀ impulse_B, of a body with a skin

    template <class Self>
    static auto state_fields(Self& s) {
      return std::tie(s.at, s.impulse_B, s.time, s.modal);
    }
  };

  /// Held on a point of a coupled body: its arm and axes are those of both ends of the step.
  struct PointForce {
    SurfacePoint at;
    Vec3 force;  // world, N

    template <class Self>
    static auto state_fields(Self& s) {
      return std::tie(s.at, s.force);
    }
  };

  struct Body {
    RigidFrame frame;
    RigidTransform previous_pose;
    Vec3 force = Vec3::Zero(), torque = Vec3::Zero();  // held over the next step, world
    bool occupied = true;
    bool constrained = false;
    bool asleep = false;
    bool modes_loaded = false;               // forces of modes are not zero
    bool modes_static = false;               // their static answers are not zero
    bool held = false;                       // a constraint acted on the modes in the last step
    std::vector<DelayedImpulse> delayed{};   // on the modes, within the next step
    std::vector<PointForce> point_forces{};  // part of `force`; of coupled bodies alone

    /// `occupied` and `constrained` are others' business.
    template <class Self>
    static auto state_fields(Self& s) {
      return std::tie(s.frame, s.previous_pose, s.force, s.torque, s.asleep, s.modes_loaded, s.modes_static, s.held,
                      s.delayed, s.point_forces);
    }
  };

  /// The frame at the end of a step that was predicted.
  struct Prediction {
    RigidFrame frame;
    bool held = false;
    bool modes_static = false;
  };

  /// The modes of one body during a step: rows of its own, or those of its prediction.
  struct ModeArrays {
    double *z = nullptr, *rates = nullptr, *forces = nullptr;
  };

  void keep_previous_state(Index slot);
  Body& body(Index slot) { return bodies_[static_cast<std::size_t>(slot)]; }
  const Body& body(Index slot) const { return bodies_[static_cast<std::size_t>(slot)]; }
  void advance_body(Index slot, const Vec3& gravity);
  void advance_coupled(Index slot, const Vec3& gravity);
  void set_coupled_velocities(Index slot, const Vec3& angular_velocity, std::span<const double> rates);
  void find_coupled_velocities(Index slot);
  Vec3 add_point_forces(Index slot, const Quaternion& q_WB, std::span<double> modal) const;
  void predict_motion(Index slot, const Vec3& gravity, double length, const ConstraintLoad& load,
                      std::span<const double> answers, ExactMotion& motion) const;
  void advance_modes(Index slot, const ModeArrays& modes, bool loaded, const ModalStep& step) const;
  void add_delayed(const DelayedImpulse& impulse, const ModeArrays& modes, double remaining) const;
  void excite_modes(double* forces, const FrameExcitation& excitation) const;
  void leave_static_answer(Index slot, double* z) const;
  void forget_static_answer(Index slot);
  void split_static_answer(Index slot);
  static bool add_modal_load(std::span<const double> modal, double* forces, const ModalStep& step);
  bool answer_statically(Index slot, std::span<const double> modal, const ModalStep& step);
  void clear_loads(Index slot);
  void clear_modes(Index slot);
  double modal_impulse(const DelayedImpulse& impulse, std::size_t mode) const;
  BodyEnergy energy_of(const RigidFrame& frame, std::span<const double> z, std::span<const double> rates,
                       std::span<const double> answer, const Vec3& gravity) const;
  Vec3 first_moment_of(std::span<const double> z) const;
  Vec3 first_moment_at_end(const ExactMotion& motion) const;
  std::array<ModeRows*, 10> mode_rows() {
    return {&now_.amplitudes,      &now_.rates,        &now_.forces,           &now_.answers,
            &previous_amplitudes_, &resting_rates_,    &predicted_.amplitudes, &predicted_.rates,
            &predicted_.forces,    &predicted_.answers};
  }

  std::shared_ptr<const ModalModel> model_;
  FrameConstants constants_;
  ModalStep whole_;
  std::vector<double> were_static_;  // velocity responses of the step before the last change of its length
  /// Per mode what it feels of the frame: p, −∫ρ x × w and the symmetric matrix tr(S) 1 − S.
  struct Coupling {
    Vec3 field, angular_acceleration;
    Mat3 spin;
  };
  std::vector<Coupling> couplings_;  // empty for free bodies

  std::vector<Body> bodies_;
  std::vector<std::unique_ptr<Skin>> skins_;             // by slot
  std::unique_ptr<InertialCoupling> coupling_;           // made for the first body that needs it
  std::vector<std::unique_ptr<CoupledMotion>> coupled_;  // by slot; null: not coupled
  std::vector<Index> vacant_;
  bool within_step_ = false;
  ModeRows previous_amplitudes_, resting_rates_;
  ModalState now_, predicted_;
  std::vector<Prediction> predictions_;
};

}  // namespace limber
