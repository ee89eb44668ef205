/// @file limber/dynamics/oscillator.h
/// Vibration modes as damped oscillators, advanced exactly.
///
///   z̈ + 2ξ ż + λ z = g                                             (1)
///
/// Modes are mass-normalised (WᵀMW = I), so z is in kg^½·m and g in kg^½·m/s². With δ² = ξ² − λ and over a step h
///   z(h) = (C + ξS) z₀ + S ż₀ + H g,   ż(h) = −λS z₀ + (C − ξS) ż₀ + S g      (g held from 0 to h)
/// in every regime: under-, over- and critically damped, λ = 0 included. This is [H03]'s pair of complex exponentials
/// (section 3.3) in a form that keeps its digits; docs/derivations/oscillator.md has the derivation.
/// Accuracy, in the norm of (√λ z, ż): 1e-12 + 4ε·√λ h of the state's own size.
#pragma once

#include <span>
#include <vector>

#include "limber/core/types.h"

namespace limber {

struct Mode {
  double lambda = 0.0;  ///< λ, squared angular frequency, rad²/s²; ≥ 0 (0: a mechanism)
  double decay = 0.0;   ///< ξ = (a₁λ + a₂)/2, 1/s; ≥ 0, any size
};

struct ModeState {
  double z = 0.0;     ///< modal displacement, kg^½·m
  double zdot = 0.0;  ///< modal velocity, kg^½·m/s
};

/// The exact flow of (1) over one step. Depends on mode and step only: compute once, share among all instances.
struct ModePropagator {
  double z_z = 1.0;        ///< C + ξS
  double z_zdot = 0.0;     ///< S, s: also the displacement after a unit impulse at the step's start
  double zdot_z = 0.0;     ///< −λS, 1/s
  double zdot_zdot = 1.0;  ///< C − ξS: also the velocity after a unit impulse at the step's start
  double z_g = 0.0;        ///< H ≥ 0, s²: the displacement after a unit force held over the step
  double zdot_g = 0.0;     ///< S, s
};

/// @param h step length, s; ≥ 0. @throws InvalidArgument if h, λ or ξ is not a number from 0 to 1e100.
ModePropagator propagator(const Mode& mode, double h);

/// One step of one mode under a force g held over it. Does not allocate or throw.
inline ModeState advance(const ModePropagator& p, ModeState s, double g = 0.0) {
  return {p.z_z * s.z + p.z_zdot * s.zdot + p.z_g * g, p.zdot_z * s.z + p.zdot_zdot * s.zdot + p.zdot_g * g};
}

/// The change of the state at the step's end by an impulse j given `remaining` seconds before it: the response is
/// linear, so an impulse inside a step adds propagator(mode, remaining) applied to (0, j). @throws like propagator()
ModeState impulse_response(const Mode& mode, double remaining, double j);

/// Energy of one mode, ½(ż² + λz²), J.
inline double energy(const Mode& mode, const ModeState& s) { return 0.5 * (s.zdot * s.zdot + mode.lambda * s.z * s.z); }

/// The propagators of all modes of a model for one step length, one array per coefficient, each padded to a multiple of
/// `kPad` and 64-byte aligned, so that one instance advances in whole vectors.
class PropagatorTable {
 public:
  static constexpr Index kPad = 8;
  /// @param lambda, decay as in Mode, one per mode. @param h step length, s; ≥ 0
  /// @throws InvalidArgument if the two differ in length, and as propagator()
  PropagatorTable(std::span<const double> lambda, std::span<const double> decay, double h) { set(lambda, decay, h); }
  PropagatorTable() = default;  ///< no modes, step 0
  /// The same for another step or other modes. Allocates nothing once it has held as many.
  void set(std::span<const double> lambda, std::span<const double> decay, double h);

  Index modes() const { return modes_; }
  Index padded() const { return (modes_ + kPad - 1) / kPad * kPad; }
  double step() const { return step_; }
  ModePropagator at(Index mode) const;

  /// Advances `padded()` modes of one instance in place. Arrays are padded and 64-byte aligned; the padding stays zero.
  /// Does not allocate or throw. Results are the same bits for any instruction set that has fused multiply-add.
  void advance(double* z, double* zdot, const double* g) const;
  /// The same with g = 0.
  void advance_free(double* z, double* zdot) const;

 private:
  /// The coefficients of kPad modes side by side (zdot_g is z_zdot again): one stream, read once per step.
  struct alignas(64) Block {
    double coefficients[5][kPad] = {};
  };
  const double* coefficients() const { return blocks_.empty() ? nullptr : blocks_.front().coefficients[0]; }

  Index modes_ = 0;
  double step_ = 0.0;
  std::vector<Block> blocks_;
};

}  // namespace limber
