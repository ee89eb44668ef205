// Time of the broad phase for many bodies: limber's BroadPhase beside FCL's DynamicAABBTreeCollisionManager, on the
// same boxes in the same run. See README.md.
#include <benchmark/benchmark.h>
#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/geometry/shape/box.h>
#include <fcl/narrowphase/collision_object.h>

#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "cpu_time.h"
#include "limber/collision/broad_phase.h"

namespace limber {
namespace {

/// Boxes of edge 1 on average that wander at about 1 m/s in steps of 1/60 s.
class Scene {
 public:
  /// @param sleeping share of the bodies that do not move. @param spacing edge of the space per body, m
  Scene(int bodies, double sleeping, double spacing) {
    std::mt19937 random(1);
    const double side = spacing * std::cbrt(bodies);
    std::uniform_real_distribution<double> place(0.0, side), extent(0.3, 0.7), speed(-1.0, 1.0), share(0.0, 1.0);
    for (int i = 0; i < bodies; ++i) {
      center_.push_back({place(random), place(random), place(random)});
      half_extents_.push_back({extent(random), extent(random), extent(random)});
      velocity_.push_back({speed(random), speed(random), speed(random)});
      asleep_.push_back(share(random) < sleeping);
    }
  }
  void move() {
    sign_ = ++moves_ % 120 < 60 ? 1.0 : -1.0;
    for (std::size_t i = 0; i < center_.size(); ++i)
      if (!asleep_[i]) center_[i] += sign_ / 60.0 * velocity_[i];
  }
  std::size_t size() const { return center_.size(); }
  bool asleep(std::size_t i) const { return asleep_[i]; }
  const Vec3& center(std::size_t i) const { return center_[i]; }
  const Vec3& half_extents(std::size_t i) const { return half_extents_[i]; }
  Aabb box(std::size_t i) const { return {center_[i] - half_extents_[i], center_[i] + half_extents_[i]}; }

 private:
  std::vector<Vec3> center_, half_extents_, velocity_;
  std::vector<bool> asleep_;
  double sign_ = 1.0;
  int moves_ = 0;
};

// range(0) bodies, range(1) per cent asleep, range(2) edge of the space per body in tenths of a metre
Scene scene_of(const benchmark::State& state) {
  return {static_cast<int>(state.range(0)), 0.01 * static_cast<double>(state.range(1)),
          0.1 * static_cast<double>(state.range(2))};
}

/// Per query: new boxes of all that move, and the pairs.
void limber_broad_phase(benchmark::State& state) {
  Scene scene = scene_of(state);
  BroadPhase broad_phase;
  for (std::size_t i = 0; i < scene.size(); ++i) {
    broad_phase.add(static_cast<Index>(i));
    broad_phase.set_box(static_cast<Index>(i), scene.box(i));
    broad_phase.set_asleep(static_cast<Index>(i), scene.asleep(i));
  }
  std::vector<BodyPair> pairs;
  broad_phase.find_pairs(0.0, pairs, serial_jobs());
  LeastTime time;
  for (auto _ : state) {
    scene.move();
    time.measure([&] {
      for (std::size_t i = 0; i < scene.size(); ++i)
        if (!scene.asleep(i)) broad_phase.set_box(static_cast<Index>(i), scene.box(i));
      broad_phase.find_pairs(0.0, pairs, serial_jobs());
    });
  }
  state.counters["us"] = 1e6 * time.seconds();
  state.counters["pairs"] = static_cast<double>(pairs.size());
}

struct FclPairs {
  std::vector<std::pair<fcl::CollisionObjectd*, fcl::CollisionObjectd*>> pairs;
  const Scene* scene;
  static bool collect(fcl::CollisionObjectd* a, fcl::CollisionObjectd* b, void* data) {
    auto& self = *static_cast<FclPairs*>(data);
    // Its manager knows no sleep: two that rest are handed over like any others.
    const auto index = [](fcl::CollisionObjectd* o) { return reinterpret_cast<std::uintptr_t>(o->getUserData()); };
    if (!self.scene->asleep(index(a)) || !self.scene->asleep(index(b))) self.pairs.emplace_back(a, b);
    return false;
  }
};

/// The same by FCL: one manager for all, or one for those that move beside one for those that rest.
void fcl_broad_phase(benchmark::State& state, bool two_managers) {
  Scene scene = scene_of(state);
  std::vector<std::unique_ptr<fcl::CollisionObjectd>> objects;
  std::vector<fcl::CollisionObjectd*> moving, resting;
  for (std::size_t i = 0; i < scene.size(); ++i) {
    const Vec3 edge = 2.0 * scene.half_extents(i);
    objects.push_back(std::make_unique<fcl::CollisionObjectd>(std::make_shared<fcl::Boxd>(edge)));
    objects.back()->setTranslation(scene.center(i));
    objects.back()->setUserData(reinterpret_cast<void*>(i));
    objects.back()->computeAABB();
    (two_managers && scene.asleep(i) ? resting : moving).push_back(objects.back().get());
  }
  fcl::DynamicAABBTreeCollisionManagerd movers, resters;
  movers.registerObjects(moving);
  resters.registerObjects(resting);
  movers.setup();
  resters.setup();
  FclPairs found{{}, &scene};
  LeastTime time;
  for (auto _ : state) {
    scene.move();
    time.measure([&] {
      for (std::size_t i = 0; i < scene.size(); ++i)
        if (!scene.asleep(i)) objects[i]->setTranslation(scene.center(i)), objects[i]->computeAABB();
      movers.update();
      found.pairs.clear();
      movers.collide(&found, FclPairs::collect);
      if (!resting.empty()) resters.collide(&movers, &found, FclPairs::collect);
    });
  }
  state.counters["us"] = 1e6 * time.seconds();
  state.counters["pairs"] = static_cast<double>(found.pairs.size());
}

void scenes(benchmark::internal::Benchmark* b) {
  b->ArgNames({"bodies", "asleep", "spacing"});
  for (const int bodies : {1000, 10000}) {
    for (const int spacing : {30, 15, 10}) b->Args({bodies, 0, spacing});
    for (const int asleep : {90, 100}) b->Args({bodies, asleep, 15});
  }
}
BENCHMARK(limber_broad_phase)->Apply(scenes);
BENCHMARK_CAPTURE(fcl_broad_phase, one_manager, false)->Apply(scenes);
BENCHMARK_CAPTURE(fcl_broad_phase, two_managers, true)->Apply(scenes);

}  // namespace
}  // namespace limber
