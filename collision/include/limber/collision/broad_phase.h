/// @file limber/collision/broad_phase.h
/// Which of thousands of bodies may touch: pairs of bodies whose bounding boxes come near each other.
///
/// Awake bodies stand in a list sorted along one axis, kept from query to query (sort and sweep: Baraff, *Dynamic
/// Simulation of Non-Penetrating Rigid Bodies*, 1992; Cohen et al., *I-COLLIDE*, 1995), and are swept in vectors.
/// Bodies that sleep stand in a tree of boxes, which is touched only where an awake body comes near: they cost nothing
/// else. Half-spaces and boxes without end stand apart and are tested with every awake body.
///
///   BroadPhase broad_phase;
///   broad_phase.add(0), broad_phase.add(1);
///   broad_phase.set_box(0, {{0, 0, 0}, {1, 1, 1}});
///   broad_phase.set_half_space(1, {.normal = {0, 0, 1}});
///   std::vector<BodyPair> pairs;
///   broad_phase.find_pairs(0.01, pairs, serial_jobs());   // {0, 1}
#pragma once

#include <compare>
#include <memory>
#include <vector>

#include "limber/collision/aabb.h"
#include "limber/core/jobs.h"
#include "limber/dynamics/contact_source.h"
#include "limber/model/shape.h"

namespace limber {

struct BodyPair {
  Index a = -1, b = -1;  ///< a < b
  friend auto operator<=>(const BodyPair&, const BodyPair&) = default;
};

/// Bodies are known by indices of the caller's choice, ≥ 0; memory grows with the largest.
class BroadPhase {
 public:
  BroadPhase();
  ~BroadPhase();
  BroadPhase(BroadPhase&&) noexcept;
  BroadPhase& operator=(BroadPhase&&) noexcept;

  /// A body meets nothing until it has a box or a half-space.
  /// @throws InvalidArgument if the index is negative or holds a body
  void add(Index body, const CollisionFilter& filter = {});

  // These throw InvalidArgument for an index that holds no body.
  void remove(Index body);
  void set_filter(Index body, const CollisionFilter& filter);
  /// Forgotten when either body is removed. @throws InvalidArgument also for a == b
  void exclude_pair(Index a, Index b, bool excluded);

  /// Where an awake or sleeping body now is, world, m. Sides may be infinite.
  /// @throws InvalidArgument for a box that is empty or has a side that is no number
  void set_box(Index body, const Aabb& box);
  /// In world coordinates. @throws InvalidArgument for a normal that is not of length 1 or an offset that is not finite
  void set_half_space(Index body, const HalfSpace& half_space);
  /// Bodies are awake until told otherwise. Falling asleep and waking take O(log n).
  void set_asleep(Index body, bool asleep);

  /// Replaces `pairs` by those that come within `margin` (m, ≥ 0) of each other along each axis (of a half-space: along
  /// its normal), pass both filters, are not excluded and do not both sleep; ascending. Two half-spaces are no pair.
  /// The same pairs for any Jobs. Allocates nothing once warm.
  void find_pairs(double margin, std::vector<BodyPair>& pairs, Jobs& jobs);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limber
