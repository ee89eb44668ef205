// Queries in a world of a thousand bodies: rigid boxes, or balls that bend. Where Bullet is found, its ray test among
// the same boxes.
#include <benchmark/benchmark.h>

#include <memory>
#include <vector>

#include "cpu_time.h"
#include "limber/engine/world.h"
#include "random_states.h"
#include "shapes.h"
#include "wavy_model.h"

#ifdef LIMBER_HAS_BULLET
#include <btBulletCollisionCommon.h>
#endif

namespace {

using namespace limber;

constexpr int kBodies = 1000;
constexpr double kSide = 20.0;  // m, of the room

struct Room {
  explicit Room(bool bends) {
    limber::testing::Random random(1);
    const auto box = std::make_shared<const Shape>(Box{{0.4, 0.3, 0.2}});
    const auto ball = limber::testing::wavy_model(shapes::sphere(Vec3::Zero(), 0.4, 3), 12);
    for (int i = 0; i < kBodies; ++i) {
      const BodyPlacement at{.pose = random.pose(0.5 * kSide)};
      if (!bends) {
        world.add_rigid(box, 500.0, at);
        continue;
      }
      const BodyId id = world.add_body(ball, at);
      world.set_amplitudes(id, random.amplitudes(12, 0.03), std::vector<double>(12, 0.0));
    }
    for (int i = 0; i < 1024; ++i) rays.push_back({random.vector(0.5 * kSide), random.vector(kSide)});
  }
  World world;
  std::vector<Ray> rays;
};

template <class Ask>
void ask(benchmark::State& state, const Ask& question) {
  Room room(state.range(0) == 1);
  for (const Ray& ray : room.rays) question(room.world, ray);  // warm
  LeastTime least;
  long met = 0;
  for (auto _ : state)
    least.measure([&] {
      met = 0;
      for (const Ray& ray : room.rays) met += question(room.world, ray);
    });
  state.counters["ns"] = 1e9 * least.seconds() / static_cast<double>(room.rays.size());
  state.counters["met"] = static_cast<double>(met) / static_cast<double>(room.rays.size());
}

void ray(benchmark::State& state) {
  ask(state, [](const World& w, const Ray& r) { return w.cast_ray(r).has_value(); });
}
void ball_cast(benchmark::State& state) {
  ask(state, [](const World& w, const Ray& r) { return w.cast_shape(Sphere{0.1}, {.p = r.from}, r.way).has_value(); });
}
void nearest(benchmark::State& state) {
  ask(state, [](const World& w, const Ray& r) { return w.nearest_point(r.from, 2.0).has_value(); });
}
/// With the index brought up to date: every body has moved.
void ray_after_a_step(benchmark::State& state) {
  Room room(state.range(0) == 1);
  LeastTime least;
  for (auto _ : state) {
    room.world.step();
    least.measure([&] { benchmark::DoNotOptimize(room.world.cast_ray(room.rays.front())); });
  }
  state.counters["us"] = 1e6 * least.seconds();
}

BENCHMARK(ray)->ArgName("bends")->Arg(0)->Arg(1);
BENCHMARK(ball_cast)->ArgName("bends")->Arg(0)->Arg(1);
BENCHMARK(nearest)->ArgName("bends")->Arg(0)->Arg(1);
BENCHMARK(ray_after_a_step)->ArgName("bends")->Arg(0)->Arg(1);

#ifdef LIMBER_HAS_BULLET
btScalar to_bullet(double x) { return static_cast<btScalar>(x); }
btVector3 to_bullet(const Vec3& v) { return {to_bullet(v.x()), to_bullet(v.y()), to_bullet(v.z())}; }
btQuaternion to_bullet(const Quaternion& q) { return {to_bullet(q.x), to_bullet(q.y), to_bullet(q.z), to_bullet(q.w)}; }

/// The boxes of a room, in a broad phase of trees as its worlds have it.
struct BulletRoom {
  explicit BulletRoom(const Room& room) : dispatcher(&configuration), world(&dispatcher, &trees, &configuration) {
    std::vector<BodyId> bodies;
    room.world.list(bodies);
    for (const BodyId id : bodies) {
      const RigidTransform X = room.world.body(id).pose;
      auto& object = objects.emplace_back(std::make_unique<btCollisionObject>());
      object->setCollisionShape(&box);
      object->setWorldTransform(btTransform(to_bullet(X.q), to_bullet(X.p)));
      world.addCollisionObject(object.get());
    }
    world.updateAabbs();
  }
  ~BulletRoom() {
    for (const auto& object : objects) world.removeCollisionObject(object.get());
  }
  bool cast(const Ray& ray) const {
    const btVector3 from = to_bullet(ray.from), to = to_bullet(ray.from + ray.way);
    btCollisionWorld::ClosestRayResultCallback first(from, to);
    world.rayTest(from, to, first);
    return first.hasHit();
  }
  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher;
  btDbvtBroadphase trees;
  btBoxShape box{to_bullet(Vec3(0.4, 0.3, 0.2))};
  std::vector<std::unique_ptr<btCollisionObject>> objects;
  btCollisionWorld world;
};

void bullet_ray(benchmark::State& state) {
  const Room room(false);
  const BulletRoom bullet(room);
  LeastTime least;
  long met = 0;
  for (auto _ : state)
    least.measure([&] {
      met = 0;
      for (const Ray& ray : room.rays) met += bullet.cast(ray);
    });
  state.counters["ns"] = 1e9 * least.seconds() / static_cast<double>(room.rays.size());
  state.counters["met"] = static_cast<double>(met) / static_cast<double>(room.rays.size());
}
BENCHMARK(bullet_ray);
#endif

}  // namespace
