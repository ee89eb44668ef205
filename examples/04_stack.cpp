// 04_stack: how does a stack stand still, and what does it cost then?
//   bake:  scripts/make-bar 0.2 0.2 0.2 4 4 4 > box.mesh
//          limber-precompute box.mesh --youngs-modulus 1e7 --poisson-ratio 0.4 --density 1100 --damping-ratio 0.03@100,1000
//            --modes 10 -o box.glb
//   run:   04_stack box.glb
//   see:   five boxes laid on each other askew, where they settle and when they sleep; then the lowest is struck from the
//          side, and all wake. They meet as rigid boxes, which is cheap; ten boxes that meet by their flexing surfaces
//          stand as well, at a few ms a step (docs/contact.md). A strike rings the modes all the same
//   next:  05_hinged_lamp
#include <algorithm>
#include <cstdio>
#include <exception>
#include <memory>
#include <vector>

#include "limber/collision/manifold_finder.h"
#include "limber/engine/world.h"
#include "limber/model/asset.h"

namespace {

constexpr double kHeight = 0.2;  // of a box, m

void settle(limber::World& world, const std::vector<limber::BodyId>& stack) {
  const auto asleep = [&] {
    return std::count_if(stack.begin(), stack.end(), [&](limber::BodyId id) { return world.is_asleep(id); });
  };
  const double start = world.time();
  while (asleep() < static_cast<int>(stack.size()) && world.time() < start + 10.0) world.step();
  std::printf("%.2f s: %d of %zu asleep", world.time(), static_cast<int>(asleep()), stack.size());
  world.step();
  std::printf(", %d rows in the step after\n", world.constraint_report().rows);
  for (std::size_t i = 0; i < stack.size(); ++i) {
    const limber::RigidTransform pose = world.body(stack[i]).pose;
    const double tilt = (pose.q * limber::Vec3::UnitZ()).head<2>().norm();
    std::printf("  box %zu at (%+.4f, %+.4f), %+.1e m from its height, tilt %.1e rad\n", i, pose.p.x(), pose.p.y(),
                pose.p.z() - kHeight * (static_cast<double>(i) + 0.5), tilt);
  }
}

}  // namespace

int main(int argc, char** argv) try {
  const auto box = limber::read_asset(argc > 1 ? argv[1] : "box.glb").bodies.at(0);
  limber::ManifoldFinder finder;
  limber::World world({.step = 1.0 / 60.0, .sleep = {.enabled = true}});
  world.set_contact_source(&finder, {.friction = 0.5});
  world.add_static(std::make_shared<limber::Shape>(limber::HalfSpace{}));  // z ≤ 0

  const auto shape = std::make_shared<limber::Shape>(limber::Box{limber::Vec3::Constant(0.5 * kHeight)});
  std::vector<limber::BodyId> stack;
  for (int i = 0; i < 5; ++i) {
    const limber::Quaternion askew = limber::quaternion_from_rotation_vector({0.0, 0.0, 0.1 * i});
    const limber::Vec3 place(0.01 * (i % 2), 0.01 * (i % 3), kHeight * (i + 0.5) + 1e-5 * (i + 1));
    stack.push_back(world.add_body(box, {.pose = {askew, place}, .friction = 0.6, .shape = shape}));
  }
  settle(world, stack);
  world.apply_impulse(stack.front(), {.triangle = 0}, {3.0, 0.0, 0.0});  // N·s
  world.step();
  const limber::BodyEnergy struck = world.energy(stack.front());
  std::printf("struck: the highest %s, %d rows, %.1e J in the modes of the lowest\n",
              world.is_asleep(stack.back()) ? "sleeps on" : "is awake", world.constraint_report().rows,
              struck.kinetic_modal + struck.elastic);
  settle(world, stack);
} catch (const std::exception& e) {
  std::fprintf(stderr, "04_stack: %s\n", e.what());
  return 1;
}
