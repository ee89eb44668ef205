/// @file limber/dynamics/rigid_frame.h
/// How the frame of one body moves. Which law holds is decided by the nodes that were fixed at bake time (FrameMotion):
///
///   kFree       m v̇ = m g + F (exact parabola);  L̇ = τ (free rotation in closed form, torque by kicks)
///   kPoint      L̇ = τ + R s × (g − a)            L about the pivot, which moves as the parent says
///   kLine       eᵀIe θ̈ = eᵀ(Rᵀτ + s × Rᵀ(g − a) − I α − ω × I ω)    θ about the line, which the parent carries
///   kKinematic  moves with the parent only
///
/// Damping c (FrameSettings) adds −c m v and −c L. Both are taken exactly, as v(h) = e^{−ch} v + h φ₁ a, and with
/// φ₁ = (1 − e^{−ch})/(ch), φ₂ = (1 − φ₁)/(ch): p(h) = p + h φ₁ v + h² φ₂ a; an L that decays turns the body in h as a
/// steady one does in h φ₁. Locked axes e of the world take up all force and moment along them:
///
///   v·e = 0;   ω = A (Aᵀ I A)⁻¹ Aᵀ L,  Aᵀ L̇ = Aᵀ τ        the columns of A: the axes about which it may turn
///
/// which is a steady turn where one axis is left; where two are, it is taken by the midpoint rule.
///
/// with R = R_WB, a, ω, α the parent's acceleration, angular velocity and acceleration (ω, α in body axes), and
/// s = m c + Σ z_i p_i the first mass moment of the deformed body about its origin, body axes, kg·m.
/// Torques are applied by Strang splitting, half a kick, the exact free motion, half a kick: second order in the step,
/// symplectic, and |L| and the kinetic energy of an unloaded body are kept by the exact flow itself. A step without
/// torque is exact for any length. A hanging body's step is cut into parts short beside its swing (a quarter of a
/// radian of √(‖I⁻¹[m c]ₓ‖ |g − a|), 4096 parts at most), so that its energy stays bounded for any step too.
/// Derivation: docs/derivations/rigid-frame.md.
#pragma once

#include <array>
#include <cstdint>
#include <tuple>
#include <type_traits>

#include "limber/core/rigid_transform.h"
#include "limber/dynamics/frame_path.h"
#include "limber/dynamics/free_rotation.h"
#include "limber/model/modal_model.h"

namespace limber {

/// Motion of what carries a body with fixed nodes (its animated parent), as it is at the end of the coming step. Within
/// the step its accelerations are held. kPoint reads the translation only: its rotation is dynamic. kLine turns about
/// the line as the parent carries it. kFree has no parent.
struct KinematicFrame {
  RigidTransform pose{};                                                      ///< X_WK; K = B where θ = 0
  Vec3 velocity = Vec3::Zero(), acceleration = Vec3::Zero();                  ///< of the body origin; world, m/s, m/s²
  Vec3 angular_velocity = Vec3::Zero(), angular_acceleration = Vec3::Zero();  ///< world, rad/s, rad/s²
};

template <class Self>
requires std::is_same_v<std::remove_const_t<Self>, KinematicFrame>
auto state_fields(Self& s) {
  return std::tie(s.pose, s.velocity, s.acceleration, s.angular_velocity, s.angular_acceleration);
}

/// Where a parent is part way through a step: on the parabola of its held acceleration through both ends, in a steady
/// turn. @param part in [0, 1]. @param step s
KinematicFrame between(const KinematicFrame& start, const KinematicFrame& target, double part, double step);

/// The part of a model that its frame needs; never changes, shared by all instances.
struct FrameConstants {
  FrameMotion motion = FrameMotion::kFree;
  double mass = 1.0;                   ///< kg
  Vec3 center_of_mass = Vec3::Zero();  ///< body frame, m
  Mat3 inertia = Mat3::Identity();     ///< about the body origin, body axes, kg·m²
  Vec3 line_axis = Vec3::UnitX();      ///< e, body frame
  PrincipalInertia principal;          ///< of `inertia`
  double swing = 0.0;                  ///< kPoint, kLine: largest angular acceleration per m/s² of field, 1/m

  explicit FrameConstants(const ModalModelData& body);
};

/// Axes of the world along which a free body may not move, and about which it may not turn: x, y, z.
struct AxisLocks {
  std::array<bool, 3> translation{}, rotation{};

