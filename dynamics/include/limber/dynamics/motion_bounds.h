/// @file limber/dynamics/motion_bounds.h
/// How fast and how far a body's points can get within a stretch of a step, from its frame and amplitudes alone.
///
/// A point r + U z of a body, |r| ≤ d and |U_i| ≤ u_i, moves over [t₀, t₁] by at most
///   |p(t) − p(t₀)| + 2 sin(turn/2) (d + Σ u_i |z_i(t₀)|) + Σ u_i sup|z_i(t) − z_i(t₀)|
/// and no faster than |v| + |ω| (d + Σ u_i sup|z_i|) + Σ u_i sup|ż_i|. Every term is bounded in closed form, for any
/// damping, under a held load and for λ = 0. All bounds hold to round-off. Derivation:
/// docs/derivations/motion-bounds.md.
#pragma once

#include <span>
#include <vector>

#include "limber/dynamics/frame_path.h"
#include "limber/dynamics/oscillator.h"

namespace limber {

/// Bounds on one mode over a stretch of time.
struct ModeBound {
  double change = 0.0;        ///< ≥ sup |z(t) − z(t₀)|, kg^½·m
  double size = 0.0;          ///< ≥ sup |z(t)|, kg^½·m
  double rate = 0.0;          ///< ≥ sup |ż(t)|, kg^½·m/s
  double acceleration = 0.0;  ///< ≥ sup |z̈(t)|, kg^½·m/s²; infinite where an impulse acts inside the stretch
};

/// Over `duration` seconds from `start` on, under a force g held over them.
/// @param duration ≥ 0. Arguments are finite. Does not allocate or throw.
ModeBound bound_motion(const Mode& mode, const ModeState& start, double g, double duration);

/// Bounds on a body over [t₀, t₁].
struct MotionBounds {
  FrameBounds frame;
  std::vector<ModeBound> modes;
};

}  // namespace limber
