/// @file limber/articulation/free_motion.h
/// How far a rigid body can go along one path before it meets another: exact first contacts, all free intervals.
///
/// A path is a rotation about a line, a translation, or a screw φ_t; t = 0 as drawn. The position t is blocked where
/// φ_t(M), the moving bodies, overlaps F, the fixed ones:
///
///   B = ⋃ {t : φ_t(a) crosses b} over the triangles a of M and b of F, and where one holds the other       (1)
///
/// Two triangles begin to cross where a corner meets a face or an edge an edge: roots in closed form (rotation,
/// translation) or bracketed (screw). So B is a list of intervals without samples and without a step size.
///
/// Parts that fit touch everywhere. So surfaces that touch as drawn and slide do not stop each other to within δ:
/// `tolerance`, with the sagitta of the facets, grown to the overlap as drawn up to `largest_overlap`. All else stops
/// where it first meets. Not seen: what sticks out by less than δ from surfaces that slide on each other.
///
/// Closed surfaces bound solids; open ones are sheets that block where they are crossed, and hide what lies behind.
/// Derivation: docs/derivations/orbits.md. Source: [X09] 3.3 bisects by collision tests; exact crossings are not in the
/// paper.
#pragma once

#include <span>
#include <vector>

#include "limber/articulation/crease_angle.h"
#include "limber/core/types.h"
#include "limber/mesh/surface_mesh.h"
#include "limber/model/joint_spec.h"

namespace limber {

/// A one-parameter rigid motion. t is in rad, or in units of length for a translation.
struct MotionPath {
  enum class Kind { kRotation, kTranslation, kScrew };
  Kind kind = Kind::kRotation;
  Vec3 origin = Vec3::Zero();  ///< a point of the axis; without meaning for a translation
  Vec3 axis = Vec3::UnitX();   ///< unit; right hand
  double pitch = 0.0;          ///< screw: advance along the axis per rad; not 0
};

/// One surface that moves or stays.
struct MotionBody {
  const SurfaceMesh* surface = nullptr;  ///< never null; triangles of either orientation
  bool closed = true;                    ///< it bounds a solid, with its caps; otherwise it is a sheet
  std::span<const Triangle> caps = {};   ///< over small holes, over the surface's vertices and turned like it
};

struct FreeMotionOptions {
  double tolerance = 0.0;        ///< δ to start with, length; ≥ 0; 0: 2e-4 of the smaller body's diagonal
  double largest_overlap = 0.0;  ///< δ at most, length; ≥ 0; 0: 2e-2 of the smaller body's diagonal
  /// rad (50°), 0 … π: a face that bends by less from the next one continues it. As in ContactRegionOptions.
  double crease_angle = kDefaultCreaseAngle;
  bool reachable_only = false;  ///< saves the work of finding `others`
  /// t, 0 in it or at its end: what stops a rotation beyond need not be found, which saves work; `reachable` may go on.
  Interval within{};
  void validate() const;  ///< @throws InvalidArgument naming the field
};

/// The end of a motion.
struct MotionStop {
  Index body = -1;            ///< of the fixed ones, in the order given; −1: nothing stops
  Vec3 point = Vec3::Zero();  ///< of the moving body, as drawn, that touches (or the fixed point, followed back)
};

struct FreeMotion {
  Interval reachable;  ///< the free interval around 0; open where nothing stops. Both ends ∞: a full turn
  /// Free intervals behind an obstacle, ascending, as far as the bodies that were looked at are all that matters; with
  /// up to four in the way in either sense these are all. Rotations: within (−π, π]
  std::vector<Interval> others;
  MotionStop low, high;      ///< what stops at the ends of `reachable`
  double tolerance = 0.0;    ///< δ as used, length
  bool overlapping = false;  ///< the bodies overlap by more than largest_overlap as drawn; such places are left out
};

/// @param moving, fixed in one frame
/// @param sagitta of the facets where the two slide on each other, length, ≥ 0: see facet_sagitta()
/// Time: sorting of the triangles in reach, and pairs of them whose orbits meet.
/// @throws InvalidArgument if an option is out of range, the axis is not a unit vector, or a screw has no pitch
FreeMotion free_motion(std::span<const MotionBody> moving, std::span<const MotionBody> fixed, const MotionPath& path,
                       const FreeMotionOptions& options = {}, double sagitta = 0.0);

/// How far the facets of a surface stay from the smooth surface they stand for, within a box: the largest w/2 ·
/// tan(α/4) over edges that bend by α less than `crease` (rad) between facets of width w.
double facet_sagitta(const SurfaceMesh& surface, const Vec3& low, const Vec3& high,
                     double crease = kDefaultCreaseAngle);

}  // namespace limber
