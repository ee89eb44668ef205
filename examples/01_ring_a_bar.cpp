// 01_ring_a_bar: what does a struck steel bar do?
//   bake:  scripts/make-bar 0.5 0.02 0.01 150 10 10 > bar.mesh
//          limber-precompute bar.mesh --material steel --modes 5 -o bar.glb
//   run:   01_ring_a_bar bar.glb
//   see:   five frequencies beside those of beam theory, and the energy that a strike on a corner gave each
//   next:  02_let_it_fall
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>

#include "limber/engine/world.h"
#include "limber/model/asset.h"

int main(int argc, char** argv) try {
  const auto bar = limber::read_asset(argc > 1 ? argv[1] : "bar.glb").bodies.at(0);
  limber::World world({.step = 1.0 / 60.0});
  const limber::BodyId id = world.add_body(bar);
  world.apply_impulse(id, {.triangle = 0}, {0.0, 0.1, 0.1});  // N·s
  world.step();

  // Euler–Bernoulli, free ends: f = (βL)² t/(2π √12 L²) √(E/ρ), bending across t = 1 cm or 2 cm; L = 0.5 m, steel.
  const double unit = 0.01 / (6.2832 * std::sqrt(12.0) * 0.25) * std::sqrt(207e9 / 7850.0);
  const double theory[] = {22.373 * unit, 2 * 22.373 * unit, 61.673 * unit, 120.903 * unit, 2 * 61.673 * unit};
  for (int m = 0; m < std::min(bar->modes(), 5); ++m) {
    const double z = world.body(id).amplitudes[m], rate = world.body(id).rates[m];
    const double energy = 0.5 * (rate * rate + bar->data().eigenvalues[m] * z * z);
    std::printf("mode %d %8.1f Hz, beam theory %8.1f Hz, %.2e J\n", m, bar->frequency_hz(m), theory[m], energy);
  }
} catch (const std::exception& e) {
  std::fprintf(stderr, "01_ring_a_bar: %s\n", e.what());
  return 1;
}
