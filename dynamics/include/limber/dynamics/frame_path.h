/// @file limber/dynamics/frame_path.h
/// Path of a body frame within one step, in closed form, with bounds on it.
///
///   p(t) = p₀ + v₀ t + ½ a t²          origin: a free body's flight, or a parent's path through both its poses
///   R(t)   free rotation from the step's first kick on (kFree), or from the kick of the part that t lies in (kPoint)
///   R(t) = exp(ω_K t) R_K exp(θ(t) e)   carried by a parent that turns steadily; θ linear in each part (kLine)
///
/// This is the motion that RigidFrame steps through: at the step's end RigidFrame commits it. Bounds hold to
/// round-off; derivation: docs/derivations/motion-bounds.md.
#pragma once

#include <cstddef>
#include <vector>

#include "limber/core/rigid_transform.h"
#include "limber/dynamics/free_rotation.h"

namespace limber {

/// A frame that moves along a parabola and turns steadily: an animated or rigid mover, at the step's start.
struct RigidMotion {
  RigidTransform pose{};                 ///< X_WB
  Vec3 velocity = Vec3::Zero();          ///< of the origin, world, m/s
  Vec3 acceleration = Vec3::Zero();      ///< held, world, m/s²
  Vec3 angular_velocity = Vec3::Zero();  ///< held, world, rad/s
};

/// The path of one frame over one step. Holds its parts; setting a path of no more parts again allocates nothing.
class FramePath {
 public:
  /// At rest in the world's origin; step 0.
  FramePath() { set({}, 0.0); }

  /// @param step s, finite, ≥ 0
  void set(const RigidMotion& motion, double step);

  double step() const { return step_; }

  // At time t in [0, step]; no check.
  RigidTransform pose(double t) const;
  Vec3 velocity(double t) const;                              ///< of the origin, world, m/s
  Vec3 angular_velocity(double t) const;                      ///< world, rad/s; where a kick acts at t: after it
  const Vec3& acceleration() const { return acceleration_; }  ///< of the origin, held over the step, world, m/s²

  /// ≥ sup of the angle between R(t) and R(0) over the step, rad; ≤ π
  double turn() const;
  /// ≥ sup |p(t) − p(0) − t/step displacement| over the step, m.
  double travel_beside(const Vec3& displacement) const;

  // For those who record a step part by part: start_*, add_* for every part in order of time, finish.
  void start_free(const RigidMotion& origin, double step, const PrincipalInertia& inertia);
  void add_free(double begin, const FreeRotation& rotation, double since, const Vec3& momentum_W);
  void start_carried(const RigidMotion& parent, double step, const Vec3& line_axis);
  void add_carried(double begin, double angle, double angle_rate);
  /// Sets the state at the end, after the last kick; `motion.acceleration` is not read.
  void finish(const RigidMotion& motion);

 private:
  /// From `begin` to the next part's, or to the step's end.
  struct Part {
    double begin = 0.0;
    FreeRotation rotation{};  // free: attitude at t is rotation.attitude(since + t − begin)
    double since = 0.0;
    Vec3 momentum = Vec3::Zero();
    double angle = 0.0, angle_rate = 0.0;  // carried: θ = angle + (t − begin) angle_rate
    double angular_speed = 0.0;            // ≥ sup |ω| over the part
  };

  void start(const RigidMotion& motion, double step);
  const Part& part_at(double t) const;
  double end_of(const Part& part) const;
  Quaternion attitude(const Part& part, double t) const;

  double step_ = 0.0;
  RigidMotion start_, end_;
  Vec3 acceleration_ = Vec3::Zero();
  bool free_ = false;
  PrincipalInertia inertia_;        // free
  Vec3 line_axis_ = Vec3::UnitX();  // carried
  std::vector<Part> parts_;
};

}  // namespace limber
