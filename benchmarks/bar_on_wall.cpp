// A baked bar that flies end on against a half-space without friction: how fast it leaves, and whether its energy
// rises, over steps, phases of the touch within a step, contacts kept and residual compliance. Prints Markdown.
//   bar_on_wall [SUBSTEPS [MODES]]    of game contact (8), 0: the exact solver; modes (40)
// The bar is 0.05 × 0.05 × 1 m of 4 × 4 × 80 cells, E = 1e7 Pa, ν = 0, ρ = 1000 kg/m³: waves run at 100 m/s, and the
// exact one keeps the bar on the wall for T = 2L/c = 0.02 s. Energy is that of the nodes (energy_meter.h) and, with
// residual compliance, what the contacts store in it. Figures: docs/reports/contact.md.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>

#include "cpu_time.h"
#include "energy_meter.h"
#include "limber/collision/contact_finder.h"
#include "limber/engine/world.h"
#include "limber/precompute/bake.h"
#include "tet_box.h"

namespace limber::testing {
namespace {

constexpr double kLength = 1.0, kWidth = 0.05, kSpeed = 1.0, kContactTime = 0.02;
const Material kMaterial{.youngs_modulus = 1e7, .poisson_ratio = 0.0, .density = 1000.0};
constexpr double kPhases[] = {0.0, 0.05, 0.3, 0.5, 0.7, 0.95};
constexpr double kSteps[] = {1.0 / 250, 1.0 / 100, 0.0123, 1.0 / 50, 1.0 / 20, 1.0 / 10, 0.2, 0.5, 1.0, 2.0};  // of T

struct Bar {
  TetMesh mesh = tet_box(4, 4, 80, {kWidth, kWidth, kLength});
  std::shared_ptr<const ModalModel> model;
  std::unique_ptr<EnergyMeter> meter;

  explicit Bar(int modes) {
    BakeOptions o;
    o.materials = {{"*", kMaterial}};
    o.analysis.modes = o.limits.max_modes = modes;
    o.analysis.mass = MassKind::kConsistent;
    o.residual.surface = o.volume_block = true;
    Warnings warnings;
    model = bake({.name = "bar", .mesh = mesh}, o, warnings).asset.bodies[0];
    meter = std::make_unique<EnergyMeter>(mesh, kMaterial, model);
  }
};

struct Case {
  int substeps;  // of game contact; 0: the exact solver
  double step;   // of T
  bool residual, recovers = true;
};

struct Rebound {
  double speed = 1e30, rise = -1e30, seconds = 0.0;
  int unsettled = 0, steps = 0;
};

/// The nodes' energy and what the contacts store in the residual compliance.
double energy_of(const World& world, const Bar& bar, BodyId id) {
  const BodyView body = world.body(id);
  double modal = 0.0;
  for (std::size_t i = 0; i < body.amplitudes.size(); ++i)
    modal += 0.5 * bar.model->data().eigenvalues[i] * body.amplitudes[i] * body.amplitudes[i];
  return bar.meter->read(body, Vec3::Zero()).total() + world.energy(id).elastic - modal;
}

/// One touch, a part of a step after the second step's start, until half a contact time after the exact release.
void strike(const Bar& bar, const Case& at, double phase, Rebound& worst) {
  const double step = at.step * kContactTime;
  ContactFinder finder;
  World world({.step = step, .gravity = Vec3::Zero()});
  world.set_contact_source(&finder, {.solver = at.substeps > 0 ? ContactSolver::kGame : ContactSolver::kExact,
                                     .small_steps = {.substeps = std::max(1, at.substeps),
                                                     .push_speed = at.recovers ? SmallSteps{}.push_speed : 0.0},
                                     .friction = 0.0,
                                     .recovery_speed = at.recovers ? ContactOptions{}.recovery_speed : 0.0,
                                     .residual_compliance = at.residual});
  world.add_static(std::make_shared<Shape>(HalfSpace{}));
  const double gap = (1.0 + phase) * step * kSpeed;
  const BodyId id =
      world.add_body(bar.model, {.pose = {{}, {0.0, 0.0, 0.5 * kLength + gap}}, .velocity = {0.0, 0.0, -kSpeed}});
  const double scale = energy_of(world, bar, id);
  double before = scale;
  while (world.time() < gap / kSpeed + 1.5 * kContactTime + step) {
    const double begin = thread_seconds();
    world.step();
    worst.seconds += thread_seconds() - begin;
    worst.unsettled += world.constraint_report().solved ? 0 : 1;
    ++worst.steps;
    const double now = energy_of(world, bar, id);
    worst.rise = std::max({worst.rise, (now - before) / scale, (now - scale) / scale});
    before = now;
  }
  worst.speed = std::min(worst.speed, world.body(id).velocity.z() / kSpeed);
}

void run(const Bar& bar, Case at) {
  double least = 1e30, most = -1e30;
  Rebound all, unrecovered;
  for (const double phase : kPhases) {
    Rebound one;
    strike(bar, at, phase, one);
    least = std::min(least, one.speed), most = std::max(most, one.speed);
    all.rise = std::max(all.rise, one.rise);
    all.unsettled += one.unsettled, all.steps += one.steps, all.seconds += one.seconds;
  }
  at.recovers = false;
  for (const double phase : kPhases) strike(bar, at, phase, unrecovered);
  std::printf("| %s | %.4f | %.3f | %.3f | %.1e | %.1e | %d of %d | %.0f |\n", at.residual ? "with" : "without",
              at.step, least, most, all.rise, unrecovered.rise, all.unsettled, all.steps,
              1e6 * all.seconds / all.steps);
  std::fflush(stdout);
}

}  // namespace
}  // namespace limber::testing

int main(int argc, char** argv) {
  using namespace limber;
  using namespace limber::testing;
  const int substeps = argc > 1 ? std::atoi(argv[1]) : SmallSteps{}.substeps;
  const int modes = argc > 2 ? std::atoi(argv[2]) : 40;
  if (argc > 3 || substeps < 0 || modes < 1) {
    std::fprintf(stderr,
                 "usage: bar_on_wall [SUBSTEPS [MODES]], of game contact, 0 for the exact solver; MODES 1 or more\n");
    return 2;
  }
  const Bar bar(modes);
  std::printf(
      "| residual compliance | Δt/T | least speed after / before | most | largest rise of energy | the "
      "same without recovery | steps not settled | µs a step |\n|---|---|---|---|---|---|---|---|\n");
  for (const bool residual : {true, false})
    for (const double step : kSteps) run(bar, {substeps, step, residual});
  return 0;
}
