/// @file limber/collision/time_of_impact.h
/// When two moving, flexing bodies first come together within a step, so that nothing passes through anything whatever
/// the step. Conservative advancement (Mirtich, *Impulse-based Dynamic Simulation of Rigid Body Systems*, 1996) on the
/// exact motion: time goes on by what it takes the nearest points at least to close their gap, again and again.
///
///   TimeOfImpact solver;
///   const MovingBody ball{.geometry = &sphere, .motion = &flight}, sheet{.surface = surface, .motion = &vibration};
///   const ImpactTime t = solver.find(ball, sheet, 1.0 / 60.0, 1e-4);
///
/// A stretch of time is looked at from both of its ends. Along a direction n two points whose gaps there are g₀ and g₁
/// are in between, s of the stretch having passed, no nearer than
///   (1 − s) g₀ + s g₁ − s (1 − s) B − F
/// B from bounds on all accelerations (gravity, turning, flexing), F from what is bounded as a whole: modes that swing
/// and bodies that turn within the stretch. Nodes and triangles are compared along sixteen directions at once; branch
/// and bound finds the least time. From a gap g the next is O(g²): few advancements. Derivation:
/// docs/derivations/collision.md, section 6; what comes out in touch, at rest or past grazing: docs/collision.md.
///
/// Surfaces, modal or rigid, are their triangles, two-sided, whether or not they bound a solid; balls, capsules and
/// half-spaces are solid. Triangles of one body against itself are not looked at.
#pragma once

#include <memory>
#include <span>

#include "limber/collision/aabb.h"
#include "limber/core/rigid_transform.h"
#include "limber/dynamics/exact_motion.h"

namespace limber {

class CollisionSurface;
class RigidGeometry;

/// One body of a pair: a modal surface, or a rigid geometry; moving, or not.
struct MovingBody {
  std::shared_ptr<const CollisionSurface> surface{};  ///< modal bodies
  const RigidGeometry* geometry = nullptr;            ///< rigid ones
  const ExactMotion* motion = nullptr;                ///< null: it stands still where the next two say
  RigidTransform pose{};                              ///< X_WB; not read where there is a motion
  std::span<const double> amplitudes{};
};

struct ImpactTime {
  enum class Status {
    kNone,      ///< farther apart than half the margin throughout
    kTouching,  ///< within the margin at the start: that is for contacts to deal with; time = 0
    kImpact,    ///< within the margin at `time`, and not touching before
    kResting,   ///< not touching up to `time`, but creeping up: the bounded number of advancements did not come to an
                ///< end
  } status = Status::kNone;
  double time = 0.0;     ///< s from the step's start; of kNone the step
  int advancements = 0;  ///< how many times the pair was looked at
};

struct TimeOfImpactOptions {
  int max_advancements = 128;  ///< ≥ 1
};

/// Holds the scratch of one thread; allocates nothing once warm. Same arguments, same bits.
class TimeOfImpact {
 public:
  /// @throws InvalidArgument if max_advancements < 1
  explicit TimeOfImpact(const TimeOfImpactOptions& options = {});
  ~TimeOfImpact();
  TimeOfImpact(TimeOfImpact&&) noexcept;
  TimeOfImpact& operator=(TimeOfImpact&&) noexcept;

  /// First time within [0, step] at which bodies farther apart than the margin come within it. The answer comes with
  /// the gap between half the margin and the margin: a graze that stays beyond half may be told or not. A margin below
  /// the round-off of the poses (a few ε of their distance from the world's origin) is raised to it.
  /// @param step s, ≥ 0, at most that of the motions. @param margin m, ≥ 0
  /// @throws InvalidArgument for a body that is not one of surface and geometry, and for amplitudes of wrong number or
  /// not finite, as DeformedSurface::bind()
  ImpactTime find(const MovingBody& a, const MovingBody& b, double step, double margin);
  /// The same; bodies that touch are looked at with half of the margin, a quarter and so on, as long as that is no
  /// smaller than `least`: touching are those that do so with the smallest.
  ImpactTime find(const MovingBody& a, const MovingBody& b, double step, double margin, double least);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Encloses a body throughout its step, world, m: the box of the parabola that its origin follows, widened by the body
/// about it. For the broad phase.
/// @param box_B encloses it at the step's start, body frame: DeformedSurface::bounds(0) or RigidGeometry::bounds()
/// @param shape of a modal body, SurfaceExtent::shape of its collision surface; none for a rigid one
Aabb swept(const Aabb& box_B, std::span<const double> shape, const ExactMotion& motion);

}  // namespace limber
