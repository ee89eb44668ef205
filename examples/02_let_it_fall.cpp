// 02_let_it_fall: what happens when a flexible body meets the ground?
//   bake:  scripts/make-bar 0.3 0.1 0.1 6 2 2 > block.mesh
//          limber-precompute block.mesh --youngs-modulus 5e6 --poisson-ratio 0.4 --density 1100 --damping-ratio 0.03@50,500
//            --modes 20 -o block.glb
//   run:   02_let_it_fall block.glb
//   see:   a rubber block dropped on one corner: each time that it hits the ground and with what impulse, the energy that
//          is left, and how still it lies after five seconds
//   next:  03_drag_it
#include <algorithm>
#include <cstdio>
#include <exception>
#include <memory>
#include <vector>

#include "limber/collision/manifold_finder.h"
#include "limber/engine/world.h"
#include "limber/model/asset.h"

int main(int argc, char** argv) try {
  const auto block = limber::read_asset(argc > 1 ? argv[1] : "block.glb").bodies.at(0);

  // Who finds contacts is the caller's choice.
  limber::ManifoldFinder finder;
  limber::World world({.step = 1.0 / 240.0});
  world.set_contact_source(&finder, {.friction = 0.6});
  world.add_static(std::make_shared<limber::Shape>(limber::HalfSpace{}));  // z ≤ 0
  const limber::Quaternion tilt = limber::quaternion_from_rotation_vector({0.5, 0.6, 0.0});
  const limber::BodyId id = world.add_body(block, {.pose = {tilt, {0.0, 0.0, 0.8}}});

  std::vector<float> positions(3 * static_cast<std::size_t>(block->render().vertices()));
  const auto lowest = [&] {
    world.reconstruct(id, positions, {});
    float low = positions[2];
    for (std::size_t i = 2; i < positions.size(); i += 3) low = std::min(low, positions[i]);
    return static_cast<double>(low);
  };

  int hits = 0;
  double deepest = 0.0;
  bool in_the_air = true;
  limber::Vec3 after_four_seconds = limber::Vec3::Zero();
  while (world.time() < 5.0) {
    world.step();
    limber::Vec3 impulse = limber::Vec3::Zero();
    for (const limber::ContactEvent& c : world.contact_events()) impulse += c.impulse;
    const double low = lowest();
    deepest = std::max(deepest, -low);
    if (in_the_air && impulse.norm() > 0.0)
      std::printf("%.3f s: hit %d, %6.3f N·s in its first step, energy %7.4f J\n", world.time(), ++hits, impulse.norm(),
                  world.energy(id).total());
    in_the_air = low > 1e-3;
    if (world.time() <= 4.0) after_four_seconds = world.body(id).pose.p;
  }
  const limber::Vec3 end = world.body(id).pose.p;
  std::printf("%.3f s: origin %.4f m above the ground, energy %.4f J, moved %.1e m in the last second\n", world.time(),
              end.z(), world.energy(id).total(), (end - after_four_seconds).norm());
  std::printf("lowest vertex at %+.1e m, never deeper than %.1e m\n", lowest(), deepest);
} catch (const std::exception& e) {
  std::fprintf(stderr, "02_let_it_fall: %s\n", e.what());
  return 1;
}
