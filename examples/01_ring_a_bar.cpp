// 01_ring_a_bar: what does a struck steel bar do?
//   bake: scripts/make-bar 0.5 0.02 0.01 150 10 10 > bar.mesh && limber-precompute bar.mesh --material steel --modes 5
//   -o bar.glb run:  01_ring_a_bar bar.glb see:  five frequencies, each beside its value from beam theory, and the
//   energy that a strike on one end gave it next: 02_picture_of_a_flight
#include <cstdio>
#include <numbers>

#include "limber/engine/world.h"
#include "limber/model/asset.h"
#include "limber/model/material.h"

int main(int argc, char** argv) {
  const auto bar = limber::read_asset(argc > 1 ? argv[1] : "bar.glb").bodies.at(0);
  const limber::Material steel = limber::material_preset("steel");

  limber::World world({.step = 1.0 / 60.0});
  const limber::BodyId id = world.add_body(bar);
  world.apply_impulse(id, {.triangle = 0}, {0.0, 0.1, 0.1});  // N·s, on a corner
  world.step();

  // Euler-Bernoulli, free ends: f = (β L)²/(2π L²) √(E/ρ) t/√12, bending across t = 1 cm or 2 cm; L = 0.5 m.
  const double wave =
      std::sqrt(steel.youngs_modulus / steel.density) / (2.0 * std::numbers::pi * 0.25 * std::sqrt(12.0));
  const double theory[] = {22.373 * 0.01 * wave, 22.373 * 0.02 * wave, 61.673 * 0.01 * wave, 120.903 * 0.01 * wave,
                           61.673 * 0.02 * wave};
  const auto state = world.body(id);
  for (limber::Index m = 0; m < bar->modes() && m < 5; ++m) {
    const double z = state.amplitudes[m], zdot = state.rates[m],
                 energy = 0.5 * (zdot * zdot + bar->data().eigenvalues[m] * z * z);
    std::printf("mode %d  %8.1f Hz   beam theory %8.1f Hz   %.3e J\n", m, bar->frequency_hz(m), theory[m], energy);
  }
}
