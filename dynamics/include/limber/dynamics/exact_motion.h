/// @file limber/dynamics/exact_motion.h
/// The motion of one body over the coming step, evaluated anywhere within it in closed form, without changing the body.
///
///   ExactMotion motion;
///   group.predict_motion(slot, gravity, motion);  // or set_frame() for a mover without modes
///   motion.at(0.3 * motion.step(), pose, amplitudes);
///
/// Under the loads that the body has now: forces held, impulses with a delay from their time on. Its state at the
/// step's end is that which BodyGroup::advance() commits (to round-off: 1e-13 of the state); constraints are not part
/// of it. Frames: FramePath. Modes: the exact flow of each oscillator (oscillator.h) over t, some three ns each;
/// accuracy, in the norm of (√λ z, ż): 4ε(4 + √λ t) of the state's own size, for any damping and any t; the same bits
/// for any instruction set that has fused multiply-add. A motion is a copy: the body may change, its model must live.
/// Setting a motion again allocates nothing once it has held as many modes, parts and impulses; all else never does.
#pragma once

#include <span>
#include <vector>

#include "limber/dynamics/frame_path.h"
#include "limber/dynamics/motion_bounds.h"
#include "limber/dynamics/oscillator.h"

namespace limber {

/// A body's state at one time within a step; scratch that its owner keeps.
struct MotionState {
  double time = 0.0;  ///< s from the step's start
  RigidTransform pose{};
  Vec3 velocity = Vec3::Zero(), angular_velocity = Vec3::Zero();  ///< of the origin; world
  std::vector<double> amplitudes{}, rates{};                      ///< z, ż
};

class ExactMotion {
 public:
  /// At rest in the world's origin, without modes; step 0.
  ExactMotion() = default;

  /// A mover without modes. @throws InvalidArgument for numbers that are not finite or a step < 0
  void set_frame(const RigidMotion& motion, double step);

  double step() const { return path_.step(); }
  Index modes() const { return static_cast<Index>(z_.size()); }
  const FramePath& path() const { return path_; }

  /// @param t in [0, step]; no check, here and below. @param amplitudes modes() numbers
  void at(double t, RigidTransform& pose, std::span<double> amplitudes) const;
  double amplitude(Index mode, double t) const;
  /// Both at once.
  void evaluate(double t, MotionState& state) const;

  /// How far any point with |r| ≤ distance, |U_i| ≤ shape_i may be within the step from its place at the start, moved
  /// straight on and evenly by `displacement`, m: with the numbers of ModalModel::collision_extent(), BodyState::reach.
  /// O(k).
  double reach(double distance, std::span<const double> shape, const Vec3& displacement = Vec3::Zero()) const;
  /// The same without the way of the body origin: how far turning and flexing take a point from where it would be if
  /// the frame moved straight on. @param arm |r + U z| ≤ arm at the start, m
  double sway(double arm, std::span<const double> shape) const;

  /// By how much each amplitude may differ from its value at the start, within the step. @param changes modes() numbers
  void changes(std::span<double> changes) const;

  // For those who make one by hand: the frame first, then its modes, then the impulses on them.
  FramePath& path() { return path_; }
  /// @param lambda, decay as in Mode; kept by reference. @param z, rates at the step's start; as many of each
  void set_modes(std::span<const double> lambda, std::span<const double> decay, std::span<const double> z,
                 std::span<const double> rates);
  std::span<double> forces() { return force_; }  ///< g, held over the step; zero after set_modes()
  /// Takes a part off the amplitudes at the step's start: what held it lets go. reach() still counts from before.
  void release(std::span<const double> part);
  /// @param time in [0, step), s. @returns the modal impulse w_iᵀj of every mode, zeros to be filled
  std::span<double> add_impulse(double time);

 private:
  Mode mode(std::size_t i) const { return {lambda_[i], decay_[i]}; }
  double released(std::size_t i) const { return released_.empty() ? 0.0 : std::abs(released_[i]); }
  /// z, ż at t of `count` modes from `first` on.
  void modes_at(double t, std::size_t first, std::size_t count, double* z, double* rates) const;
  double change(std::size_t i) const;
  std::span<const double> impulses_at(std::size_t n) const { return {impulses_.data() + n * z_.size(), z_.size()}; }

  FramePath path_;
  std::span<const double> lambda_, decay_;
  std::vector<double> z_, rates_, force_;
  std::vector<double> released_;                  // empty, or by mode
  std::vector<double> impulse_times_, impulses_;  // impulses_: a row of modes for each
};

}  // namespace limber
