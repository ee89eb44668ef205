// How flexible bodies come to rest: a bar, boxes and stacks of boxes, baked with 3 % of critical damping in the first
// mode, and any body from an asset, dropped on the ground through World and ContactFinder at 60 steps a second. Prints
// Markdown. Figures: docs/reports/contact.md.
//   contact_rest [SECONDS [SCENE [ASSET]]]    seconds per scene (5), part of the names of the scenes wanted, a body
// Penetration is that of the surfaces that touch, residual displacement included, of all their contacts and not of the
// few that are kept. Drift is how far a body has moved since the fifth second.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include "cpu_time.h"
#include "grounded_world.h"
#include "limber/model/asset.h"
#include "limber/precompute/bake.h"
#include "overlap.h"
#include "tet_box.h"

namespace limber::testing {
namespace {

constexpr double kStep = 1.0 / 60.0, kDampingRatio = 0.03;
const Material kRubber{.youngs_modulus = 5e6, .poisson_ratio = 0.4, .density = 1100.0};

struct Scene {
  std::string name;
  std::shared_ptr<const ModalModel> model;
  int count;
  double gap;  // between bodies, m
  bool askew;
  bool residual;
  bool side_by_side = false;  // in layers of four
};

std::shared_ptr<const ModalModel> baked(const Vec3& size, const std::array<int, 3>& cells, int modes, bool residual) {
  BakeOptions o;
  o.materials = {{"*", kRubber}};
  o.analysis.modes = o.limits.max_modes = modes;
  o.residual.surface = residual;
  const auto bake_it = [&] {
    Warnings warnings;
    return bake({.name = "box", .mesh = tet_box(cells[0], cells[1], cells[2], size)}, o, warnings).asset.bodies[0];
  };
  o.damping.stiffness_proportional = 2.0 * kDampingRatio / std::sqrt(bake_it()->data().eigenvalues.front());
  return bake_it();
}

struct Extent {
  Vec3 low = Vec3::Constant(1e30), high = Vec3::Constant(-1e30);
  explicit Extent(const ModalModel& model) {
    for (const Vec3f& x : model.collision().rest) {
      low = low.cwiseMin(x.cast<double>());
      high = high.cwiseMax(x.cast<double>());
    }
  }
};

double farthest_from(const World& world, const std::vector<BodyId>& bodies, const std::vector<Vec3>& places) {
  double farthest = 0.0;
  for (std::size_t b = 0; b < places.size(); ++b)
    farthest = std::max(farthest, (world.body(bodies[b]).pose.p - places[b]).norm());
  return farthest;
}

std::vector<Vec3> places_of(const World& world, const std::vector<BodyId>& bodies) {
  std::vector<Vec3> places;
  for (const BodyId id : bodies) places.push_back(world.body(id).pose.p);
  return places;
}

/// Start of body i of a scene: upon each other, or in layers of four.
Vec3 place_of(const Scene& scene, const Extent& extent, int i) {
  const double height = extent.high.z() - extent.low.z(), size = (extent.high - extent.low).maxCoeff();
  if (scene.side_by_side) {
    const int layer = i / 4;
    return Vec3(0.55 * size * (i % 2 == 0 ? 1 : -1) + 0.1 * size * layer, 0.55 * size * (i % 4 < 2 ? 1 : -1),
                -extent.low.z() + scene.gap + layer * (size + scene.gap));
  }
  return Vec3(0.03 * size * (i % 2), 0.025 * size * (i % 3),
              -extent.low.z() + scene.gap + i * (height + scene.gap) + (scene.askew ? size : 0.0));
}

/// Thread time of drawing all bodies once, least of many, s.
double drawing_seconds(const World& world, const std::vector<BodyId>& bodies) {
  const std::size_t numbers = 3 * static_cast<std::size_t>(world.model(bodies[0]).render().vertices());
  std::vector<float> positions(numbers * bodies.size());
  std::vector<DrawTarget> targets;
  for (std::size_t i = 0; i < bodies.size(); ++i)
    targets.push_back({bodies[i], std::span(positions).subspan(numbers * i, numbers)});
  double least = 1e30;
  for (int i = 0; i < 50; ++i) {
    const double begin = thread_seconds();
    world.reconstruct(targets);
    least = std::min(least, thread_seconds() - begin);
  }
  return least;
}

void run(const Scene& scene, double seconds) {
  GroundedWorld grounded(exactly({.residual_compliance = scene.residual}), {.step = kStep});
  World& world = grounded.world;
  const Extent extent(*scene.model);
  const double size = (extent.high - extent.low).maxCoeff();
  std::vector<BodyId> bodies;
  for (int i = 0; i < scene.count; ++i) {
    const Vec3 turn = scene.askew ? Vec3(0.5, 0.6, 0.0) : Vec3(0.0, 0.0, 0.05 * i);
    bodies.push_back(
        world.add_body(scene.model, {.pose = {quaternion_from_rotation_vector(turn), place_of(scene, extent, i)}}));
  }
  Overlap overlap(world, bodies, grounded.ground);
  const int steps = static_cast<int>(std::lround(seconds / kStep));
  const double scale = scene.count * scene.model->data().mass * kGravity * size;
  std::vector<Vec3> before, fifth;
  double spent = 0.0, slowest = 0.0, deepest = 0.0, rise = 0.0, energy = 0.0;
  long iterations = 0;
  int unsettled = 0, late = 0, rows = 0;
  for (int i = 0; i < steps; ++i) {
    if (i == std::max(0, steps - 60)) before = places_of(world, bodies);
    if (i == 5 * 60) fifth = places_of(world, bodies);
    const double begin = thread_seconds();
    world.step();
    const double took = thread_seconds() - begin;
    spent += took, slowest = std::max(slowest, took);
    const ConstraintReport report = world.constraint_report();
    iterations += report.iterations;
    rows = std::max(rows, report.rows);
    unsettled += report.solved ? 0 : 1;
    late += !report.solved && i >= steps - 60 ? 1 : 0;
    if (i >= steps - 60) deepest = std::max(deepest, overlap.deepest().anywhere());
    const double now = total_energy(world, bodies);
    if (i > 0) rise = std::max(rise, (now - energy) / scale);
    energy = now;
  }
  double fastest = 0.0;
  for (const BodyId id : bodies) fastest = std::max(fastest, world.body(id).velocity.norm());
  std::printf("| %s | %d | %.1e | %.1e | %.1e | %.1e | %.1e | %d | %d | %d | %.1f | %.0f | %.0f | %.0f |\n",
              scene.name.c_str(), static_cast<int>(scene.model->modes()), deepest / size,
              farthest_from(world, bodies, before), farthest_from(world, bodies, fifth), fastest, rise, unsettled, late,
              rows, static_cast<double>(iterations) / steps, 1e6 * spent / steps, 1e6 * slowest,
              1e6 * drawing_seconds(world, bodies));
  std::fflush(stdout);
}

}  // namespace
}  // namespace limber::testing

