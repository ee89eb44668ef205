// When two bodies that move straight on, turn evenly and bend evenly first come together, so that nothing passes
// through anything however far it comes. Conservative advancement (Mirtich, *Impulse-based Dynamic Simulation of Rigid
// Body Systems*, 1996): time goes on by what it takes the nearest points at least to close their gap, again and again.
//
// A stretch of time is looked at from both of its ends. Along a direction n two points whose gaps there are g₀ and g₁
// are in between, s of the stretch having passed, no nearer than
//   (1 − s) g₀ + s g₁ − s (1 − s) B − F
// B from bounds on the accelerations of points that turn and bend, F from what is bounded as a whole: skins, and bodies
// that turn far within the stretch. Nodes and triangles are compared along sixteen directions at once; branch and bound
// finds the least time. From a gap g the next is O(g²): few advancements. Derivation: docs/derivations/collision.md,
// section 5.
//
// Surfaces are their triangles, two-sided, whether or not they bound a solid; balls and capsules are solid. Triangles
// of one body against itself are not looked at.
#pragma once

#include <array>
#include <optional>

#include "manifold/moving_side.h"

namespace limber::internal {

struct ImpactTime {
  enum class Status {
    kNone,      ///< farther apart than half the margin throughout
    kTouching,  ///< within the margin at the start: that is for contacts to deal with; time = 0
    kImpact,    ///< within the margin at `time`, and not touching before
    kResting,   ///< not touching up to `time`, but creeping up: the bounded number of advancements did not come to an
                ///< end
  } status = Status::kNone;
  double time = 0.0;     ///< from the start; of kNone the whole way
  int advancements = 0;  ///< how many times the pair was looked at
};

/// Holds the scratch of one thread; allocates nothing once warm. Same arguments, same bits.
class TimeOfImpact {
 public:
  /// First time within [0, length] at which bodies farther apart than the margin come within it. The answer comes with
  /// the gap between half the margin and the margin: a graze that stays beyond half may be told or not. A margin below
  /// the round-off of the poses (a few ε of their distance from the world's origin) is raised to it.
  /// @param length ≥ 0. @param margin m, ≥ 0. @pre neither is a half-space; finite numbers
  ImpactTime find(const MovingBody& a, const MovingBody& b, double length, double margin);
  /// The same; bodies that touch are looked at with half of the margin, a quarter and so on, as long as that is no
  /// smaller than `least`: touching are those that do so with the smallest.
  ImpactTime find(const MovingBody& a, const MovingBody& b, double length, double margin, double least);

 private:
  /// What holds while a stretch lasts.
  struct Stretch {
    double duration = 0.0;
    std::array<Vec3, 2> apart{Vec3::Zero(), Vec3::Zero()};  // from b's origin to a's, at both ends
    double offset = 0.0, doubt = 0.0, round_off = 0.0;      // m
    SlabWay way;
  };
  /// One look at it: parts of it, and gaps, m.
  struct Look {
    double kept = 0.0, margin = 0.0, best = 1.0, pruned = 1.0, nearest = 0.0;
    int visits = 0;
  };
  enum class Seen { kClear, kTouching, kTooMuch };
  /// Nodes, or leaves and items of them.
  struct ItemPair {
    Index m, n, i, j;
  };
  struct Entry {
    Index m, n;
    double part;
  };

  double start(const MovingBody& a, const MovingBody& b, double length);
  void go_to(double t, double until);
  void look_ahead(double t, double until);
  void choose_directions();
  Seen advancement(double kept, double margin, double& time);
  Seen walk();
  bool pruned(double part);
  double earliest(const PlacedPart& one, const PlacedPart& other) const;
  Entry entry(Index m, Index n) { return {m, n, earliest(a_.node(m), b_.node(n))}; }
  Seen visit(Index m, Index n);
  Seen visit(const MovingSide::Item& one, const MovingSide::Item& other, double bend);
  double bend_of(const ItemPair& pair);

  MovingSide a_, b_;
  double thickness_ = 0.0;
  Stretch stretch_;
  Look look_;
  std::optional<ItemPair> last_;  // whose time was the least: likely to be it again
};

}  // namespace limber::internal
