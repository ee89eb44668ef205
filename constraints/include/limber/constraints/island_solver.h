/// @file limber/constraints/island_solver.h
/// One step of the bodies that constraints tie together: all rows of all kinds in one problem.
///
///   1. rows J are linearised at the step's start
///   2. what the rows answer to gravity and other held forces, A_r μ + a ⊥ bounds, goes to the frames by halves, at
///      the step's start and, with the rows there, at its end; to the modes as a held force
///   3. the bodies are predicted, exactly, under the impulses f found so far; the rows' true gaps are measured
///   4. f changes by the solution of  A Δf + gap − offset + compliance f ⊥ bounds,  A = J diag(Δt M⁻¹, H/Δt) Jᵀ
///   5. 3 and 4 are repeated (Newton's method with the Jacobian of the start) until the gaps no longer change
///   6. if the bodies came out of it with more energy than went in, their relative motion is slowed until they have
///      not, at the step's end or, where they turn round within it, from its start (1 to 5 once more); and made faster
///      where joints alone have lost energy to the method
///   7. the prediction becomes the state
///
/// Contacts that pressed neither in the last step nor under held forces take part in 4 only once the bodies would come
/// through them, or nearly so, in 3: most of the contacts of bumpy bodies are found ahead and exert nothing. Rows are
/// only added, so that the answer is that of all rows. (By the default rule, above 150 rows.)
///
/// Contacts with friction get 1,500 steps of Newton's method in all repetitions of 4 together, and 20 a time when these
/// are used up (above 200 rows 500); where it gets stuck operator splitting goes on for a while, and it begins again
/// from there. It is done in blocks by body where that is a twentieth of the work and there are no rows without bounds.
///
/// Islands of more than 150 rows are solved in blocks by body where that is less work: where bodies have few degrees of
/// freedom, counting the rows that residual compliance couples, and no impact is held. There 2 leaves contacts out: a
/// contact's force goes on instead, half at the end of a step and half at the start of the next, as far as it is no
/// more than in the step before; where bodies are by the ends of steps does not depend on it. If nothing but contacts
/// of rigid bodies acts, or those of a pile in which some flex (more than 250 rows, fewer than 30 to a body, no
/// residual compliance), 4 is a few iterations of an operator splitting at a time, from the last step's forces on,
/// until true gaps and forces fit to 1e-7 of the distances at hand (else: 1e-9). Where contacts yield by themselves
/// otherwise (add_flexibility, add_give: those of bodies that flex) it is Newton's method with 500 steps in all, from
/// where the splitting goes on; beside joints and limits of rigid bodies it is that method, less patiently. A step that
/// does not settle soon is left with the impulses found, and the report says so. What the tolerance of gaps leaves 6
/// without motion to take it from is paid by forces that are smaller by a part of at most 1e-4.
///
/// Where 6 fails and overlapping bodies were being pushed apart, the step is done again without that.
///
/// 4 is the default of four rules for contacts (contact_method.h). ContactMethod::kVelocityProgram finds its impulses
/// and forces before 1; its contacts' rows then have these forces as both bounds, held over the step (θ = ½) if nothing
/// else acts in the island.
///
/// Where bodies strike and that is asked for (Constraint::next_cut), the step is cut there, and where they let go of
/// each other (RowLaw::lets_go_within): where the impulses of their rows, by 1 to 5 over parts of different lengths,
/// are largest. Four times at most; 1 to 7 are done for each part.
///
/// Where free bodies hang on joints alone and the step does not settle, it is taken in halves, quarters … 64ths,
/// as far as they settle, each by 1 to 7, from that on what is left of it at once.
///
/// Momentum of free islands is kept by 4 (opposite impulses at one world point) and by 6 (the motion of the whole is
/// not touched). What is guaranteed, and why, is in docs/derivations/constraints.md.
#pragma once

#include <memory>
#include <span>

#include "limber/constraints/constraint.h"
#include "limber/constraints/contact_method.h"
#include "limber/constraints/solve_status.h"

namespace limber {

struct IslandOptions {
  double step = 1.0 / 60.0;     ///< s; that of all groups
  Vec3 gravity = Vec3::Zero();  ///< m/s², world
  int max_iterations = 30;      ///< of Newton's method, or of 15 steps of splitting each; ≥ 1
  bool guard_energy = true;     ///< step 6; off where the rule asks for programs as they are
  ContactRule contact{};        ///< how contacts are solved for
  /// Nothing but constraints and held forces has changed the members' velocities since their last step, and the rows
  /// are the same: what joints alone lose to the method is then given back by step 6.
  bool undisturbed = false;
  /// J: what step 6 left over in the last step, from IslandReport. It is at most 1e-7 of the energies at hand: bodies
  /// that turn round have no motion to take it from.
  double energy_surplus = 0.0;
};

struct IslandReport {
  SolveStatus status = SolveStatus::kSolved;  ///< kIterationLimit: the gaps were still changing
  int bodies = 0, rows = 0;
  /// Of the step, where bodies struck or let go (ImpactModel::kHeldFromTouch), or joints did not come together.
  int cuts = 0;
  ProgramReport programs{};     ///< of the contact rule, if it has any
  int iterations = 0;           ///< predictions made, in the part of the step that needed most
  int newton_steps = 0;         ///< for the contacts with friction, in the part that needed most
  double change = 0.0;          ///< of the worst gap in the last iteration, in units of its tolerance; large islands
                                ///< of contacts alone: what forces and gaps are off, in units of 100 tolerances
  double energy_removed = 0.0;  ///< J, by step 6; negative: given back
  double energy_surplus = 0.0;  ///< J, to be passed to the island's next step
};

/// The solver and its memory, which grows to the largest island seen; after that a step allocates nothing. One thread
/// at a time. The same call gives the same bits.
class IslandSolver {
 public:
  IslandSolver();
  ~IslandSolver();
  IslandSolver(IslandSolver&&) noexcept;
  IslandSolver& operator=(IslandSolver&&) noexcept;

  /// Advances the members by one step.
  /// @param table the bodies that rows name. @param members indices into it, ascending: every body the rows touch
  IslandReport step(std::span<const ConstrainedBody> table, std::span<const Index> members,
                    std::span<Constraint* const> constraints, const IslandOptions& options);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limber
