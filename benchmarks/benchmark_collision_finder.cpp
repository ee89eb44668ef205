// Time of whole contact queries: many bodies that bend beside the same bodies rigid, apart and in a heap; and two
// bodies far apart. See README.md.
#include <benchmark/benchmark.h>

#include <cmath>
#include <memory>
#include <vector>

#include "cpu_time.h"
#include "finder_scenes.h"

namespace limber {
namespace {

using testing::ContactScene;

enum class Kind { kFlexing, kRigid };

/// `count` balls of radius about 0.5 m, `spacing` m apart on a grid, that bend by about 1 cm; or the same surfaces,
/// rigid (triangle meshes of the same triangles).
ContactScene balls(Kind kind, int count, double spacing, Index modes) {
  testing::Random random(5);
  const SurfaceMesh mesh = shapes::sphere(Vec3::Zero(), 0.5, 3);
  const auto ball = testing::wavy_model(mesh, modes);
  const auto rigid = std::make_shared<const Shape>(TriangleMesh{mesh.vertices, mesh.triangles});
  ContactScene scene;
  const int side = static_cast<int>(std::ceil(std::cbrt(count)));
  for (int i = 0; i < count; ++i) {
    const Vec3 cell(i % side, i / side % side, i / (side * side));
    const RigidTransform pose{random.pose(1.0).q, spacing * cell + random.vector(0.02)};
    if (kind == Kind::kFlexing)
      scene.add(BodyGeometry{.model = ball, .shape = {}}, pose, random.amplitudes(modes, 0.01));
    else
      scene.add(BodyGeometry{.model = {}, .shape = rigid}, pose);
  }
  return scene;
}

/// Each pass moves every body by about a millimetre, as a step does, and asks for the contacts.
void measure_queries(benchmark::State& state, ContactScene scene) {
  ContactFinder finder;
  scene.add_all_to(finder);
  std::vector<BodyState> states;
  std::vector<ContactPoint> contacts;
  LeastTime time;
  int step = 0;
  for (auto _ : state) {
    ++step;
    for (std::size_t i = 0; i < scene.poses.size(); ++i)
      scene.poses[i].p.x() += 0.001 * std::sin(0.3 * step + static_cast<double>(i));
    states = scene.states();
    time.measure([&] { finder.find_contacts({.states = states, .margin = 0.005}, contacts, serial_jobs()); });
  }
  state.counters["us"] = 1e6 * time.seconds();
  state.counters["ns_per_body"] = 1e9 * time.seconds() / static_cast<double>(scene.poses.size());
  state.counters["contacts"] = static_cast<double>(contacts.size());
}

/// range(0) bodies, range(1) spacing in cm, range(2) modes
void many(benchmark::State& state, Kind kind) {
  measure_queries(state, balls(kind, static_cast<int>(state.range(0)), 0.01 * static_cast<double>(state.range(1)),
                               static_cast<Index>(state.range(2))));
}
void many_scenes(benchmark::internal::Benchmark* b) {
  b->ArgNames({"bodies", "spacing_cm", "modes"});
  for (const int modes : {8, 32}) {
    b->Args({1000, 300, modes});  // far apart
    b->Args({1000, 110, modes});  // boxes overlap, surfaces do not
    b->Args({1000, 99, modes});   // each touches its neighbours
  }
  b->Args({2, 1000, 32});
}
BENCHMARK_CAPTURE(many, flexing, Kind::kFlexing)->Apply(many_scenes);
BENCHMARK_CAPTURE(many, rigid, Kind::kRigid)->Apply(many_scenes);

/// Balls, boxes and capsules in layers on a floor.
void heap(benchmark::State& state) { measure_queries(state, testing::heap(static_cast<int>(state.range(0)), 16)); }
BENCHMARK(heap)->ArgName("bodies")->Arg(100)->Arg(1000);

/// All but every tenth body of the heap asleep.
void heap_asleep(benchmark::State& state) {
  ContactScene scene = testing::heap(static_cast<int>(state.range(0)), 16);
  for (std::size_t i = 0; i < scene.asleep.size(); ++i) scene.asleep[i] = i % 10 != 5;
  measure_queries(state, scene);
}
BENCHMARK(heap_asleep)->ArgName("bodies")->Arg(1000);

}  // namespace
}  // namespace limber
