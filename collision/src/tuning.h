/// @file
/// Numbers of the collision module that choose a path, a tolerance or a preference: all of them, in one place.
/// docs/reports/tuning-collision.md tells what moves when each is halved and doubled; "any" below means that contacts
/// are the same throughout.
///
/// What stands where it is used: bounds of round-off, which follow from the arithmetic, and sizes of buffers.
#pragma once

#include <cstddef>

namespace limber::internal {

/// Trees of surfaces: when all vertices are made at once. They decide how fast boxes are found, not what touches.
struct HierarchyTuning {
  // BoundsChoice::kAutomatic refits where as many boxes from amplitudes would cost as much. Costs are in floats read
  // from the near cache, for k modes; fitted to times of benchmark_collision_hierarchy, 0.25 to 4 times these.
  double box_cost = 1000.0;           ///< of one box, besides ...
  double box_cost_per_mode = 48.0;    ///< ... k times this: scattered in memory, and wider than a refit's
  double vertex_cost = 6.0;           ///< of one vertex of a refit, besides ...
  double vertex_cost_per_mode = 3.0;  ///< ... k times this: three floats, which stream
  double triangle_cost = 32.0;        ///< of one triangle of a refit
  /// Boxes asked for without a refit per box asked for with one, which end the walk earlier; 1 to 2, counted.
  double boxes_without_refit = 2.0;
};

/// The list of awake bodies. They decide time alone.
struct BroadTuning {
  /// Moves per body after which insertion stops and the list is sorted anew; 2 to log2 of the bodies.
  std::size_t moves_before_sort = 8;
  std::size_t rows_per_chunk = 256;  ///< of the sweep, given to a thread at once; 64 to 1,024
};

/// Convex rigid shapes, and the distance of two hulls.
struct ConvexTuning {
  /// Part of a hull's size up to which points lie on a face; round-off to 1e-6.
  double hull_thickness = 1e-10;
  double hull_same_direction = 1e-7;  ///< length of the difference of two unit normals of one plane; 1e-10 to 1e-4
  /// Sine below which two lines are parallel: what is lost is their length times this; 1e-15 to 1e-12.
  double parallel_lines = 1e-13;
  /// GJK: part of the squared distance that a step must gain; a few round-offs of it.
  double gjk_progress = 1e-15;
  /// GJK: polytopes end after as many steps as they have features, round-off may make the last repeat; 64 and more.
  int gjk_iterations = 128;
  /// Cosine with a face's normal above which faces meet rather than an edge or a corner; 0.9 to 0.99. 0.97: 14°.
  double face_alignment = 0.97;
  /// By so much better, as a cosine, must a face of a fit the normal to be the reference: flush faces are told apart by
  /// round-off, and with the reference the names of all contacts change (docs/contact-solvers.md, forces that go on).
  double reference_preference = 1e-4;
  /// Edges decide the direction of least depth where they are less deep than faces by this factor; 0.9 to 1. Faces give
  /// steadier contacts.
  double edge_preference = 0.95;
  double least_cross = 1e-8;   ///< sine of two edges below which their cross product is no axis; 1e-12 to 1e-4
  double side_by_side = 0.17;  ///< sine of the axes of capsules that touch along their length, 10°; 0.05 to 0.3
};

/// Surfaces made of triangles.
struct NarrowTuning {
  /// Part of the shortest edges at hand below which features touch: the direction between two points tells little, the
  /// faces that lie on each other do; 1e-3 to 0.05. Set so that stacks of boxes stand (touching_faces_test.cpp).
  double touching = 0.01;
  double flat = 0.02;  ///< sine by which faces that touch along an area may be from parallel, 1°; 1e-3 to 0.1
  /// Sine by which a surface may lean against a contact's normal for the contact to count as its own, 12°; 0.1 to 0.4.
  double leaning = 0.2;
  double steep = 0.5;  ///< sine beyond which it runs through the plane that the contact stands for, 30°; > leaning, < 1
  /// Part of the shortest edges by which a plane may have been passed and still keep bodies apart: a floor of boxes
  /// need not be level to the last bit; round-off to 1e-3 (touching_faces_test.cpp).
  double passed = 1e-4;
  /// How far a direction may lean out of a crease's normal cone, per unit of |inward₁ + inward₂|: 12° at a right angle,
  /// 17° on a knife's edge, 0 on a plane; 0 to 0.3. Bodies that rock keep the crossings of their outlines.
  double rocking = 0.15;
  double leads_into = 1e-3;    ///< sine at which a direction leads into a face from its rim; 1e-6 to 1e-2
  double aligned_depth = 0.5;  ///< part of the edges up to which flush bodies are freed along other faces; 0.1 to 1
  double same_way = 0.9;       ///< cosine with a way out of the loop of crossings that go along it, 26°; 0.7 to 0.99
  double directionless = 1e3;  ///< round-offs: directions between points nearer than this are noise; 10 to 1e6
  double parallel_edges =
      1e-12;  ///< sine below which edges are parallel and their ends make the contacts; 1e-15 to 1e-6
  double parallel_touching = 1e-4;  ///< the same for edges that touch, whose common perpendicular is lost sooner
  double grazing = 1e-9;            ///< cosine with a face's normal below which a ray goes by; round-off to 1e-6
  int rest_depth_steps = 16;        ///< tetrahedra walked through to carry a point back; bodies bent too far take more
  double least_stretch = 1e-6;      ///< det F below which a tetrahedron is flat: nothing is carried back through it
  /// Part of a patch's area below which its area vectors cancel and leave no direction but round-off's; 1e-12 to 1e-2.
  double least_patch = 1e-6;
};

/// Whole queries: thinning, and the first time of impact.
struct FinderTuning {
  double unit_quaternion = 1e-6;  ///< by which the length of an orientation may differ from 1, as the header says
  std::size_t pairs_per_chunk = 4, bodies_per_chunk = 64;  ///< given to a thread at once; decide time alone
  /// Last time's contacts are kept while they cover the patch within so many spacings ...
  double kept_spacing = 1.1;
  /// ... and are at most so many, beside the best choice's, per contact that covers its middle; 0 to 1.
  double kept_surplus = 0.5;
  double kept_gap = 0.5;  ///< part of the margin that an advancement leaves, as the header says; > 0, < 1
  /// An advancement below this part of the time looked ahead asks for a nearer look: at what the bounds gave times
  /// `look_again`, at least `look_nearer` of the time before. Then `look_farther` times the last advancement is looked
  /// ahead. Times of benchmark_collision_impact; the answer is safe with any.
  double good_advancement = 0.25, look_nearer = 1.0 / 16.0, look_again = 2.0, look_farther = 4.0;
};

struct CollisionTuning {
  HierarchyTuning hierarchy{};
  BroadTuning broad{};
  ConvexTuning convex{};
  NarrowTuning narrow{};
  FinderTuning finder{};
};

inline CollisionTuning collision_tuning_in_force{};

inline const CollisionTuning& collision_tuning() { return collision_tuning_in_force; }

/// Puts other numbers in force for as long as it lives. For measurements and tests: the numbers are the process', and
/// no call of the module may run while one begins or ends.
class ScopedCollisionTuning {
 public:
  explicit ScopedCollisionTuning(const CollisionTuning& tuning) : before_(collision_tuning_in_force) {
    collision_tuning_in_force = tuning;
  }
  ~ScopedCollisionTuning() { collision_tuning_in_force = before_; }
  ScopedCollisionTuning(const ScopedCollisionTuning&) = delete;
  ScopedCollisionTuning& operator=(const ScopedCollisionTuning&) = delete;

 private:
  CollisionTuning before_;
};

}  // namespace limber::internal
