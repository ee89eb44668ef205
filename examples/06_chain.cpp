// 06_chain: does a chain of flexible links stay together, and where does its energy go?
//   bake:  scripts/make-bar 0.5 0.02 0.01 60 4 4 > bar.mesh
//          limber-precompute bar.mesh --youngs-modulus 1e9 --poisson-ratio 0.35 --density 1200 --modes 10 -o link.glb
//   run:   06_chain link.glb
//   see:   eight links on hinges, let go level: half a minute of swinging; the joints' error and the energy. A chain
//          cracks like a whip: its step is a quarter of a frame, so that no link turns by a radian within it
//   next:  07_find_contacts
#include <algorithm>
#include <cstdio>
#include <exception>
#include <vector>

#include "limber/engine/world.h"
#include "limber/model/asset.h"

int main(int argc, char** argv) try {
  const auto link = limber::read_asset(argc > 1 ? argv[1] : "link.glb").bodies.at(0);
  float low = 0.0f, high = 0.0f;
  for (const limber::Vec3f& p : link->collision().rest) low = std::min(low, p.x()), high = std::max(high, p.x());
  const double length = high - low;

  limber::World world({.step = 1.0 / 240.0});
  // To round-off: the default, game contact, leaves a little (docs/contact.md).
  world.set_contact_source(nullptr, {.solver = limber::ContactSolver::kExact});
  limber::JointSpec hinge{.type = limber::JointType::kRevolute};  // about the world's y axis
  hinge.frame.axes << 0, 0, 1,                                    //
      1, 0, 0,                                                    //
      0, 1, 0;
  std::vector<limber::BodyId> links;
  std::vector<limber::JointId> joints;
  for (int i = 0; i < 8; ++i) {
    const limber::BodyId last = links.empty() ? limber::BodyId{} : links.back();
    links.push_back(world.add_body(link, {.pose = {.p = {i * length - low, 0, 0}}}));
    hinge.frame.origin = {i * length, 0, 0};
    joints.push_back(world.add_joint(last, links.back(), hinge, {.radius = 0.03}, {.radius = 0.03}));
  }
  double worst = 0.0;
  for (int frame = 0; frame <= 1800; ++frame) {
    if (frame % 300 == 0) {
      double energy = 0.0;
      for (const limber::BodyId id : links) energy += world.energy(id).total();
      std::printf("%4.0f s: energy %9.5f J, tip at %6.3f m, %d iterations\n", frame / 60.0, energy,
                  world.body(links.back()).pose.p.z(), world.constraint_report().iterations);
    }
    world.advance(1.0 / 60.0);
    for (const limber::JointId id : joints) worst = std::max(worst, world.joint(id).distance_error);
  }
  std::printf("joints off by %.1e m at most\n", worst);
} catch (const std::exception& e) {
  std::fprintf(stderr, "06_chain: %s\n", e.what());
  return 1;
}
