// Time of a step of World without reconstruction, per body: in undisturbed free flight, under a force in every step,
// hung from a point, and at rest on the ground, awake and asleep; and of the free rotation alone. See README.md.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "cpu_time.h"
#include "grounded_world.h"
#include "limber/dynamics/free_rotation.h"
#include "limber/engine/world.h"
#include "sample_models.h"

namespace limber {
namespace {

enum class Flight { kUndisturbed, kForced, kHung };

/// range(0) modes, range(1) bodies.
void world_step(benchmark::State& state, Flight flight) {
  const auto modes = static_cast<int>(state.range(0)), bodies = static_cast<int>(state.range(1));
  const auto motion = flight == Flight::kHung ? FrameMotion::kPoint : FrameMotion::kFree;
  const auto model = testing::sample_model({.motion = motion, .modes = modes});
  World world;
  std::vector<BodyId> ids;
  const SurfacePoint at{.triangle = 3, .weight = {0.2, 0.5, 0.3}};
  for (int i = 0; i < bodies; ++i) {
    ids.push_back(world.add_body(model, {.angular_velocity = {0.1, 3.0 + 0.01 * i, 0.2}}));
    world.apply_impulse(ids.back(), at, {0.1, 0.2, 0.3});
  }
  const int repeats = 1 + 1000 / bodies;  // a pass of 100 µs or more
  LeastTime time;
  for (auto _ : state)
    time.measure([&] {
      for (int r = 0; r < repeats; ++r) {
        if (flight == Flight::kForced)
          for (const BodyId id : ids) world.apply_force(id, at, {0.01, 0.02, -0.01});
        world.step();
      }
    });
  state.counters["ns_per_body"] = 1e9 * time.seconds() / repeats / bodies;
}
BENCHMARK_CAPTURE(world_step, undisturbed, Flight::kUndisturbed)
    ->ArgNames({"modes", "bodies"})
    ->ArgsProduct({{0, 10, 40}, {1, 100, 1000}});
BENCHMARK_CAPTURE(world_step, forced, Flight::kForced)->ArgNames({"modes", "bodies"})->Args({40, 1000});
BENCHMARK_CAPTURE(world_step, hung, Flight::kHung)->ArgNames({"modes", "bodies"})->Args({40, 1000});

/// range(0) boxes on the ground that do not touch each other: what lies about.
enum class Rest { kAwake, kAsleep };

void world_rest(benchmark::State& state, Rest rest) {
  constexpr int kSteps = 90;  // until all sleep
  const auto bodies = static_cast<int>(state.range(0)), row = static_cast<int>(std::ceil(std::sqrt(bodies)));
  const auto model = testing::damped_box(6, 60.0);
  testing::GroundedWorld scene({}, {.sleep = {.enabled = rest == Rest::kAsleep}});
  std::vector<BodyId> ids;
  const double height = testing::depth_below_origin(*model);
  for (int i = 0; i < bodies; ++i)
    ids.push_back(scene.world.add_body(model, {.pose = {.p = {1.0 * (i % row), 1.0 * (i / row), height}}}));
  scene.step(kSteps);
  const auto asleep = [&] {
    return std::count_if(ids.begin(), ids.end(), [&](BodyId id) { return scene.world.is_asleep(id); });
  };
  if (asleep() != (rest == Rest::kAsleep ? bodies : 0)) state.SkipWithError("not as many bodies sleep as should");
  LeastTime time;
  for (auto _ : state) time.measure([&] { scene.world.step(); });
  state.counters["us_per_step"] = 1e6 * time.seconds();
  state.counters["islands"] = scene.world.constraint_report().islands;
}
// Set up once each: numbers of iterations that are sought set all up again.
BENCHMARK_CAPTURE(world_rest, awake, Rest::kAwake)->ArgName("bodies")->Arg(100)->Arg(1000)->Iterations(10);
BENCHMARK_CAPTURE(world_rest, asleep, Rest::kAsleep)->ArgName("bodies")->Arg(100)->Arg(1000)->Iterations(1000);

const PrincipalInertia kBody{{1.0, 2.0, 3.0}, {}};
/// range(0) 0: far from the separatrix (series in q), 1: next to it (in q').
Vec3 momentum(int which) { return which == 0 ? Vec3(0.3, 0.4, 2.0) : Vec3(0.3, 2.0, 0.2); }

void rotation_attitude(benchmark::State& state) {
  const FreeRotation rotation(kBody, {}, momentum(static_cast<int>(state.range(0))));
  LeastTime time;
  double t = 0.0;
  for (auto _ : state)
    time.measure([&] {
      for (int i = 0; i < 1000; ++i) benchmark::DoNotOptimize(rotation.attitude(t += 1.0 / 60.0));
    });
  state.counters["ns"] = 1e9 * time.seconds() / 1000;
}
BENCHMARK(rotation_attitude)->ArgName("near_separatrix")->Arg(0)->Arg(1);

void rotation_set_up(benchmark::State& state) {
  Vec3 L = momentum(static_cast<int>(state.range(0)));
  LeastTime time;
  for (auto _ : state)
    time.measure([&] {
      for (int i = 0; i < 1000; ++i) {
        L.x() += 1e-9;
        benchmark::DoNotOptimize(FreeRotation(kBody, {}, L));
      }
    });
  state.counters["ns"] = 1e9 * time.seconds() / 1000;
}
BENCHMARK(rotation_set_up)->ArgName("near_separatrix")->Arg(0)->Arg(1);

}  // namespace
}  // namespace limber
