/// @file limber/articulation/contact_region.h
/// Contact of two components: the part of each surface that faces the other across a small gap.
///
///   const std::vector<ContactRegion> regions = find_contact_regions(assembly, {.samples = 6000});
///
/// Samples are spread evenly by area over the parts of each surface that may lie near the other and face it; each has
/// the nearest facing point of the other surface. The usual method takes for contact the cluster grown from the
/// smallest gaps (2.5 times its median gap and what facets add), so that a small hinge is not lost among large faces
/// that run side by side further apart. Left out are samples whose nearest point lies beside rather than across, that
/// look past each other while most do not, or behind a third component. If no surface faces another, one closed
/// component may lie inside the other: ContactRegion::overlapping.
///
/// A pair has no contact where fewer than 20 samples a side are left, the median gap is above `largest_gap`, or only
/// edges look at each other. Points are placed alike on triangles of one shape, so pose, scale and order do not matter.
///
/// Lengths in the input's own unit. Time grows with samples · log(triangles) for a pair; pairs are found by their
/// boxes. Method: docs/derivations/slippage.md, section 1; the paper's hulls there in section 5.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "limber/articulation/assembly.h"
#include "limber/articulation/crease_angle.h"
#include "limber/core/jobs.h"

namespace limber {

/// A point of one surface that faces the other.
struct ContactSample {
  Vec3 point;          ///< on its own surface; of a rough one the mean of a patch
  Vec3 normal;         ///< outward, smooth across edges blunter than the crease angle; unit
  Vec3 facing_point;   ///< nearest facing point of the other surface
  Vec3 facing_normal;  ///< the other surface's outward normal there; unit
  double area = 0.0;   ///< of the surface that this sample stands for
  double gap = 0.0;    ///< distance to the other surface along −facing_normal; negative where the surfaces overlap
  /// The sample as it was drawn: a point of a triangle and the triangle's own normal. Off by up to half a segment, but
  /// to both sides alike
  Vec3 facet_point = point, facet_normal = normal;
};

/// The contact of two components: samples of both sides.
struct ContactRegion {
  Index a = 0, b = 0;                     ///< components, a < b
  std::vector<ContactSample> on_a, on_b;  ///< either may be empty (a pin drawn through a solid block has only itself)
  double gap = 0.0;                       ///< median distance
  double normal_spread = 0.0;  ///< mean squared sine of the angle between a normal and the opposed one it faces
  double chord_error = 0.0;    ///< how far the facets are from the smooth surface they stand for
  double extent = 0.0;         ///< diagonal of the box around the samples
  bool overlapping = false;    ///< found as surface inside the other solid, not as surfaces that face each other
};

enum class ContactSearch {
  kNearest,  ///< facing samples in a cluster grown from the smallest gaps
  /// After [X09] 3.1: parts are cut into nearly convex pieces; what of each surface lies in a slightly grown hull of
  /// the other's pieces and faces it there is the contact, whatever its gap.
  kHulls,
};

struct ContactRegionOptions {
  ContactSearch method = ContactSearch::kNearest;
  int samples = 3000;           ///< wanted on each side; 100 … 100,000
  double facing_cosine = -0.8;  ///< normals whose product is below face each other; −1 … 0
  /// rad (50°), 0 … π: sharper edges stay sharp in the normals. As in FreeMotionOptions.
  double crease_angle = kDefaultCreaseAngle;
  double search = 0.025;       ///< largest gap, of the smaller component's diagonal; > 0
  double largest_gap = 0.025;  ///< largest median gap, of the contact's own extent; > 0. A wider one is no contact
  double hull_growth = 0.01;   ///< kHulls: of the smaller component's diagonal; > 0, at most `search`
  double concavity = 0.01;     ///< kHulls: of a piece at most, of its component's diagonal; > 0
  void validate() const;       ///< @throws InvalidArgument naming the field
};

/// Contacts of all pairs of components, ordered by (a, b). Pairs without a contact are absent.
/// Parallel over pairs and over components; the same bits for any thread count.
/// @param progress called from the calling thread with the part done (0 … 1, ascending); may be empty
std::vector<ContactRegion> find_contact_regions(const Assembly& assembly, const ContactRegionOptions& options = {},
                                                Jobs& jobs = serial_jobs(),
                                                const std::function<void(double)>& progress = {});

}  // namespace limber
