/// @file limber/constraints/island_solver.h
/// One step of the bodies that constraints tie together: all rows of all kinds in one problem.
///
///   gap(f) − offset + compliance f = w,    w ⊥ bounds and cones                                                (1)
///
/// f are the rows' impulses, N·s; gap(f) the true gaps at the step's end, m or rad. Joints, limits, handles and the
/// like on free bodies act in the middle of the step: their rows are such that a gap changes by exactly J̄ (d, τ, Δz),
/// d, τ and Δz the displacement, Cayley vector and change of amplitudes of each body over the step, so that f does
/// exactly the work f · (gap − gap₀)/Δt. Newton's method finds where bodies end and f together. Velocities are then
/// brought in line with the rows at the end, which takes a little energy; where joints alone act it is given back. The
/// rotation of such a body is of second order in the step; bodies without constraints rotate exactly.
///
/// Islands with contacts
///   1. linearise the rows at the step's start (Constraint::add_rows),
///   2. give gravity and held forces to the frames at the step's start, where impulses act, so that what rests has no
///      velocity. Islands without contacts fall exactly,
///   3. predict bodies exactly under f, measure gaps and solve for Δf until gaps change by less than their tolerance,
///   4. guard the energy: where it would rise by more than the work of what drives the island, relative motion is
///      slowed, or all impulses are given up.
/// Then the prediction is committed and the constraints are told their impulses (Constraint::accept).
///
/// They solve 3 in rounds of a convex problem about the motion under the impulses at hand (the method of multipliers),
/// in which every row yields a little less in each round. The answer is (1) with Coulomb's cone.
///
/// Tolerances are the rows' own. Iterations are bounded (IslandOptions::max_iterations; 500 Newton steps for contacts).
/// A step that ends by one of these limits keeps the best impulses found, or the motion found where there are none:
/// IslandStatus::kLimit.
///
/// A step is taken in halves down to 64ths where joints and handles alone act on free bodies and it does not settle. If
/// that does not help, bodies turn and shift as the rows ask but do not bend in the rest of the step; if
/// that is not found either they stay where they are, and lose half their velocity: IslandStatus::kFailed.
///
/// Free islands keep their linear and angular momentum. Not guarded: bodies whose parents move. Methods:
/// docs/step.md. Equations and what is guaranteed: docs/derivations/constraints.md.
#pragma once

#include <functional>
#include <memory>
#include <span>

#include "limber/constraints/constraint.h"
#include "limber/constraints/island_status.h"
#include "limber/constraints/step_attempts.h"
#include "limber/core/stage_times.h"

namespace limber {

struct IslandOptions {
  double step = 1.0 / 60.0;     ///< s; that of all groups
  Vec3 gravity = Vec3::Zero();  ///< m/s², world
  int max_iterations = 100;     ///< of Newton's method on true gaps; ≥ 1
  bool guard_energy = true;     ///< 4 above
  /// Nothing but constraints and held forces has changed the members' velocities since their last step, and the rows
  /// are the same: what joints alone lose to the method is then given back.
  bool undisturbed = false;
  bool timed = false;  ///< fill IslandReport::times
  /// J: the energy error carried over from the last step, IslandReport::energy_surplus; at most 1e-7 of the energies
  /// at hand, of bodies that had no motion to take it from.
  double energy_surplus = 0.0;
};

struct IslandReport {
  IslandStatus status = IslandStatus::kSolved;  ///< of the worst part of the step
  IslandStatusCounts statuses{};                ///< the island's status; in sums, those of all islands
  /// Whether the step is taken as it is: solved, or contacts alone at a limit. What is not is tried in another way
  /// first (StepAttempt).
  bool accepted = true;
  int bodies = 0, rows = 0;
  StepAttempts attempts{};
  int iterations = 0;    ///< predictions made, in the part of the step that needed most
  int newton_steps = 0;  ///< for the contacts with friction, in the part that needed most
  /// How far the worst row is from its law, in units of its tolerance: ≤ 1 where the island is solved. It counts the
  /// signs and cones of impulses as a distance, by what an impulse moves its own gap by. Of an island that failed: of
  /// what was found before it was given up.
  double change = 0.0;
  double energy_removed = 0.0;  ///< J, by the energy guard; negative: given back
  double energy_surplus = 0.0;  ///< J, to be passed to the island's next step
  StageTimes times{};           ///< kRows, kSolve and kCommit, with IslandOptions::timed
};

/// Takes the steps of islands, one at a time, and holds the memory for that, which grows to the largest island seen;
/// after that a step allocates nothing. One thread at a time. The same call gives the same bits. make_island_solver()
/// makes limber's own; World is given others by World::set_island_solver().
class IslandSolver {
 public:
  virtual ~IslandSolver() = default;

  /// Advances the members by one step.
  /// @param table the bodies that rows name. @param members indices into it, ascending: every body the rows touch
  virtual IslandReport step(std::span<const ConstrainedBody> table, std::span<const Index> members,
                            std::span<Constraint* const> constraints, const IslandOptions& options) = 0;
};

using IslandSolverFactory = std::function<std::unique_ptr<IslandSolver>()>;

/// The solver that the head of this file describes.
std::unique_ptr<IslandSolver> make_island_solver();

}  // namespace limber
