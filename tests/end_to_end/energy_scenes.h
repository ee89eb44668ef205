/// @file energy_scenes.h
/// Baked bars that fall, hang, are held and are joined, over a grid of all that could make them gain energy.
#pragma once

#include <string>
#include <vector>

namespace limber::testing {

enum class EnergyScene {
  kGround,  ///< a bar falls askew onto the ground, turning, with friction
  kPile,    ///< a second one, heavier by the mass ratio, falls onto it
  kHandle,  ///< a bar is held at one corner and swings
  kChain,   ///< three bars hang on a ball joint and a hinge with limits, the last heavier by the mass ratio
};

/// One point of the grid.
struct EnergyCase {
  EnergyScene scene = EnergyScene::kGround;
  double youngs_modulus = 1e6;  ///< Pa
  double poisson_ratio = 0.3;
  double step = 1.0 / 60.0;    ///< s
  double damping_ratio = 0.0;  ///< of the first mode; more of the higher ones
  int modes = 20;
  double mass_ratio = 1.0;  ///< kPile, kChain
  double friction = 0.5;    ///< kGround, kPile
};

/// What was seen.
struct EnergyResult {
  double worst_rise = 0.0;  ///< of the energy in a step, over its scale: max(kinetic and elastic at first, Σ m g size)
  double total_rise = 0.0;  ///< largest excess over the energy at first, over the scale
  double removed = 0.0;     ///< what the constraints took out on purpose, over the scale (ConstraintReport)

  // The same by the nodes of the meshes (energy_meter.h), over the scale.
  double node_worst_rise = 0.0, node_total_rise = 0.0;
  double spin_bound = 0.0;         ///< largest sum over the bodies of what their change of inertia may account for
  double spin_excess = 0.0;        ///< largest amount by which the kinetic energies differ beyond that
  double strain_difference = 0.0;  ///< largest difference of the elastic energies
  bool finite = true;
  int steps = 0, unsettled = 0;  ///< steps; those in which some island did not come to its targets
};

/// Runs a case. Nothing is recovered from overlap, since that is work done on the bodies.
EnergyResult run(const EnergyCase& at, int steps);

const char* name(EnergyScene scene);

/// The whole grid: E 1e2…1e12 Pa × step 1e-4…0.1 s × damping 0…overdamped × modes 0…64 × ν 0.3 and 0.499 × mass ratio 1
/// and 1e4, where the scene has two weights.
std::vector<EnergyCase> energy_grid();

}  // namespace limber::testing
