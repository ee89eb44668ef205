// Small scenes with contacts, and what a step of each costs: bodies that flex, fall, lie awake, or lie in a bowl of
// many triangles beside joints. Prints Markdown: one row a scene, times of the thread's own, ms.
//   contact_scenes [SECONDS [SCENE]]    seconds per scene (5), part of the names of the scenes wanted
// Steps are 1/60 s by small steps. Depth is the deepest of all contacts at the steps' starts in the last second, and
// moved the way of the body that went farthest in it, both in units of the bodies' size.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "coarse_bunny.h"
#include "cpu_time.h"
#include "grounded_world.h"
#include "wavy_model.h"

namespace limber::testing {
namespace {

constexpr int kStepsOfSecond = 60;

struct Scene : GroundedWorld {
  explicit Scene(double s) : GroundedWorld(ContactOptions{}, WorldOptions{.sleep = false}), size(s) {
    world.set_contact_veto([this](const ContactPoint& contact) {
      deepest = std::min(deepest, contact.gap);
      ++contacts;
      return true;
    });
  }
  void add(std::shared_ptr<const ModalModel> model, const RigidTransform& pose) {
    bodies.push_back(world.add_body(std::move(model), {.pose = pose}));
  }
  double size;
  std::vector<BodyId> bodies;
  double deepest = 0.0;
  long contacts = 0;
};

std::shared_ptr<const ModalModel> box(int modes, double size) {
  return sample_model({.modes = modes, .lowest_hz = 60.0, .decay = 12.0, .half_extent = Vec3(0.5, 0.4, 0.3) * size});
}

/// In layers of three by three, each turned by itself.
void drop(Scene& scene, const std::shared_ptr<const ModalModel>& model, int count, double height) {
  for (int i = 0; i < count; ++i)
    scene.add(model, {quaternion_from_rotation_vector({0.3 * std::sin(i), 0.2 * std::cos(i), 0.5 * i}),
                      scene.size * Vec3(1.2 * (i % 3 - 1), 1.2 * (i / 3 % 3 - 1), height + 1.2 * (i / 9))});
}

void flexible_boxes(Scene& scene) { drop(scene, box(12, scene.size), 10, 0.8); }

void bunnies(Scene& scene) {
  const auto mesh = coarse_bunny(500);
  if (!mesh) return;
  SurfaceMesh small = *mesh;
  for (Vec3& p : small.vertices) p *= scene.size;
  drop(scene, wavy_model(small, 12), 8, 0.8);
}

void boxes_awake(Scene& scene) {
  const auto model = box(6, scene.size);
  for (int i = 0; i < 1000; ++i) scene.add(model, {{}, scene.size * Vec3(1.2 * (i % 32), 1.2 * (i / 32), 0.3)});
}

/// A bowl of 2 × 56² = 6,272 triangles, with rims as high as a body.
void bowl(Scene& scene) {
  constexpr int kCells = 56;
  constexpr double kHalf = 1.5;
  TriangleMesh mesh;
  for (int j = 0; j <= kCells; ++j)
    for (int i = 0; i <= kCells; ++i) {
      const double x = kHalf * (2.0 * i / kCells - 1.0), y = kHalf * (2.0 * j / kCells - 1.0);
      mesh.vertices.push_back({x, y, 0.1 + 0.4 * (x * x + y * y)});
    }
  for (int j = 0; j < kCells; ++j)
    for (int i = 0; i < kCells; ++i) {
      const Index v = j * (kCells + 1) + i, up = v + kCells + 1;
      mesh.triangles.push_back({v, v + 1, up + 1});
      mesh.triangles.push_back({v, up + 1, up});
    }
  scene.world.add_static(std::make_shared<const Shape>(std::move(mesh)));
  drop(scene, box(12, scene.size), 10, 3.0);
}

/// Four links on ball joints, and an arm of two on hinges with stops: a lamp.
void bowl_and_joints(Scene& scene) {
  bowl(scene);
  const auto link = sample_model({.modes = 6, .half_extent = {0.1, 0.02, 0.02}});
  BodyId last{};
  for (int i = 0; i < 4; ++i) {
    const Vec3 start(3.0 + 0.2 * i, 0.0, 1.5);
    const BodyId next = scene.world.add_body(link, {.pose = {{}, start + Vec3(0.1, 0.0, 0.0)}});
    scene.world.add_joint(last, next, {.type = JointType::kBall, .frame = {.origin = start}});
    last = next;
  }
  last = {};
  for (int i = 0; i < 2; ++i) {
    JointSpec hinge{.type = JointType::kRevolute};
    hinge.frame.origin = Vec3(3.0 + 0.2 * i, 1.0, 0.8);
    hinge.frame.axes << 0, 0, 1, 1, 0, 0, 0, 1, 0;  // about y
    hinge.limits.rotation = {-0.5, 0.5};
    const BodyId next = scene.world.add_body(link, {.pose = {{}, hinge.frame.origin + Vec3(0.1, 0.0, 0.0)}});
    scene.world.add_joint(last, next, hinge);
    last = next;
  }
}

struct Named {
  const char* name;
  double size;
  std::function<void(Scene&)> make;
};

double quantile(std::vector<double> times, double part) {
  std::sort(times.begin(), times.end());
  return times[static_cast<std::size_t>(part * static_cast<double>(times.size() - 1) + 0.5)];
}

void run(const Named& named, int seconds) {
  Scene scene(named.size);
  named.make(scene);
  if (scene.bodies.empty()) return;
  std::vector<double> all, last;
  std::vector<Vec3> before;
  for (int i = 0; i < seconds * kStepsOfSecond; ++i) {
    if (i == (seconds - 1) * kStepsOfSecond) {
      last.clear(), scene.deepest = 0.0;
      for (const BodyId id : scene.bodies) before.push_back(scene.world.body(id).pose.p);
    }
    scene.contacts = 0;
    const double begin = thread_seconds();
    scene.world.step();
    last.push_back(1e3 * (thread_seconds() - begin));
    all.push_back(last.back());
  }
  double moved = 0.0;
  for (std::size_t i = 0; i < before.size(); ++i)
    moved = std::max(moved, (scene.world.body(scene.bodies[i]).pose.p - before[i]).norm());
  std::printf("| %s | %.2f | %.2f | %.2f | %.2f | %ld | %.1e | %.1e |\n", named.name, quantile(all, 0.5),
              quantile(all, 0.99), quantile(all, 1.0), quantile(last, 0.5), scene.contacts, -scene.deepest / scene.size,
              moved / scene.size);
  std::fflush(stdout);
}

}  // namespace
}  // namespace limber::testing

int main(int argc, char** argv) {
  using namespace limber::testing;
  const int seconds = argc > 1 ? std::atoi(argv[1]) : 5;
  if (seconds < 1 || argc > 3) {
    std::fprintf(stderr, "contact_scenes [SECONDS [SCENE]]\n");
    return 2;
  }
  const std::string wanted = argc > 2 ? argv[2] : "";
  std::printf(
      "| scene | ms a step, p50 | p99 | worst | p50 of the last second | contacts | deepest / size | moved / size |"
      "\n|---|---|---|---|---|---|---|---|\n");
  for (const Named& named :
       {Named{"ten flexible boxes", 0.3, flexible_boxes}, Named{"eight bunnies", 0.3, bunnies},
        Named{"1,000 flexible boxes awake", 0.3, boxes_awake}, Named{"ten flexible boxes in a bowl", 0.3, bowl},
        Named{"bowl, chain and lamp", 0.3, bowl_and_joints}})
    if (std::string(named.name).find(wanted) != std::string::npos) run(named, seconds);
  return 0;
}
