// What contacts that are kept stand for, as shares of vertices (ContactSide::region).
#pragma once

#include <array>
#include <span>
#include <vector>

#include "limber/collision/collision_surface.h"
#include "limber/collision/contact_clusters.h"
#include "limber/core/quaternion.h"
#include "limber/dynamics/contact_source.h"

namespace limber::internal {

/// Regions of some contacts, in their order; a warm one allocates nothing.
struct ContactRegions {
  std::vector<VertexShare> shares;
  std::vector<std::array<std::size_t, 2>> counts;  ///< by contact: how many shares its sides have

  void clear() { shares.clear(), counts.clear(); }
  void append(const ContactRegions& others);
  /// @pre one for each contact
  void give_to(std::span<ContactPoint> contacts) const;
};

/// One side of a pair: its surface where it yields, else null, and how its body is turned.
struct RegionSide {
  const CollisionSurface* surface = nullptr;
  Quaternion turn{};
};

/// What regions are found by. @param itself whether the body touches itself
ContactShares shares_for(const std::array<RegionSide, 2>& sides, bool itself);

/// The contact r of a patch stands for its contacts i with w_i = φ_r(i) a_i / Σ_j φ_r(j) a_j, the integral of φ_r over
/// what touches. Where one body yields, or touches itself, a_i is what a uniform pressure along the normal gives to the
/// vertex that touches: a third of the triangles about it, seen along the normal at rest. Where two do, the patch has
/// vertices of both, also beside what the other one covers: a_i is the part of the patch's hull that is nearer to i
/// than to its other contacts, and no more than a third of the triangles about i, as a hull also covers what has no
/// surface.
class RegionFinder {
 public:
  /// Appends the regions of what the clusters have kept last.
  /// @param shares as they were reduced with
  void find(const ContactClusters& clusters, ContactShares shares, const std::array<RegionSide, 2>& sides,
            ContactRegions& regions);

 private:
  struct Part {
    Index kept = 0, contact = 0;
    double area = 0.0;
  };
  void weigh(const ContactClusters& clusters, ContactShares shares, const std::array<RegionSide, 2>& sides);
  void spread(std::span<const ContactPoint> all, std::span<const Part> parts, const CollisionSurface& surface,
              std::size_t side, ContactRegions& regions);

  std::vector<double> areas_;
  std::vector<Part> parts_;
  std::vector<double> shares_;  // by vertex; zeros between calls
  std::vector<Index> touched_;
};

}  // namespace limber::internal