int main(int argc, char** argv) {
  using namespace limber;
  using namespace limber::testing;
  const double seconds = argc > 1 ? std::atof(argv[1]) : 5.0;
  const std::string wanted = argc > 2 ? argv[2] : "";
  std::printf(
      "| scene | modes | penetration / size | moved in the last second, m | drift, m | fastest, m/s | largest rise of "
      "energy in a "
      "step / scale | steps not settled | of the last 60 | rows | iterations | µs a step | slowest | µs to draw "
      "|\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  std::vector<Scene> scenes;
  for (const bool residual : {false, true}) {
    const std::string with = residual ? ", residual" : "";
    const auto add = [&](const std::string& name, auto&& model, int count, double gap, bool askew) {
      if ((name + with).find(wanted) != std::string::npos)
        scenes.push_back({name + with, model(), count, gap, askew, residual});
    };
    const auto bar = [&] { return baked({0.6, 0.1, 0.1}, {12, 2, 2}, 20, residual); };
    const auto coarse = [&] { return baked({0.4, 0.3, 0.2}, {3, 2, 2}, 12, residual); };
    const auto fine = [&] { return baked({0.4, 0.3, 0.2}, {8, 6, 4}, 20, residual); };
    const double close = 1e-4, far = 0.02;
    add("bar", bar, 1, 0.0, true);
    add("box", fine, 1, 0.0, true);
    add("3 coarse laid", coarse, 3, close, false);
    add("3 coarse dropped", coarse, 3, far, false);
    add("3 fine laid", fine, 3, close, false);
    add("3 fine dropped", fine, 3, far, false);
    add("10 coarse laid", coarse, 10, close, false);
    add("10 coarse dropped", coarse, 10, far, false);
    add("10 fine laid", fine, 10, close, false);
    if (argc > 3) {
      const auto asset = [&] { return read_asset(argv[3]).bodies.at(0); };
      add("asset", asset, 1, 0.0, true);
      add("8 assets dropped", asset, 8, 0.02, false);
      if (!scenes.empty() && scenes.back().count == 8) scenes.back().side_by_side = true;
    }
  }
  for (const Scene& scene : scenes) run(scene, seconds);
  return 0;
}
