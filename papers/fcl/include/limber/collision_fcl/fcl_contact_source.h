/// @file limber/collision_fcl/fcl_contact_source.h
/// A ContactSource on FCL, the Flexible Collision Library, and libccd under it: to check ContactFinder by, to compare
/// its time with, and for those who have FCL's trees in their program already. A World or a scene takes it as it takes
/// ContactFinder:
///
///   FclContactSource source;
///   world.set_contact_source(&source);
///
/// Broad phase: FCL's DynamicAABBTreeCollisionManager. Bodies of triangles: a BVHModel of AABBs over the surface, built
/// once and refitted from the leaves up in every state, the hierarchy of [H03] section 4. Near triangles, distances of
/// points, segments and convex solids, and depths of these (libccd) are FCL's.
#pragma once

#include <memory>

#include "limber/dynamics/contact_source.h"

namespace limber {

/// What is a contact: of each vertex (of balls and capsules: centre and ends, with a radius) the local minima of its
/// distance to the other body, or, inside a solid, the nearest point that its own surface can leave by; and each pair
/// of edges whose common perpendicular leads out of both. Depths and normals of overlaps are those of the deformed
/// surface (OverlapMethod::kNearestPoint). Of two convex shapes whose features show less, libccd's depth is one more.
///
/// Unlike ContactFinder: positions are kept in world coordinates, and lose digits far from the origin; queries are
/// answered by the calling thread; FCL allocates in every query; all vertices of a modal body are made in every state;
/// expected motions widen the search and choose no normals. CollisionFilter::self is not looked at. Same calls, same
/// bits, here too. Refused (InvalidArgument): poses and amplitudes that are not finite, wrong numbers of amplitudes,
/// a margin or reach that is negative or not finite, and `states` that do not reach to every body.
class FclContactSource final : public ContactSource {
 public:
  FclContactSource();
  ~FclContactSource() override;
  FclContactSource(FclContactSource&&) noexcept;
  FclContactSource& operator=(FclContactSource&&) noexcept;

  void add_body(Index body, const BodyGeometry& geometry, const CollisionFilter& filter) override;
  void remove_body(Index body) override;
  void set_filter(Index body, const CollisionFilter& filter) override;
  void exclude_pair(Index a, Index b, bool excluded) override;
  void find_contacts(const ContactQuery& query, std::vector<ContactPoint>& contacts, Jobs& jobs) override;
  void restore_state(StateReader& state) override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limber
