// Does anything gain energy? Baked bars on the ground, in a pile, held and in a chain, over stiffness, step, damping,
// modes, Poisson's ratio and mass ratio: one CSV row per case, the worst of each scene at the end.
//   energy_grid [STEPS [EVERY]]    STEPS per case (120); every EVERYth case of the grid (1)
#include "energy_scenes.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>

using namespace limber::testing;

int main(int argc, char** argv) {
  const int steps = argc > 1 ? std::atoi(argv[1]) : 120;
  const int every = argc > 2 ? std::atoi(argv[2]) : 1;
  if (argc > 3 || steps < 1 || every < 1) {
    std::fprintf(stderr, "usage: energy_grid [STEPS [EVERY]], both 1 or more\n");
    return 2;
  }
  struct Worst {
    double rise = 0.0, total = 0.0;
    int cases = 0, above = 0, broken = 0;
    long steps = 0, unsettled = 0;
  };
  std::map<std::string, Worst> worst;
  std::puts(
      "scene,E,nu,step,damping,modes,mass_ratio,worst_rise,total_rise,node_worst_rise,"
      "node_total_rise,spin_bound,spin_excess,strain_difference,removed,unsettled,finite");
  const auto grid = energy_grid();
  for (std::size_t i = 0; i < grid.size(); i += static_cast<std::size_t>(every)) {
    const EnergyCase& at = grid[i];
    const EnergyResult r = run(at, steps);
    std::printf("%s,%g,%g,%g,%g,%d,%g,%.3g,%.3g,%.3g,%.3g,%.3g,%.3g,%.3g,%.3g,%d,%d\n", name(at.scene),
                at.youngs_modulus, at.poisson_ratio, at.step, at.damping_ratio, at.modes, at.mass_ratio, r.worst_rise,
                r.total_rise, r.node_worst_rise, r.node_total_rise, r.spin_bound, r.spin_excess, r.strain_difference,
                r.removed, r.unsettled, r.finite ? 1 : 0);
    std::fflush(stdout);
    Worst& w = worst[name(at.scene)];
    w.rise = std::max(w.rise, r.worst_rise);
    w.total = std::max(w.total, r.total_rise);
    w.above += r.worst_rise > 1e-6 ? 1 : 0;
    w.broken += r.finite ? 0 : 1;
    w.steps += r.steps, w.unsettled += r.unsettled;
    ++w.cases;
  }
  for (const auto& [scene, w] : worst)
    std::printf(
        "# %s: %d cases, worst rise %.3g in a step (%d above 1e-6), %.3g above the start; %d not finite; %ld of %ld "
        "steps unsettled\n",
        scene.c_str(), w.cases, w.rise, w.above, w.total, w.broken, w.unsettled, w.steps);
  return 0;
}
