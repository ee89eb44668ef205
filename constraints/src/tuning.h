/// @file
/// Numbers of the constraints module that choose a path, end an iteration or set a tolerance, all of them and each
/// once. Each has its meaning, its unit where it has one, and what it rests on. [path] marks those that choose a path
/// or cap one: scripts/count counts them.
///
/// Bounds of round-off, which follow from the arithmetic, stand where they are used.
#pragma once

#include <cstddef>
#include <cstdint>

namespace limber::internal {

/// Rows: how closely they are met, and how what is out of place comes back.
struct RowTuning {
  /// Of the arms of a joint, and rad: round-off begins there.
  double joint_tolerance = 1e-11;
  double hand_tolerance = 1e-11;  ///< of the distances at hand; the same
  /// Of the arms of a contact's points. By judgement.
  double contact_tolerance = 3e-9;
  double rolling_tolerance = 1e-9;  ///< rad, to which rolling is braked. By judgement
  /// m/s and rad/s: joints and stops out of place come together at this speed. By judgement.
  double joint_recovery_speed = 1.0;
  /// Part of the overlap of contacts that is left over which a step takes away; ContactOptions::recovery_speed bounds
  /// it.
  double overlap_recovery = 0.2;
  /// Euler angles are singular at ±90° of the second: closer to it, by the determinant, their rows keep a finite size.
  /// [path]
  double least_euler_determinant = 1e-3;
  /// Part of a patch's largest second moment below which a direction tells no rotation. [path]
  double thin_patch = 1e-6;
  /// ¼(|a| + |b|)² of the rotation vectors of two attitudes, rad², up to which the turn between them is by a series of
  /// 17 terms: what is left out is 1e-18. [path]
  double series_of_turns = 16.0;
  /// Cosine of two normals below which contacts that overlap hold a part from both sides. [path] By judgement: 120°.
  double opposed_normals = -0.5;
  /// Part of ContactOptions::compliance left beside a residual compliance, which shares loads by itself.
  double compliance_beside_residual = 1.0 / 30.0;
  /// Part of the largest pivot below which indentations of different contacts are one. Far below what each contact
  /// yields.
  double indentation_pivot = 1e-10;
  /// manipulate(): directions of the matrix below this part of its largest are not in its range. [path]
  double manipulation_rank = 1e-11;
  double manipulation_tolerance = 1e-13;  ///< places are met when they change by less of the distances at hand
};

/// The parts that a step is taken in.
struct PartTuning {
  /// Of the step: parts are halved down to this where joints do not come together. [path] By judgement: below, what is
  /// left is taken as it comes.
  double shortest_divided = 1.0 / 64.0;
  /// rad: parts are halved until no body turns by more in one. [path] The mean of two attitudes is 3 % short then.
  double most_turned = 0.5;
  /// Parts longer than what is left by less than this factor take all of it, so that round-off leaves no last crumb.
  double last_part = 1.5;
  /// Rows up to which joints beside contacts are tried in the middle of the step: its matrices are dense. [path]
  std::size_t most_rows_in_the_middle = 80;
};

/// Augmented Lagrangian of contacts and what is beside them.
struct RoundsTuning {
  /// Of what an impulse moves its own row by within the step, what the row yields to it by in the first round, and the
  /// least it ever does, so that 1/c stays within the digits of the factor. The answer does not depend on them.
  double yield = 1e-3, stiffest = 1e-6;
  double slow = 0.25;           ///< an impulse that changes by more of its last change makes its row stiffer. [path]
  double stiffer = 0.1;         ///< and by this factor
  double newton_left = 0.03;    ///< of a tolerance, what Newton's method may leave of a round
  int most_newton_steps = 500;  ///< in a step. [path] Bounds the work
};

/// Newton's method on the midpoint of a step: joints, hands and limits.
struct MidpointTuning {
  int most_iterations = 40;         ///< [path] Bounds the work
  double met = 1e-2;                ///< of tolerances: gaps and impulses are then to do no work to 1e-12
  double lengths = 1e11;            ///< tolerances in a length at hand
  double length_tolerance = 1e-11;  ///< rad, and of a length
  double shrinks = 0.25;  ///< a step by an old matrix that is longer than this part of the last makes a new one. [path]
  std::size_t most_secants = 10;  ///< of Broyden's update, then a new matrix. [path]
  /// Part of what the last step's forces do above which Newton's first step begins from free flight. [path] Bodies that
  /// whip would be led to motions that break up later.
  double forces_lead = 1.0 / 32.0;
  int most_free_turn = 30;  ///< Newton steps for the turn of free flight. [path] Bounds the work
  /// Damping of redundant equalities: of what gaps are off by, the least and the largest, and the least beside
  /// contacts.
  double damping_of_gaps = 1e-3, least_damping = 1e-9, most_damping = 1e-2, least_damping_beside_contacts = 1e-6;
  double inside = 1.0 - 1e-9;  ///< of a cone or ball: an impulse below sticks. [path]
};

/// The guard of an island's energy.
struct EnergyTuning {
  /// Part of the relative kinetic energy that a step may give back, or take where little is too much: a pendulum that
  /// turns round is not to stop.
  double largest_change = 0.1;
  double patience = 1e-7;  ///< part of the energies at hand that may wait for the next step. [path]
  /// Gains above so many energies at hand are nonsense, not motion to be slowed: no digits would be left. [path]
  double nonsense = 10.0;
  double recovery_speed = 1.0;  ///< m/s: what is out of place brings even bodies at rest together about this fast
};

/// Small steps of game contact (docs/derivations/small-steps.md).
struct SmallStepTuning {
  float push_share = 0.25f;  ///< of an overlap beyond the slop that a substep undoes. By judgement
  /// m/s and rad/s: what joints are open by as a step begins comes together at this speed. By judgement.
  double recovery_speed = 1.0;
  /// Substeps in which bodies that rebound come together, and in which they part. The gap closes in the first; sweeps
  /// leave 6 % of the speed of a box that lands flat after the second, and a tenth of what is to be given after the
  /// first that parts.
  float together = 3.0f, parting = 2.0f;
  /// Rounds in which rows with bounds may take hold as well as let go; after that they let go alone. [path] Ends the
  /// rounds.
  int most_rounds = 4;
  /// Newton's steps that close joints at a step's end. [path] Bounds the work: one is enough but where links buckle.
  int most_closings = 8;
  /// Neighbours of a node of joints up to which its elimination may join them. [path] Trees need none beside those that
  /// share a body; machines of a few loops are below it.
  std::size_t most_joined = 8;
  /// Part of the static displacement, or of that of a free mass, that a mode answers with at least: its held answer
  /// comes to nothing at ω h = 2πn, and a coordinate has a size there all the same.
  double least_answer = 1e-4;
  /// Part of a row's own response that is added to its diagonal: far above what is lost to round-off in a pivot, far
  /// below what the lightest of bodies on the heaviest chain leaves.
  double regular = 1e-9;
  int most_gradients = 8;  ///< steps of conjugate gradients where joints of many loops are not joined. [path]
  /// Newton's steps for the middle momentum of a free turn. [path] Bounds the work: two or three reach round-off where
  /// a turn within a substep is resolved.
  int turn_iterations = 4;
  double least_turn_pivot =
      0.25;                     ///< of their determinant, 1 at no turn: below it a turn is not resolved. By judgement
  double turn_digits = 1e-12;   ///< of the energy of a free turn: round-off, which is not turned away
  double motion_digits = 1e-6;  ///< of energies of motions, which are in single precision
};

struct ConstraintsTuning {
  RowTuning rows{};
  PartTuning parts{};
  RoundsTuning rounds{};
  MidpointTuning midpoint{};
  EnergyTuning energy{};
  SmallStepTuning small_steps{};
};
inline constexpr ConstraintsTuning kConstraintsTuning{};

}  // namespace limber::internal
