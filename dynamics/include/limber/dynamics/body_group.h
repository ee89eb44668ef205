/// @file limber/dynamics/body_group.h
/// All instances of one model: amplitudes k × B, frames in arrays, advanced with one table of propagators.
///
/// The modes of a body with fixed nodes also feel gravity and what carries them:
///   g_i = p_i·Rᵀ(g − a) − α·∫ρ x × w_i + Σ_ab ω_a ω_b (δ_ab tr S_i − S_i,ab)          p_i = ∫ρ w_i,  S_i = ∫ρ x w_iᵀ
/// (a, ω, α of the parent; the mean of the values at the step's two ends is held over the step). These are the inertial
/// forces on the rest shape; those on the deformation itself (Coriolis, Euler and centrifugal of u, of relative size
/// |ω|/√λ and |ω|²/λ) are left out as in [H03], and so is all coupling of a *dynamic* rotation to the modes: taken
/// without its reaction on the rotation it would not conserve energy. Free bodies feel none of it: p_i = 0.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "limber/dynamics/oscillator.h"
#include "limber/dynamics/rigid_frame.h"
#include "limber/dynamics/surface_point.h"
#include "limber/model/modal_model.h"

namespace limber {

/// Slots 0 … slots() − 1 hold bodies or are vacant; a removed body's slot is used again. All functions that take a slot
/// expect one that is occupied, and finite numbers: World checks its callers' and gives ids that cannot go stale.
/// Different slots may be written to by different threads at the same time.
class BodyGroup {
 public:
  /// @param step length of every step, s. @throws InvalidArgument if model is null or step is not in (0, 1e100]
  BodyGroup(std::shared_ptr<const ModalModel> model, double step);

  const ModalModel& model() const { return *model_; }
  const FrameConstants& frame_constants() const { return constants_; }
  double step_length() const { return table_.step(); }

  // Bodies. Adding may allocate; a vacant slot is used first. The new body is at rest shape.
  Index add(const RigidTransform& X_WB, const Vec3& velocity, const Vec3& angular_velocity);
  void remove(Index slot);
  Index slots() const { return static_cast<Index>(bodies_.size()); }
  Index count() const { return slots() - static_cast<Index>(vacant_.size()); }
  bool occupied(Index slot) const { return bodies_[static_cast<std::size_t>(slot)].occupied; }

  // State of one body. What is set here is its previous state too: nothing is drawn between.
  const RigidFrame& frame(Index slot) const { return bodies_[static_cast<std::size_t>(slot)].frame; }
  std::span<const double> amplitudes(Index slot) const { return amplitudes_.modes(slot); }  ///< z
  std::span<const double> rates(Index slot) const { return rates_.modes(slot); }            ///< ż
  void set_pose(Index slot, const RigidTransform& X_WB);
  void set_velocity(Index slot, const Vec3& velocity, const Vec3& angular_velocity);
  void set_amplitudes(Index slot, std::span<const double> amplitudes, std::span<const double> rates);
  void set_parent(Index slot, const KinematicFrame& at_step_end);

  // State before the last step, for drawing between.
  const RigidTransform& previous_pose(Index slot) const {
    return bodies_[static_cast<std::size_t>(slot)].previous_pose;
  }
  std::span<const double> previous_amplitudes(Index slot) const { return previous_amplitudes_.modes(slot); }

  // Points of the surface, deformed.
  Vec3 position(Index slot, const SurfacePoint& at) const;  ///< world, m
  Vec3 velocity(Index slot, const SurfacePoint& at) const;  ///< world, m/s, deformation included

  // Loads, at the deformed point.
  /// Held over the next step. @param newtons world axes
  void apply_force(Index slot, const SurfacePoint& at, const Vec3& newtons);
  /// Changes the velocities of frame and modes at once; the modes' only `delay` seconds into the next step if that is
  /// positive (exactly: the response to an impulse at that time is added).
  /// @param newton_seconds world axes. @param delay in [0, step), s
  void apply_impulse(Index slot, const SurfacePoint& at, const Vec3& newton_seconds, double delay);

  /// One step of the occupied slots in [begin, end). Allocates and throws nothing.
  void advance(Index begin, Index end, const Vec3& gravity);

  /// First mass moment about the body origin, deformed: m c + Σ z_i p_i, body axes, kg·m.
  Vec3 first_moment(Index slot) const;

 private:
  /// One row of padded, 64-byte aligned modes per slot.
  class ModeRows {
   public:
    explicit ModeRows(Index modes) : modes_(static_cast<std::size_t>(modes)), blocks_((modes_ + 7) / 8) {}
    void resize(std::size_t slots) { storage_.resize(slots * blocks_); }
    double* row(Index slot) { return storage_.data()[static_cast<std::size_t>(slot) * blocks_].lanes; }
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

  struct Body {
    RigidFrame frame;
    RigidTransform previous_pose;
    Vec3 force = Vec3::Zero(), torque = Vec3::Zero();  // held over the next step, world
    bool occupied = true;
    bool modes_loaded = false;   // forces_ is not zero
    bool modes_delayed = false;  // delayed_z_, delayed_rates_ are not zero
  };

  Body& body(Index slot) { return bodies_[static_cast<std::size_t>(slot)]; }
  void advance_body(Index slot, const Vec3& gravity);
  void advance_modes(Index slot, Body& body);
  void excite_modes(Index slot, const FrameExcitation& excitation);
  void clear_modes(Index slot);

  std::shared_ptr<const ModalModel> model_;
  FrameConstants constants_;
  PropagatorTable table_;
  /// Per mode what it feels of the frame: p, −∫ρ x × w and the symmetric matrix tr(S) 1 − S.
  struct Coupling {
    Vec3 field, angular_acceleration;
    Mat3 spin;
  };
  std::vector<Coupling> couplings_;  // empty for free bodies

  std::vector<Body> bodies_;
  std::vector<Index> vacant_;
  ModeRows amplitudes_, rates_, previous_amplitudes_;
  ModeRows forces_;                     // g, held over the next step
  ModeRows delayed_z_, delayed_rates_;  // added at the end of the next step
};

}  // namespace limber