  bool any() const { return *this != AxisLocks{}; }
  friend bool operator==(const AxisLocks&, const AxisLocks&) = default;
  template <class Self>
  static auto state_fields(Self& s) {
    return std::tie(s.translation, s.rotation);
  }
};

/// How one body's frame moves, beside its model and what acts on it.
struct FrameSettings {
  double gravity_scale = 1.0;   ///< the body's gravity is this times the world's; finite
  double linear_damping = 0.0;  ///< c of translation, 1/s, ≥ 0; kFree alone
  /// c of rotation, 1/s, ≥ 0: of L about the body origin; kPoint: about the point; kLine: of θ̇.
  double angular_damping = 0.0;
  AxisLocks locks{};  ///< kFree alone
  /// Whether it has damping or locks.
  bool alter_free_motion() const { return linear_damping > 0.0 || angular_damping > 0.0 || locks.any(); }
  /// @throws InvalidArgument naming the field and its value
  void validate() const;

  template <class Self>
  static auto state_fields(Self& s) {
    return std::tie(s.gravity_scale, s.linear_damping, s.angular_damping, s.locks);
  }
};

/// What exponential damping makes of a step: e^{−x}, φ₁(x), φ₂(x) of the head of this file. @param x = c h ≥ 0
struct Decay {
  explicit Decay(double x);
  double left = 1.0, first = 1.0, second = 0.5;
};

/// How a body may turn about axes of the world: columns across each other in which its inertia is diagonal. Those that
/// are locked are zero.
struct TurnAxes {
  Mat3 axes = Mat3::Zero();
  Vec3 moments = Vec3::Zero();  ///< about them, kg·m²

  /// @param inertia about the body origin, world axes, kg·m². @param locks at least one of rotation
  TurnAxes(const Mat3& inertia, const AxisLocks& locks);
  /// A (Aᵀ I A)⁻¹ Aᵀ, 1/(kg·m²).
  Mat3 inverse_inertia() const;
};

/// Loads on a frame over one step, held.
struct FrameLoad {
  Vec3 gravity = Vec3::Zero();  ///< world, m/s²
  Vec3 force = Vec3::Zero();    ///< world, N
  Vec3 torque = Vec3::Zero();   ///< about the body origin, world, N·m
};

/// Excitation of the modes of a body with fixed nodes by its frame over one step, in body axes: the mean over the step,
/// by the trapezoidal rule on its parts.
struct FrameExcitation {
  Vec3 field = Vec3::Zero();                 ///< Rᵀ(g − a), m/s²
  Vec3 angular_acceleration = Vec3::Zero();  ///< α, rad/s²
  Mat3 spin = Mat3::Zero();                  ///< ω ωᵀ of the parent, rad²/s²
};

/// The state of one frame. Plain data of fixed size; nothing allocates or throws. Arguments are finite (the caller's
/// care) and the same constants are passed in every call.
class RigidFrame {
 public:
  /// @param velocity of the body origin, world, m/s; for a body with fixed nodes: of its parent, which keeps it until
  /// told otherwise
  /// @param angular_velocity world, rad/s. kFree, kPoint: of the body; kLine: its part along the line, as θ̇;
  /// kKinematic: of the parent
  RigidFrame(const FrameConstants& c, const RigidTransform& X_WB, const Vec3& velocity, const Vec3& angular_velocity);

  const RigidTransform& pose() const { return pose_; }
  const FrameSettings& settings() const { return settings_; }
  /// Takes from its motion what is locked now. @pre locks are for kFree
  void set_settings(const FrameConstants& c, const FrameSettings& settings);
  const Vec3& velocity() const { return velocity_; }     ///< of the body origin, world, m/s
  Vec3 angular_velocity(const FrameConstants& c) const;  ///< world, rad/s
  Vec3 angular_momentum(const FrameConstants& c) const;  ///< R I Rᵀω, world, about the body origin, kg·m²/s
  Vec3 linear_momentum(const FrameConstants& c) const;   ///< m (v + ω × R c), world, kg·m/s
  double kinetic_energy(const FrameConstants& c) const;  ///< ½m v² + m v·(ω × R c) + ½ωᵀR I Rᵀω, J

