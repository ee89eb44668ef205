/// @file limber/hauser/contact_rule.h
/// [H03]'s rules by which contact forces are found, beside limber's own: four for the normals, three for friction. All
/// see the same rows (contact_constraint.h); J their Jacobian, g₀ and g the gaps at the step's start and end, f
/// impulses, F forces.
///
///   kPenalty           f = Δt F,  F = max(0, −k g − c (g − min(0, g₀))/Δt)                      [H03]'s first method
///   kVelocityProgram   min Σp, J v + A p ≥ 0, p ≥ 0 at the touch; min ΣF, J a + J̇v + A F ≥ 0, F ≥ 0  [H03]'s second
///                      for what then rests; A = J M⁻¹Jᵀ of frames and modes
///   kGapProgram        min Σf, g ≥ 0, f ≥ 0                              the same at the end of the step, force held
///   kComplementary     0 ≤ f ⊥ g ≥ 0                                     limber's own
///
/// kPenalty takes its spring at the step's end, as a compliance 1/(Δt k + c) of the row ([H03]: at its start): stable
/// for every k, c and step. n contacts under a weight m g sink in by m g/(n k). A pile may leave some steps unsettled.
/// kVelocityProgram cuts the step at the touch, four times at most, in islands of free bodies with nothing but
/// contacts. It does not look at the gap otherwise, so what sinks in stays so. Its forces hold the accelerations of the
/// step's start, which is rough for stiff modes. Programs that are degenerate or have no solution never fail a step:
/// slack is bought at a price (linear_program.h) and counted as relaxed. Side by side: docs/reports/contact.md.
///
/// J̇v is [H03]'s equation 20: ω × (ω × p) + 2 ω × R U ż of each point; J a has α = I⁻¹(−ω × I ω) of each frame. Where
/// the normal is that of a face that a vertex or a round body touches, it turns with the frame of the face's body and
/// adds 2 ṅ·ḋ − |ṅ|² n·d, d between the points. Left out: how a face turns as it bends, and the normals of crossing
/// edges, of two rigid shapes and of two round ones, which do not belong to one body.
#pragma once

#include "limber/hauser/contact_program.h"

namespace limber {

enum class ContactMethod { kPenalty, kVelocityProgram, kGapProgram, kComplementary };

enum class FrictionModel {
  /// |f_t| ≤ μ f_n against the slip, with the normals in one problem; true sticking. The programs know no cone: they
  /// use kHeuristic in its place.
  kCone,
  /// After the normals, contact by contact: the impulse that takes away its slip as it then is, at most μ f_n. The
  /// normals are not looked at again.
  kHeuristic,
  /// The same, and then once more all together: normals as in kComplementary, and no slip where kHeuristic stayed below
  /// μ f_n; what slid keeps its friction. Tangents may then exceed μ f_n.
  kHeuristicNoSlip,
};

struct ContactRule {
  ContactMethod method = ContactMethod::kComplementary;
  FrictionModel friction = FrictionModel::kCone;
  ProgramGuard guard = ProgramGuard::kClamp;  ///< kNone: the island's energy guard (island_solver.h) is off as well
  /// kPenalty: frequency and share of critical damping of each contact's spring under the bodies' reduced mass, Hz, >
  /// 0, and ≥ 0. k = m (2πν)², c = 2ζ m 2πν.
  double penalty_frequency = 15.0, penalty_damping = 1.0;

  bool is_program() const { return method == ContactMethod::kVelocityProgram || method == ContactMethod::kGapProgram; }
  /// Friction is Coulomb's cone, in one problem with the normals: limber's own solver, with springs for kPenalty.
  bool has_cone() const { return !is_program() && friction == FrictionModel::kCone; }
  ContactProgramRule program() const {
    return {.least_sum = is_program(), .stops_slip = friction == FrictionModel::kHeuristicNoSlip, .guard = guard};
  }
  void validate() const;  ///< @throws InvalidArgument naming the field and its value
};

}  // namespace limber
