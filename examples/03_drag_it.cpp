// 03_drag_it: how is a body taken by the hand?
//   bake:  scripts/make-bar 0.5 0.02 0.01 60 4 4 > bar.mesh
//          limber-precompute bar.mesh --youngs-modulus 5e6 --poisson-ratio 0.4 --density 1100 --modes 30 -o rubber.glb
//   run:   03_drag_it rubber.glb
//   see:   a rubber bar hung by one end and swung by it: the held point is at its target to round-off in every frame;
//          then pulled by a mouse spring, and let go
//   next:  04_stack
#include <cmath>
#include <cstdio>
#include <exception>

#include "limber/engine/world.h"
#include "limber/model/asset.h"

int main(int argc, char** argv) try {
  const auto bar = limber::read_asset(argc > 1 ? argv[1] : "rubber.glb").bodies.at(0);
  limber::World world({.step = 1.0 / 60.0});
  // To round-off: the default, game contact, leaves a little (docs/contact.md).
  world.set_contact_source(nullptr, {.solver = limber::ContactSolver::kExact});
  const limber::BodyId id = world.add_body(bar);
  const limber::SurfacePoint end{.triangle = 0};

  // A handle without stiffness: the point is where the hand is, at the end of every step.
  const limber::HandleId hand = world.add_handle(id, end);
  const limber::Vec3 start = world.position(id, end);
  double worst = 0.0;
  for (int frame = 1; frame <= 120; ++frame) {
    const double t = frame / 60.0;
    const limber::Vec3 target = start + limber::Vec3(0.0, 0.1 * std::sin(6.0 * t), 0.2 * t);
    world.set_handle_target(hand, {.position = target});
    world.step();
    worst = std::max(worst, (world.position(id, end) - target).norm());
    if (frame % 30 == 0)
      std::printf("%.1f s: force %6.2f N, error %.1e m\n", t, world.handle(hand).force.norm(),
                  world.handle(hand).error);
  }
  std::printf("two seconds of dragging, worst error %.1e m\n", worst);

  // A mouse spring: pulls by its stiffness, no harder than its force.
  world.remove_handle(hand);
  const limber::HandleId mouse = world.add_handle(id, end, {.max_force = 20.0, .stiffness = 40.0, .damping = 2.0});
  world.set_handle_target(mouse, {.position = world.position(id, end) + limber::Vec3(0.3, 0.0, 0.0)});
  for (int frame = 0; frame < 60; ++frame) world.step();
  std::printf("mouse spring: force %.2f N, %.3f m from its target\n", world.handle(mouse).force.norm(),
              world.handle(mouse).error);

  world.remove_handle(mouse);
  const double height = world.position(id, end).z();
  for (int frame = 0; frame < 30; ++frame) world.step();
  std::printf("let go: fell %.2f m in half a second\n", height - world.position(id, end).z());
} catch (const std::exception& e) {
  std::fprintf(stderr, "03_drag_it: %s\n", e.what());
  return 1;
}