  /// Moves the body; momenta stay. For kLine, θ = 0 there.
  void set_pose(const RigidTransform& X_WB);
  /// Arguments as in the constructor.
  void set_velocity(const FrameConstants& c, const Vec3& velocity, const Vec3& angular_velocity);
  /// Sets the parent at the end of the coming step. Without a new one it goes on at its velocity and angular
  /// velocity.
  void set_parent(const KinematicFrame& at_step_end);
  /// True if the parent of the step's end has been set.
  bool has_next_parent() const { return parent_was_set_; }
  /// Where it is told to be. @pre has_next_parent()
  const KinematicFrame& next_parent() const { return next_parent_; }
  /// The parent now.
  const KinematicFrame& parent() const { return parent_; }

  /// Sets all of a free body's motion (kFree), by momentum. @param angular_momentum about the body origin, world,
  /// kg·m²/s
  void set_motion(const RigidTransform& X_WB, const Vec3& velocity, const Vec3& angular_momentum);

  /// Where a free body is part way through a step; set_motion() tells how the step ends. @param X_WB its quaternion is
  /// of length 1
  void place(const RigidTransform& X_WB) { pose_ = X_WB; }

  /// Sets the turning of a body whose origin its parent carries (kPoint, kLine); the parent stays where it is.
  /// @param q_WB kLine: a turn about the line as the parent carries it. @param angular_momentum as above; kLine: its
  /// part along the line counts
  void set_turn(const FrameConstants& c, const Quaternion& q_WB, const Vec3& angular_momentum);

  /// @param impulse N·s, world. @param moment about the body origin, N·m·s, world. The part that the
  /// fixing takes up has no effect.
  void apply_impulse(const FrameConstants& c, const Vec3& impulse, const Vec3& moment);

  /// One step is begin_step(), the modes' own step, end_step(): the modes are shaken by what begin_step() returns and
  /// move the first moment s that the second kick sees.
  /// @param path if given, both together write there how the frame moves within the step
  FrameExcitation begin_step(const FrameConstants& c, const FrameLoad& load, const Vec3& first_moment, double h,
                             FramePath* path = nullptr);
  void end_step(const FrameConstants& c, const FrameLoad& load, const Vec3& first_moment, double h,
                FramePath* path = nullptr);

 private:
  void kick(const FrameConstants& c, const FrameLoad& load, const Vec3& first_moment, double seconds);
  void fly(const FrameConstants& c, const FrameLoad& load, double h, FramePath* path);
  void rotate_freely(const FrameConstants& c, double h);
  void rotate_undamped(const FrameConstants& c, double h);
  void rotate_about_axes(const FrameConstants& c, double h);
  void set_momentum(const Vec3& angular_momentum);
  void hold_parent_accelerations();
  void move_parent(double h);
  RigidMotion parent_path(double h) const;
  int substeps(const FrameConstants& c, const FrameLoad& load, double h) const;
  void place_parent_between(const KinematicFrame& before, const KinematicFrame& after, double part);
  void add_excitation(const FrameConstants& c, const Vec3& gravity, double weight, FrameExcitation& sum) const;
  Vec3 line_in_world(const FrameConstants& c) const { return pose_.q * c.line_axis; }

  friend struct StateFields;
  template <class Self>
  static auto state_fields(Self& s) {
    return std::tie(s.pose_, s.settings_, s.velocity_, s.momentum_, s.rotation_, s.rotation_step_, s.rotation_steps_,
                    s.disturbed_, s.parent_, s.next_parent_, s.parent_was_set_, s.angle_, s.angle_rate_);
  }

  RigidTransform pose_;
  FrameSettings settings_;
  Vec3 velocity_;
  // kFree, kPoint: the momentum is the state (about what is not locked); attitudes come from the rotation since the
  // last disturbance.
  Vec3 momentum_ = Vec3::Zero();  // world
  FreeRotation rotation_;
  double rotation_step_ = 0.0;
  std::int64_t rotation_steps_ = 0;
  bool disturbed_ = true;
  // Bodies with fixed nodes: their parent now and, where it was told, at the end of the coming step.
  KinematicFrame parent_, next_parent_;
  bool parent_was_set_ = false;
  double angle_ = 0.0, angle_rate_ = 0.0;  // kLine: θ, rad, and θ̇
};

}  // namespace limber
