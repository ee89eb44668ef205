/// @file
/// Numbers of the collision module that choose a path, a tolerance or a preference, all of them, each once; [path] and
/// scripts/count: those that choose a path or cap one. Each has meaning, unit, a sensible range and what it rests on.
/// tuning_collision (benchmarks/) halves and doubles each and tells how contacts change. "Steady" below: nothing moves.
///
/// Bounds of round-off, which follow from the arithmetic, and sizes of buffers stand where they are used.
#pragma once

#include <cstddef>

namespace limber::internal {

/// Lists of many bodies. These decide time alone. Steady.
struct BroadTuning {
  /// Moves per body after which insertion stops and the list is sorted anew [2 to log2 of the number of bodies].
  std::size_t moves_before_sort = 8;
  std::size_t rows_per_chunk = 256;  ///< of the sweep, for a thread at a time [64 to 1,024]
};

/// Convex rigid shapes, and the distance of two hulls.
struct ConvexTuning {
  /// Part of a hull's size up to which a point lies on a face [1e-14 to 1e-6]: far above round-off, far below any
  /// corner that is meant. Steady. [path]
  double hull_thickness = 1e-10;
  /// Length of the difference of two unit normals or directions that are one [1e-12 to 1e-4]; so too. [path]
  /// Steady.
  double hull_same_direction = 1e-7;
  /// Sine below which two lines are parallel [1e-15 to 1e-11]: lost is their length times this. [path] Steady.
  double parallel_lines = 1e-13;
  /// GJK: part of the squared distance that a step must gain [some round-offs, 2.2e-16 each]. Steady.
  double gjk_progress = 1e-15;
  /// GJK: most steps [≥ 64]. [path] Polytopes take as many as they have features; round-off may make the last repeat.
  /// Steady.
  int gjk_iterations = 128;
  /// Cosine with a face's normal, 14°, from which faces meet, not an edge or a corner [7° to 30°]. [path] By judgement:
  /// 76 of 11,696 contacts come or go at half the angle, none gets another depth.
  double face_alignment = 0.97;
  /// Cosine by which a face of a must fit the normal better to be the reference [1e-8 to 1e-3]: flush faces are told
  /// apart by round-off, and with the reference the ids of all contacts change (NarrowPhase.BricksThatLieFlush...).
  /// Steady. [path]
  double reference_preference = 1e-4;
  /// Edges decide the direction of least depth where their depth is below this part of the faces' [0.9 to 1]: faces
  /// give steadier contacts. By judgement. [path]
  double edge_preference = 0.95;
  /// Sine of two edges below which their cross product is no axis [1e-12 to 1e-4]: faces bound it. [path] Steady.
  double least_cross = 1e-8;
  /// Faces of each times corners of the other up to which their planes are asked first, before the distance is searched
  /// for [100 to 1,000]: boxes have 96. Decides time alone.
  std::size_t most_face_tests = 400;
  double side_by_side = 0.17;  ///< sine, 10°, up to which capsules touch along their length [0.05 to 0.3]. [path]
};

/// Surfaces made of triangles. "Edges at hand" are the shortest ones around a vertex and of the face it meets.
struct NarrowTuning {
  /// Part of the edges at hand below which features touch [1e-3 to 0.05]. [path] There faces on each other give the
  /// normal, as the direction between two points is noise. Half of it turns the corners of flush boxes sideways.
  double touching = 0.01;
  double flat = 0.02;  ///< sine, 1.1°, up to which faces lie on each other [0.01 to 0.1]. [path] Half: boxes tilted as
                       ///< much have sideways normals
  /// Sine, 12°, by which a surface may lean against a contact's normal of its own [0.1 to 0.4]. [path] Steady.
  double leaning = 0.2;
  /// Sine, 30°, from which a surface runs through the plane of its contact [15° to 60°]. Steady; at
  /// 90°, which is never, flush boxes are pushed out sideways. [path]
  double steep = 0.5;
  /// Part of the edges at hand by which a plane may have been passed and still keeps bodies apart [1e-6 to 1e-3]:
  /// floors of boxes need not be level to the last bit. Seams that are farther off than this stop what slides. [path]
  double passed = 1e-4;
  /// How far a direction may lean out of a crease's normal cone, per unit of |inward₁ + inward₂|: 12° at a right angle,
  /// 17° on a knife's edge, 0 on a plane [0 to 0.3]. Rocking bodies keep the crossings of their outlines. By judgement:
  /// with 0 the contacts are the local minima alone. [path]
  double rocking = 0.15;
  double leads_into = 1e-3;  ///< sine at which a direction leads from a face's rim into it [1e-6 to 1e-2]. [path]
  /// Part of the edges at hand up to which bodies with flush sides are freed along other faces [0.1 to 1]: deeper, the
  /// nearest side is the way out. By judgement. [path]
  double aligned_depth = 0.5;
  /// Cosine, 26°, with a way out of a loop of intersection within which a crossing of edges goes that way [13° to 40°].
  /// By judgement: bars laid across each other rest on all four crossings. [path]
  double same_way = 0.9;
  double directionless = 1e3;  ///< round-offs of a length below which a direction is noise [10 to 1e6]. [path]
  /// Sine below which touching edges are parallel and their ends make the contacts [1e-6 to 1e-2]. [path]
  double parallel_touching = 1e-4;
  double grazing = 1e-9;      ///< cosine with a face's normal below which a ray goes by [1e-12 to 1e-6]. [path]
  int rest_depth_steps = 16;  ///< tetrahedra walked to carry a point back to the rest shape [≥ 8]. [path]
  double least_stretch =
      1e-6;  ///< det F up to which a tetrahedron is flat and carries nothing [1e-12 to 1e-3]. [path] Steady.
  /// Part of its area below which a patch's area vector is round-off [1e-12 to 1e-2]. [path] Steady.
  double least_patch = 1e-6;
};

/// Whole queries.
struct FinderTuning {
  double unit_quaternion = 1e-6;  ///< by which the length of an orientation may differ from 1: a promise of the header
  std::size_t pairs_per_chunk = 4, bodies_per_chunk = 64;  ///< for a thread at a time [1 to 1,000]; time alone. Steady.
};

/// Bodies that come far, and the first time of impact.
struct ImpactTuning {
  /// Part of the thinner body's thickness at which bodies that come far touch [1e-4 to 1e-2]: what goes by farther off
  /// meets nothing.
  double touch = 1e-3;
  int touches_on_the_way = 4;  ///< of a pair that comes far, at most [1 to 16]. [path] Bounds its time
  /// How many times the nearest points of a pair of convex shapes are searched to follow it to its next touch, and how
  /// many steps it goes along the line of these before the next search [16 to 256]; one that is not followed to its end
  /// counts as touching there. Steady. [path]
  int looks_on_the_way = 64;
  double kept_gap = 0.5;  ///< part of the margin that an advancement leaves [0.25 to 0.75]: a promise of the header
  /// An advancement below `good_advancement` [0.1 to 0.5] of the time looked ahead asks for a nearer look: at
  /// `look_again` [1 to 4] times what the bounds gave, at least `look_nearer` [0.01 to 0.2] of the time before. After
  /// an advancement, `look_farther` [2 to 10] times it is looked ahead. Advancements change by a sixth at most at half
  /// and twice; the answer is safe with any.
  double good_advancement = 0.25, look_nearer = 1.0 / 16.0, look_again = 2.0, look_farther = 4.0;
  /// A look that has compared so many pairs of triangles [16 to 1,000] is broken off for a nearer one, as long as what
  /// is not known of the motion is more than a part [0.1 to 1] of the least gap seen.
  int visits_of_a_look = 48;
  double fine_doubt = 0.25;
  int most_advancements = 128;  ///< of a pair of surfaces, like `looks_on_the_way` [64 to 1,000]. [path]
  /// What comes later than this part [0.5 to 0.95] of the best time seen is left for the next look.
  double worth_a_look = 0.9;
};

/// Manifolds of pairs that live from step to step.
struct ManifoldTuning {
  /// What was kept counts as this much farther out [1 to 1.5] and, by part of the patch's extent, deeper [0 to 1e-2],
  /// so that round-off does not change contacts. By judgement. [path] for each
  double kept_distance = 1.1, kept_depth = 1e-3;
  double like_normals = 0.94;  ///< cosine, 20°, from which contacts are of one patch [10° to 30°]. [path]
  /// Length of the difference of normals of faces that are flush, or of one face [1e-4 to 1e-2]. [path]
  double same_normal = 1e-3;
  double leaning = 1e-3;  ///< sine by which what meets at a feature may lean out of its cone [1e-6 to 1e-2]. [path]
  /// Sine up to which triangles of a mesh lie in one plane [1e-6 to 1e-3]: far above the round-off of coordinates in
  /// single precision. [path]
  double one_plane = 1e-4;
};

/// Contacts by samples of one surface in the distance field of another.
struct FieldTuning {
  int cells = 48;  ///< of the grid of distances, along its longest side [24 to 96]
  /// Part of a surface's area that may bound walls thinner than two cells [0 to 0.2]; with more the body is left to
  /// triangles. [path]
  double thin_area = 0.1;
  int lattice_cells = 8,
      least_lattice_cells = 3;   ///< of displacements, along the longest side and the others [4 to 16]
  double lattice_beyond = 0.04;  ///< by which part of the longest side the lattice goes beyond the surface [0 to 0.2]
  /// Sine of the angle at which the surface turns outwards at an edge, up to which the edge touches no other [0 to
  /// 0.1]. [path]
  double least_turn = 1e-3;
  /// Displacements up to this part of a cell are not undone before the field is asked [0.25 to 1]; up to that of the
  /// longest side in one step, above in two [0.01 to 0.05]. [path] for each
  double carried_from = 0.5, carried_once = 0.02;
  /// Part of a cell that the field may be off by [0.5 to 0.9]: so much it is at the corner of a box that lies in the
  /// middle of a cell, 0.3 at its edges. [path]
  double slack = 0.5;
  /// Sine, 64°, by which a vertex's surface may lean back from the plane by which it leaves [0.7 to 0.95]. [path]
  double leaning = 0.9;
  double least_patch = 0.1;  ///< of its area below which a patch's area vector is no direction [0.01 to 0.3] [path]
  /// Of the other body's longest side, cells of a field that is fine enough for it [4 to 16]. [path] Otherwise
  /// triangles.
  double cells_of_the_other = 8.0;
  /// Directions along which it is looked whether bodies stay apart, half as many of a pair that was looked at in the
  /// last query [4 to 16]: time alone, but for what goes by.
  int looks_apart = 8;
  double looked_enough = 0.98;  ///< of their distance, the best gap at which none is looked at any more: time alone
};

struct CollisionTuning {
  BroadTuning broad{};
  ConvexTuning convex{};
  NarrowTuning narrow{};
  FinderTuning finder{};
  ImpactTuning impact{};
  ManifoldTuning manifold{};
  FieldTuning field{};
};

/// The process-wide value. Measurements and tests put other numbers in its place, while nothing of the module runs.
inline constinit CollisionTuning collision_tuning_in_use{};

inline const CollisionTuning& collision_tuning() { return collision_tuning_in_use; }

}  // namespace limber::internal
