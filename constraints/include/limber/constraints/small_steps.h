/// @file limber/constraints/small_steps.h
/// Contact by small steps: a step of bounded work. Contacts are found once; the step is then taken in n substeps, in
/// each of which
///
///   1. all bodies move freely, modes in closed form,
///   2. gaps are measured again from the contacts' anchors,
///   3. joints and handles are solved all at once; then one sweep of Gauss–Seidel forward and one backward over all
///      contacts, each one's normal and then both its tangents, begins with the forces of the substep before,
///   4. what overlaps is parted by displacements of frames that leave no speed; what joints are open by is closed.
///
///   y = y_free + q,   q = Σ Jᵀf,   0 ≤ f_n ⊥ gap + J_n y − min(gap, 0) ≥ 0,   |f_t| ≤ μ f_n
///
/// Work is substeps × rows, known before the step; joints along a tree take time linear in their number. The sweeps do
/// not end where the law is met: what they leave acts like a spring whose stiffness grows with n². A force never pulls
/// and stays in its cone whatever is left.
///
/// Both sweeps are needed: in one direction their spectrum is complex, and the forces that a substep begins with make
/// such a sweep unstable. Modes answer as SubstepModes says, so that contact gives them no energy. Rows of contacts are
/// those of the step's start; those of handles and joints are made anew in each substep.
/// Derivation: docs/derivations/small-steps.md.
#pragma once

#include <memory>
#include <span>
#include <tuple>
#include <type_traits>

#include "limber/constraints/constraint.h"
#include "limber/core/jobs.h"
#include "limber/core/state_archive.h"

namespace limber {

class ContactSet;

struct SmallSteps {
  int substeps = 12;        ///< n ≥ 1: 4 for debris, 16 to 32 for towers and heavy loads
  double slop = 2e-3;       ///< ≥ 0: overlap that is left alone, as a share of the smaller body's thickness: less
                            ///< keeps high piles swaying
  double push_speed = 1.0;  ///< m/s, ≥ 0: what overlaps is parted at most this fast
  void validate() const;    ///< @throws InvalidArgument naming the field and its value
};

template <class Self>
requires std::is_same_v<std::remove_const_t<Self>, SmallSteps>
auto state_fields(Self& s) { return std::tie(s.substeps, s.slop, s.push_speed); }

/// One step of all bodies that contacts or constraints touch.
struct SmallStepProblem {
  std::span<const ConstrainedBody> table{};
  std::span<const Index> members{};            ///< ascending: every body that rows touch and that moves
  ContactSet* contacts = nullptr;              ///< updated for the step; null: none
  std::span<Constraint* const> constraints{};  ///< but for those of `contacts`
  std::span<const double> thickness{};         ///< by body, m: what the slop is a share of; none: no slop
  double step = 1.0 / 60.0;                    ///< s
  Vec3 gravity = Vec3::Zero();                 ///< m/s², world
};

struct SmallStepReport {
  /// No force pulls, is outside its cone or is not finite, and all that moves is finite.
  bool solved = true;
  int rows = 0;
  double residual = 0.0;  ///< m: the largest motion in the last substep that a row's law still forbids
};

/// The solver and its memory, which grows to the largest scene seen; after that a step allocates nothing. The same call
/// gives the same bits.
class SmallStepSolver {
 public:
  SmallStepSolver();
  ~SmallStepSolver();
  SmallStepSolver(SmallStepSolver&&) noexcept;
  SmallStepSolver& operator=(SmallStepSolver&&) noexcept;

  /// Advances the members by one step and tells contacts and constraints what acted. The same bits whatever `jobs` is.
  SmallStepReport step(const SmallStepProblem& problem, Jobs& jobs = serial_jobs());

  /// Forgets what it knows of earlier steps beside the contacts' own memory.
  void clear();
  void save_state(StateWriter& state) const;
  void restore_state(StateReader& state);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limber
