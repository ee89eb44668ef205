// Time of a step of World under constraints: points of one body dragged together, and a chain of links. See README.md.
#include <benchmark/benchmark.h>

#include <random>
#include <vector>

#include "cpu_time.h"
#include "limber/engine/world.h"
#include "sample_models.h"

namespace limber {
namespace {

/// range(0) points dragged, range(1) modes. What the hands ask for is a rigid motion: feasible for any number of them.
void drag(benchmark::State& state) {
  const auto points = static_cast<int>(state.range(0)), modes = static_cast<int>(state.range(1));
  World world;
  const BodyId body = world.add_body(testing::sample_model({.modes = modes, .decay = 1.0}));
  std::mt19937 random(1);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::vector<HandleId> hands;
  for (int i = 0; i < points; ++i) {
    const double a = unit(random), b = (1.0 - a) * unit(random);
    hands.push_back(world.add_handle(body, {.triangle = static_cast<Index>(i % 12), .weight = {a, b, 1.0 - a - b}}));
    world.set_handle_target(hands.back(),
                            {.position = world.handle(hands.back()).target.position, .velocity = {0.02, -0.01, 0.03}});
  }
  for (int i = 0; i < 10; ++i) world.step();
  LeastTime time;
  double error = 0.0;
  for (auto _ : state) time.measure([&] { world.step(); });
  for (const HandleId hand : hands) error = std::max(error, world.handle(hand).error);
  state.counters["us_per_step"] = 1e6 * time.seconds();
  state.counters["iterations"] = world.constraint_report().iterations;
  state.counters["error_m"] = error;
}
BENCHMARK(drag)->ArgNames({"points", "modes"})->ArgsProduct({{1, 10, 100, 300}, {40}});

/// range(0) links on hinges, range(1) modes of each.
void chain(benchmark::State& state) {
  const auto links = static_cast<int>(state.range(0)), modes = static_cast<int>(state.range(1));
  World world({.step = 1.0 / 240.0});
  const auto model = testing::sample_model({.modes = modes, .lowest_hz = 50.0, .decay = 1.0});
  JointSpec hinge{.type = JointType::kRevolute};
  hinge.frame.axes << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  BodyId last{};
  for (int i = 0; i < links; ++i) {
    const BodyId link = world.add_body(model, {.pose = {.p = {0.6 * i + 0.3, 0, 0}}});
    hinge.frame.origin = {0.6 * i, 0, 0};
    world.add_joint(last, link, hinge, {.radius = 0.25}, {.radius = 0.25});
    last = link;
  }
  for (int i = 0; i < 10; ++i) world.step();
  LeastTime time;
  for (auto _ : state) time.measure([&] { world.step(); });
  state.counters["us_per_step"] = 1e6 * time.seconds();
  state.counters["iterations"] = world.constraint_report().iterations;
}
BENCHMARK(chain)->ArgNames({"links", "modes"})->ArgsProduct({{1, 4, 16}, {0, 10}});

}  // namespace
}  // namespace limber
