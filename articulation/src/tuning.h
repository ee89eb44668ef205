/// @file tuning.h
/// The tuning sheet of articulation: every number that chooses a path or sets a tolerance, with its unit, its sensible
/// range and the measurement or argument behind it. Private to the articulation module.
///
/// Three kinds of numbers stand elsewhere: the options of the public headers, which are a caller's to choose; pure
/// mathematics; and bounds on round-off, which stand beside the sum whose round-off they bound.
///
/// "Case" names the drawn assembly or closed form that a number was set by. "Not measured" means that no measurement
/// led to the value. tuning_articulation (benchmarks/) tells for every number how scores change when it is halved and
/// doubled.
#pragma once

#include <cstddef>

namespace limber::internal {

/// Components and the caps of their holes.
struct PartsTuning {
  /// rad, 0 … 0.1. Two triangles of a soup that bound a narrower wedge of material, or leave a narrower gap, are two
  /// parts that touch. Case: a pin that fills its hole. Not measured.
  double soup_fold = 0.01;
  /// Part of the surface's area, 0 … 0.05: the largest hole that gets a cap. At 0.01 the winding number is on the right
  /// side of ½ from 4 % of √area on; a bottle's mouth is larger.
  double largest_hole = 0.01;
  /// Part of the surface's area, 0.01 … 0.2: all holes together. Not measured.
  double all_holes = 0.05;
};

/// How contacts are sampled.
struct SamplingTuning {
  /// Relative, 1e-9 … 1e-4: lengths and areas that differ by less are the same but for the round-off of a pose, so that
  /// which of them comes first does not depend on it. Round-off of coordinates 1e6 times the length stays below it.
  double same_length = 1e-6;
  /// Pieces, 100 … 10,000: how many there are when NearPart first asks whether most of them matter. A matter of time:
  /// the question costs a search for each piece.
  std::size_t first_look = 512;
  /// Part of the pieces' area, 0.5 … 1: cutting ends when this much of it matters. A matter of time: walls of bricks,
  /// whose faces touch all over, are cut no further.
  double matters = 0.8;
  /// A part of the wanted pieces, 4 … 20 as a divisor: by how many too many the pieces of one size may exceed it, since
  /// pieces of one size are halved together. Not measured.
  std::size_t surplus_pieces = 8;
  /// Part of a point's area, 0.5 … 1: a triangle of more has points of its own. Near 1/√2, halfway between no and one
  /// point by ratio of areas, where larger pieces change from one number of points to the next, too.
  double own_point = 0.7;
  /// Cosine, −1 … 0, of facets' normals in the search for some place that faces. Loose: the smooth normals decide
  /// later. Not measured.
  double loose_facing = -0.5;
  /// Cosine, −1 … 0, between a smooth normal and the nearest facet's: facets bend from smooth normals by half a
  /// segment, 22.5° of 8 sides, on top of the 37° of ContactRegionOptions::facing_cosine.
  double facet_facing = -0.6;
  /// Cosine, 0 … 0.7, between the way to the nearest point and a normal. 66°: as far beside the rim as a gap may vary
  /// (cluster_gaps). Case: cubes that share
  /// an edge.
  double across = 0.4;
  /// Part of the length at hand (reach or diagonal), 1e-9 … 1e-4: a shorter way has no direction.
  double shortest_way = 1e-6;
  /// Samples, 10 … 100: fewer on a side say nothing about a surface. Not measured.
  std::size_t fewest_samples = 20;
  /// A divisor, 2 … 10: the coarse look has 1/4 of the samples. A matter of time.
  std::size_t coarse_divisor = 4;
  /// Samples, 50 … 500: the coarse look has no fewer; the least that ContactRegionOptions::samples allows.
  std::size_t coarse_fewest = 100;
  /// Times the reach of the cluster that the coarse look finds, 1 … 3: how far the fine one looks. Not measured.
  double fine_reach = 1.5;
};

/// The cluster of gaps.
struct GapClusterTuning {
  /// A divisor, 10 … 200: the cluster starts from the nearest 1/50 of the samples, so that a small hinge between large
  /// faces is not swamped. Case: the door. Not measured beside it.
  std::size_t cluster_start = 50;
  /// Times the median gap, 1.5 … 5: the cluster's limit. Two round surfaces whose centres differ
  /// have gaps from 0 to twice the median; the rest is for noise.
  double cluster_gaps = 2.5;
  /// Times the median chord error, 1 … 5: the part of facets in the limit. Facets on both sides leave up to two; the
  /// rest is for noise.
  double cluster_chords = 3.0;
  /// Part of the smaller part's diagonal, 1e-5 … 1e-3: the least limit. Surfaces that touch have gap 0.
  double cluster_least = 1e-4;
  /// Squared sine, 1e-3 … 1e-2. Smooth normals of the two sides that agree less are rough: of noise, not of facets.
  /// Smooth surfaces agree better however coarse their facets (docs/joints.md, "rough").
  double rough = 3e-3;
};

/// Samples and contacts that the cluster leaves out.
struct LeftOutTuning {
  /// Part of the pairs, 0.5 … 0.9: a lean that so many share is noise or curvature and stays.
  double askew_share = 0.75;
  /// 3 … 20, of the squared sine at that share: pairs that look past each other by more are left out.
  double askew_times = 8.0;
  /// Squared sine, 5e-3 … 0.1: besides. 8°; the end face of a nut leans by 34° from the bolt's flank beside it.
  double askew_always = 0.02;
  /// Largest eigenvalue of Σ A n nᵀ / Σ A, 0.8 … 1: above it a contact is flat and guides nothing. Case: the dog as it
  /// was first drawn, where a bar passes a flange more closely than the bearing fits.
  double stray_flat = 0.95;
  /// Middle eigenvalue of the same, 0.03 … 0.3: above it a contact guides; a cylinder has ½. The same case.
  double wider_guides = 0.1;
  /// Times the nearest contact's area, 2 … 20: the wider one has more. Plates beside a small hinge must not count. The
  /// same case.
  double wider_area = 5.0;
  /// Mean squared sine between facing normals, 0.02 … 0.08: above it surfaces curve away from each other and hold
  /// nothing. Noise of 0.1 % seldom leaves more than 0.02; beads that touch have 0.1 and more.
  double most_spread = 0.03;
};

/// Rough surfaces.
struct RoughTuning {
  /// RMS thickness per width, 5e-3 … 0.05: a thinner rough contact takes its plane's normal. Not measured.
  double flat_thickness = 0.02;
  /// Part of the spread, 0.2 … 0.9: means of patches are taken if they bring it below. Noise of vertices halves; the
  /// spread of curvature does not.
  double quieter = 0.5;
  /// Cells that stand for the samples when patches are averaged, 200 … 3,000. A matter of time: each sample looks at
  /// all.
  std::size_t cells = 800;
  /// A divisor, 5 … 50: a patch is a fifteenth of the contact; with its weights it quietens as a twentieth that weighs
  /// the same throughout.
  std::size_t patches = 15;
  /// Cells, 3 … 20: a patch has no fewer. Not measured.
  std::size_t fewest_in_patch = 6;
  /// Cosine, 0 … 0.9: normals that bend more are of another face. Not measured.
  double same_side = 0.5;
};

/// Parts inside each other, and hulls.
struct InsideTuning {
  /// Length of the mean normal, 0.3 … 0.9: above it an overlap is a shallow cap (78° about its pole) and by chance. A
  /// shaft held from all round has 0.
  double one_way = 0.6;
  /// Triangles, 100 … 1,000: of more in a piece, every so-manieth is looked at for its concavity. A matter of time.
  std::size_t hull_compared = 300;
  /// Steps, 30 … 1,000, of Gilbert's iteration, whose error falls as 1/steps.
  std::size_t hull_steps = 100;
};

/// Contacts: which points of two surfaces face each other.
struct ContactsTuning {
  SamplingTuning sampling{};
  GapClusterTuning cluster{};
  LeftOutTuning left_out{};
  RoughTuning rough{};
  InsideTuning inside{};
};

/// Weights of samples.
struct WeightsTuning {
  /// Cosine, 0.7 … 0.99: normals that are alike share their weight, so that a wide plate does not drown the peg under
  /// it. Not measured.
  double similar = 0.9;
  /// Part of the whole area, 0.01 … 0.2: keeps normals that are nothing but noise from counting for much.
  /// Not measured.
  double similar_floor = 0.05;
  /// Samples that stand for all when areas are compared, 200 … 3,000. A matter of time.
  std::size_t similar_compared = 600;
};

/// Fits of axes and pitches.
struct FitsTuning {
  /// Rounds, 5 … 50, in which an axis' direction and place are improved in turn; it ends sooner at 1e-12.
  std::size_t axis_rounds = 12;
  /// Part of a motion, 1e-9 … 1e-4: one that turns by less is a translation and starts no search for an axis.
  double least_turn = 1e-6;
  /// Part of a motion, 1e-5 … 1e-2: one that turns by less is no screw.
  double screw_least_turn = 1e-3;
  /// Newton steps, 2 … 10, for the pitch over a turn; the start is 3 % off at most.
  std::size_t pitch_rounds = 4;
  /// Samples, 200 … 3,000, that are moved by a turn. A matter of time.
  std::size_t pitch_compared = 800;
  /// Samples, 20 … 200: fewer that come to lie on the contact tell no pitch.
  std::size_t pitch_fewest = 50;
  /// Cosine, 0.8 … 0.99: facets that bend by more (18°) do not come to lie on each other.
  double pitch_alike = 0.95;
  /// Part of the advance of a turn, 0.03 … 0.3: points further away lie beyond the contact's end.
  double pitch_nearest = 0.1;
  /// Relative, 0.03 … 0.3: a pitch that changes by more was no start. Facets' own normals are up to 3 % off.
  double pitch_change = 0.1;
};

/// Judging which motion slips.
struct JudgingTuning {
  /// Probability, 1e-6 … 1e-2: no motion slips more or less surely, so that one measurement does not decide alone.
  double tail = 1e-4;
  /// Times the contact's RMS radius, 2 … 10: a centre further off is a plane in disguise. Not measured.
  double far_centre = 4.0;
  /// Times the same, 5 … 50: an axis further off is a translation in disguise. Not measured.
  double far_axis = 15.0;
  /// Log evidence, 3 … 20, that far centres and axes, and what another method does not name, lose: 5e-5 of the odds.
  double ruled_out = 10.0;
  /// Part of the plain motion's μ, 0.05 … 0.5: a screw must slip better by that much. Plain motions are common.
  double screw_clearly = 0.15;
  /// μ, 1e-4 … 1e-3: a plain motion that slips this well needs no screw. Not
  /// measured.
  double screw_least = 3e-4;
  /// Log evidence, 2 … 10, that a plain rotation loses where a screw is found.
  double screw_over_plain = 5.0;
  /// Singular value, 0.05 … 0.5: a motion that turns by more is a rotation, for SlippageMethod::kFixedRatio, of which
  /// [X09] does not say it. Not measured.
  double ratio_turns = 0.2;
};

/// Hypotheses beside the first.
struct OtherHypothesesTuning {
  /// Samples that stand for all when faces are compared, 100 … 2,000. A matter of time.
  std::size_t stop_compared = 400;
  /// Cosine, 0.8 … 0.99: 18°, one face.
  double stop_alike = 0.95;
  /// Part of the face's area, 0 … 0.1: nothing looks against a stop; a few stray samples may.
  double stop_against = 0.02;
  /// Part of the contact's area, 0.005 … 0.1: a smaller face is no stop.
  double stop_least = 0.02;
  /// Cosine, 0.95 … 1: what would slide does so along the stop's normal.
  double stop_along = 0.99;
  /// Samples, 20 … 200: fewer beside the stop tell no slide.
  std::size_t stop_fewest = 40;
  /// Part of the confidence, 0 … 0.5. A choice: a drawer at its stop and a peg in a blind hole look alike.
  double stop_share = 0.3;
  /// Relative, 0.02 … 0.09: second moments of a round face differ by less. An ellipse of 1.10 has 0.095.
  double round_moments = 0.05;
  /// Part of radii, 0.88 … 0.98: the least of a round face's outline over the most. An octagon has 0.92, a hexagon
  /// 0.87, the ellipse 0.91.
  double round_radii = 0.9;
  /// Sectors of the outline, 24 … 96: enough that an octagon's corners and flats fall apart.
  std::size_t round_sectors = 48;
  /// Part of the confidence, 0 … 0.5. A choice: a flange whose bearing is not drawn and a puck on a table look alike.
  double round_share = 0.2;
  /// Confidence, 1e-6 … 0.05: hypotheses after the second are told from here on.
  double worth_telling = 1e-3;
};

/// The line about which surfaces of two parts turn into themselves. Cases: KUKA's robots, whose 18 flanges all have
/// their axis so (benchmarks/robot_joints.py).
struct CommonLineTuning {
  /// Lines of normals, 200 … 3,000, the heaviest ones, that a place of the line is held against. A matter of time.
  std::size_t compared = 800;
  /// Of these, 20 … 200, those whose crossings are tried. A matter of time.
  std::size_t paired = 64;
  /// Part of the radius looked at, 1e-4 … 5e-3: a line that passes by more does not meet.
  double off = 1e-3;
  /// Part of the weight, 0.01 … 0.2: the least of both directions across the line; a full turn has 0.5.
  double least_turn = 0.05;
  /// Part of the smaller part's diagonal, 0.2 … 1: the radius looked at.
  double near = 0.5;
  /// Cosine, 0.9 … 0.999: flat contacts that look more different ways do not all rest under one weight.
  double one_way = 0.99;
};

/// Frames and chains.
struct FramesTuning {
  /// Cosine, 0.7 … 0.99: the contact's widest direction fixes a frame unless it lies along the axis. Either of two
  /// answers is right.
  double frame_aligned = 0.9;
  /// 1e-9 … 1e-3: a shorter part across the axis has no direction.
  double frame_across = 1e-6;
  /// Pivot, 1e-4 … 1e-2: constraints of a chain are dependent below it. Axes are known to about a degree.
  double independent = 1e-3;
  /// Columns, 300 … 3,000: of more, the rank comes from a sparse factor. A matter of time.
  std::size_t dense_columns = 1200;
};

/// Types: which motions slip.
struct TypesTuning {
  WeightsTuning weights{};
  FitsTuning fits{};
  JudgingTuning judging{};
  OtherHypothesesTuning others{};
  CommonLineTuning line{};
  FramesTuning frames{};
};

/// Tolerances of a range, and which pairs it looks at.
struct LimitsTuning {
  /// Part of the smaller body's diagonal, 1e-5 … 1e-3: δ to start with, where the caller gives none.
  double tolerance = 2e-4;
  /// Part of the smaller body's diagonal, 5e-3 … 0.05: δ at most, where the caller gives none. `limber-joints
  /// --overlap`.
  double largest_overlap = 2e-2;
  /// Part of `tolerance`, 1e-4 … 0.1: δ of surfaces that do not touch as drawn, for round-off.
  double nudge = 1e-2;
  /// Pairs of bodies in either sense that are looked at first, and how many times as many next; 2 … 16. A matter of
  /// time: 900 pins on a plate take 46 s, and 134 s with all at once (docs/range-of-motion.md, "Many parts").
  std::size_t nearest_pairs = 4, pairs_growth = 4;
  /// Part of the contact's box, 0.005 … 0.1: the other part's surface lies beside the contact's points.
  double contact_margin = 0.02;
  /// Halvings of the step, 2 … 10, in which the narrowest swing of a cone is sought: 30° / 2⁵ = 1° with 12 directions.
  std::size_t cone_refinements = 4;
};

/// Surfaces that slide, and those that stand against the motion.
struct AgainstTuning {
  /// Tangent, 1 … 5: the steepest slope at which any surface is a stop. Beyond, what the motion runs against all over
  /// is one. Case: the collar of a screw.
  double slope = 2.0;
  /// Sine, 0.005 … 0.05: a face that the motion runs against by less than 1° may be noise.
  double one_sided = 0.0175;
  /// rad, 0.02 … 0.3: pieces of curves in the orbit plane turn by no more; they leave their chord by less than 1/16 of
  /// the sagitta of a facet of 32.
  double curve_turn = 0.1;
  /// 1.05 … 2: steps in which δ grows to the overlap as read. δ is too generous by one step at most.
  double overlap_growth = 1.25;
};

/// Parts that engage, as gears do.
struct EngagedTuning {
  /// Part of the smaller body's diagonal, 0.01 … 0.1: parts engage where either stops the other both ways within this
  /// way of the place where they touch. Teeth of a gear of 16 are 0.2 apart.
  double play = 0.05;
  /// rad, 0.02 … 0.2: the longest step. A tooth of a gear of 32 is as wide.
  double longest_turn = 0.1;
  /// Part of the play, 0.1 … 0.45: by how much its middle may miss the place foreseen; at 0.5 parts touch.
  double most_miss = 0.375;
  /// Part of the play, below `most_miss`: steps that miss by less are doubled.
  double small_miss = 0.1;
  /// Part of half the play, 1e-3 … 0.1: where steps as short do not go on, the way ends.
  double least_step = 0.02;
};

/// Ranges of motion: where a path is blocked.
struct RangesTuning {
  LimitsTuning limits{};
  AgainstTuning against{};
  EngagedTuning engaged{};
};

struct Tuning {
  PartsTuning parts{};
  ContactsTuning contacts{};
  TypesTuning types{};
  RangesTuning ranges{};
};

/// The process-wide value. Measurements and tests put other numbers in its place, while nothing of the module runs.
inline constinit Tuning tuning_in_use{};

inline const Tuning& tuning() { return tuning_in_use; }

}  // namespace limber::internal
