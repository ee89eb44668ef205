/// @file limber/hauser/energy_guard.h
/// Keeps the least total impulse (linear_program.h) from adding energy.
///
/// The work of forces f is a quadratic of f, which level is solved deciding which:
///   velocity   ΔE(f) = fᵀb + ½ fᵀA f                                                                            (1)
///   gap        ΔE(f) = fᵀ(A f + b − g₀)/Δt                                                                      (2)
/// with g₀ the gaps at the step's start and f an impulse, held over the step: where it all comes at the start, frames
/// take less. Both the complementary solution (contact_qp.h) and the linear program's lie in the convex set
/// A f + b ≥ 0, f ≥ 0, so any f(s) = (1 − s) f_LCP + s f_LP does. The guard takes the largest s in [0, 1] with
/// ΔE(f(s)) ≤ 0: the root of one quadratic.
#pragma once

#include <span>

namespace limber {

/// ΔE of impulses, (1) or (2).
struct ImpulseWork {
  std::span<const double> A = {};           ///< m × m, symmetric; at gap level gap per impulse, s/kg
  std::span<const double> b = {};           ///< m: relative speeds before, m/s, or gaps predicted at the step's end, m
  std::span<const double> gap_before = {};  ///< g₀, m, m; empty: velocity level
  double step = 0.0;                        ///< Δt, s; > 0 at gap level
};

/// What the guard did to one solve.
struct EnergyGuardResult {
  double blend = 1.0;                 ///< s: 1 the linear program's forces, 0 the complementary ones
  double energy_program = 0.0;        ///< ΔE(f_LP), J
  double energy_complementary = 0.0;  ///< ΔE(f_LCP), J
  double energy = 0.0;                ///< ΔE of what is returned, J
};

/// What the guard did over many solves.
struct EnergyGuardReport {
  long solves = 0;
  long clamped = 0;             ///< solves with s < 1
  long complementary = 0;       ///< solves with s = 0
  double blend_sum = 0.0;       ///< Σ s
  double energy_refused = 0.0;  ///< Σ max(0, ΔE(f_LP)) − max(0, ΔE returned), J
  void add(const EnergyGuardResult& result);
};

/// @param f m, the safe forces f(s); may be the same memory as either input. If even f_LCP adds energy (a gap that was
/// negative at the start), s is the one of least ΔE.
/// @throws InvalidArgument if lengths do not fit, or Δt ≤ 0. Does not allocate.
EnergyGuardResult guard_energy(const ImpulseWork& work, std::span<const double> f_program,
                               std::span<const double> f_complementary, std::span<double> f);

/// The largest s in [0, 1] with φ₀ + φ₁s + φ₂s² ≤ 0; where there is none, the s of the least value.
double largest_safe_blend(double phi0, double phi1, double phi2);

}  // namespace limber
