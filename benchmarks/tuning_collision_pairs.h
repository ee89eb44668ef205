// Pairs of bodies in fixed places, for tuning_collision: at rest, crossed, at seams, one within the other, at random.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "contact_bodies.h"
#include "narrow_phase_reference.h"

namespace limber {

/// Two bodies in one place, and what is known of their contacts.
struct TuningPair {
  std::unique_ptr<testing::Body> a, b;
  double margin;
  OverlapMethod overlap = OverlapMethod::kRestDepth;
  bool by_tets = false;                                 // the normals of tet_overlap_normals() in its place
  Vec3 ahead = Vec3::Zero();                            // expected motion of a
  std::unique_ptr<testing::PairReference> reference{};  // all contacts
  std::optional<double> upright{};                      // all normals are ±z, by as much of it
  std::optional<double> free_after{};                   // nothing is in the way of the motion ahead, by as much
};

/// Pairs of surfaces made of triangles, on such and on rigid shapes.
std::vector<TuningPair> surface_pairs();
/// Rigid convex shapes in all positions, and bricks all but flush.
std::vector<TuningPair> convex_pairs();

}  // namespace limber
