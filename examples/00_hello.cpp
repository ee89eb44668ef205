// 00_hello: ground, a box that falls, a step, a line: everything that a game loop needs.
//   run:   00_hello
//   see:   the height and tilt of a wooden crate, ten times a second: it falls, lands on an edge, tips over and lies still.
//          docs/hello.md tells it line by line
//   next:  01_ring_a_bar
#include <cstdio>
#include <memory>

#include "limber/collision/manifold_finder.h"
#include "limber/engine/world.h"

int main() {
  limber::ManifoldFinder finder;              // finds where bodies touch
  limber::World world({.step = 1.0 / 60.0});  // s; gravity is −z
  world.set_contact_source(&finder);

  const auto ground = std::make_shared<limber::Shape>(limber::HalfSpace{});  // z ≤ 0
  world.add_static(ground);

  const auto crate = std::make_shared<limber::Shape>(limber::Box{{0.5, 0.5, 0.5}});  // half extents, m
  const limber::Quaternion askew = limber::quaternion_from_rotation_vector({0.3, 0.2, 0.0});
  const limber::BodyId box = world.add_rigid(crate, 700.0, {.pose = {askew, {0.0, 0.0, 3.0}}});  // kg/m³

  for (int step = 0; step <= 120; ++step) {
    if (step % 6 == 0) {
      const limber::RigidTransform pose = world.body(box).pose;
      const double tilt = (pose.q * limber::Vec3::UnitZ()).head<2>().norm();
      std::printf("%.1f s: height %.3f m, tilt %.3f\n", world.time(), pose.p.z(), tilt);
    }
    world.step();
  }
}
