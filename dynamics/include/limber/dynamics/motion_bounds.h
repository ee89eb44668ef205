/// @file limber/dynamics/motion_bounds.h
/// How far a mode can get within a step, in closed form, for any damping, under a held load and for λ = 0. Holds to
/// round-off. Derivation: docs/derivations/motion-bounds.md.
#pragma once

#include "limber/dynamics/oscillator.h"

namespace limber {

/// ≥ sup |z(t) − z(0)|, kg^½·m, over `duration` seconds from `start` on, under a force g held over them.
/// @param duration ≥ 0. Arguments are finite. Does not allocate or throw.
double largest_change(const Mode& mode, const ModeState& start, double g, double duration);

}  // namespace limber
