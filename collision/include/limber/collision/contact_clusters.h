/// @file limber/collision/contact_clusters.h
/// Many contacts of two bodies, thinned to the few that carry the same forces and torques.
///
/// Contacts of like normals, within 20° of the first, are a *patch*. A patch is pushed by forces along its normal, and
/// whatever pressure acts within a convex region, some forces at the corners of that region have the same sum and the
/// same torque. So of each patch the corners are kept:
///
///  1. The *deep* contacts are those whose gap is within a thousandth of the patch's extent of its smallest gap. Of the
///  corners of their convex hull, seen along the normal, those n are kept that span the largest area. It
///     is at least (n/2π) sin(2π/n) of the hull's: 0.63 for n = 4 (E. Sas, *Über eine Extremumeigenschaft der Ellipsen*,
///     1939), and exactly the hull where this has no more than n corners. (For n > 4, corners are added to the largest
///     quadrilateral one by one.)
///  2. Where fewer than n are deep, such as where an edge rests, others are added one by one, each the one that the
///     area of all grows by most.
///  3. Bodies that bend sag between four corners. Where a contact is farther than a given spacing from all that are
///     kept, the deepest of such is kept as well, until there are none.
///
/// Contacts that were kept last time are kept again as long as their areas are at least 0.9 of those of the
/// best choice, and they cover the patch with a tenth more spacing and not many more contacts, so that warm starts find
/// them again. Two cylinders that touch along a line keep the line's ends.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "limber/dynamics/contact_source.h"

namespace limber {

struct ContactClusterOptions {
  int max_points = 4;     ///< n, most corners of a patch, ≥ 1; 0: all contacts are kept
  void validate() const;  ///< @throws InvalidArgument naming the field and its value
};

/// Seen along a patch's normal, none of its contacts that is left out is farther than this (by a tenth more where those
/// of last time are kept) from one that is kept: the lesser of both. Infinity: corners alone.
struct ContactSpacing {
  double length = std::numeric_limits<double>::infinity();  ///< m, > 0
  double share = std::numeric_limits<double>::infinity();   ///< of the patch's extent, > 0
};

/// What a contact that is kept stands for: its share φ of another one's force.
struct ContactWeight {
  Index contact = 0, kept = 0;  ///< by place in all()
  double weight = 0.0;
};

/// What is told of contacts beside which are kept.
enum class ContactShares {
  kNone,
  kWeights,          ///< all() and weights()
  kWeightsAndCells,  ///< and cell()
};

/// Holds the scratch of one thread; a warm one allocates nothing.
class ContactClusters {
 public:
  /// @throws InvalidArgument see ContactClusterOptions::validate()
  explicit ContactClusters(const ContactClusterOptions& options = {});
  ~ContactClusters();
  ContactClusters(ContactClusters&&) noexcept;
  ContactClusters& operator=(ContactClusters&&) noexcept;

  /// Thins contacts[first …], all of one pair of bodies, and leaves them ascending in id. The outcome does not depend
  /// on their order before.
  /// @param previous ids that were kept for this pair last time, ascending
  void reduce(std::vector<ContactPoint>& contacts, std::size_t first, const ContactSpacing& spacing,
              std::span<const std::uint64_t> previous, ContactShares shares = ContactShares::kNone);

  /// What reduce() was given last, ascending in id, and which contacts of it were kept.
  std::span<const ContactPoint> all() const;
  bool kept(Index contact) const;
  /// Of all contacts of patches that were thinned, by contact: seen along the patch's normal, Σ_r φ_r = 1 and
  /// Σ_r φ_r x_r = x over the kept ones r of the patch, φ_r > 0 (x the nearest point of their hull where it is
  /// outside). So forces at all contacts, given to the kept ones by φ, keep their sum and torque.
  ///
  /// Where a contact is farther than a kept one it is not pressed with it: then φ falls to 0 as the difference of their
  /// gaps grows from 5e-3 to 1e-2 of the patch's extent.
  std::span<const ContactWeight> weights() const;
  /// Of a contact of such a patch: the area of its contacts' hull that is nearer to it than to any other, m². Infinite
  /// where all of the patch lie on a line, which has no area to be shared.
  double cell(Index contact) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limber
