// The way of two bodies past each other until the next query: to where they first touch, and on along what they touch.
//
// A contact is a plane between features, good as far as a body is thick. What comes farther is followed to its touch by
// conservative advancement (of cores, else TimeOfImpact), straight on and evenly as BodyState tells; the features that
// meet are those there. What of the way would go into them is left out, and the rest is followed as well.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "manifold/pair_finder.h"
#include "manifold/time_of_impact.h"

namespace limber::internal {

class SweptPath {
 public:
  /// Whether two bodies come farther against each other than contacts found where they are now are good for.
  static bool is_needed(const PairQuery& query);
  /// Gaps up to here may close at the start by what is not known of the way, m.
  static double near_at_start(const PairQuery& query);
  /// The gap at which two bodies touch, m.
  static double margin(const PairQuery& query);

  /// @param query kept by reference
  void begin(const PairQuery& query);
  /// Goes on to the next touch. @return false: there is none
  bool advance();
  double time() const { return time_; }  ///< the share of the way that is behind them
  /// The pair where it is, to be asked for its contacts; holds until the path goes on.
  PairQuery query() const;
  /// Parts the two by the margin along contacts at hand, and leaves out what of their way would close these.
  void turn_aside(std::span<const FeatureContact> contacts);

 private:
  /// One body: as it is on its way, with what is left of it.
  struct Side {
    BodyState state;
    std::vector<double> amplitudes, rates;
    bool moves = false;
    std::vector<Vec3> points;  // of its core, world

    void begin(const BodyState& from);
    void go(double share);
    RigidTransform after(double share) const;
    std::span<const Vec3> points_after(double share, const ConvexCore& core);
    MovingBody moving(const ManifoldBody& body) const;
  };

  ImpactTime touch_of_cores(double left, double least);
  double turning_towards(const Vec3& normal) const;
  double gap_along(const Vec3& normal, const RigidTransform& X_WA, const RigidTransform& X_WB) const;
  bool pass_beside(double left) const;
  bool keeps_apart(const Vec3& normal, double left) const;
  Vec3 way() const;
  Vec3 pair_b_in_a() const;

  const PairQuery* pair_ = nullptr;
  std::array<Side, 2> sides_;
  double time_ = 0.0;
  double margin_ = 0.0;  // m
  TimeOfImpact impacts_;
};

}  // namespace limber::internal
