// 00_hello: ground, a box and a soft ball that fall, a step, a ray: everything that a game loop needs.
//   run:   00_hello
//   see:   the heights of a wooden crate and of a ball of jelly, ten times a second. The crate lands on a corner, tips over
//          and lies still; the ball bounces, wobbles and sags, and a ray tells by how much. docs/hello.md tells it line by
//          line
//   next:  01_ring_a_bar
#include <cstdio>
#include <memory>

#include "limber/collision/manifold_finder.h"
#include "limber/engine/world.h"
#include "limber/model/soft_bodies.h"

int main() {
  limber::ManifoldFinder finder;              // finds where bodies touch
  limber::World world({.step = 1.0 / 60.0});  // s; gravity is −z
  world.set_contact_source(&finder);

  const auto ground = std::make_shared<limber::Shape>(limber::HalfSpace{});  // z ≤ 0
  world.add_static(ground);

  const auto crate = std::make_shared<limber::Shape>(limber::Box{{0.5, 0.5, 0.5}});  // half extents, m
  const limber::Quaternion askew = limber::quaternion_from_rotation_vector({0.3, 0.2, 0.0});
  const limber::BodyId box = world.add_rigid(crate, 700.0, {.pose = {askew, {0.0, 0.0, 3.0}}});  // kg/m³

  const limber::Material jelly{.youngs_modulus = 1e5, .poisson_ratio = 0.4, .density = 1000.0};
  const auto wobbly = limber::make_soft_ball(0.3, 6, jelly, 12);  // radius, cells across, modes
  const limber::BodyId ball = world.add_body(wobbly, {.pose = {.p = {3.0, 0.0, 1.0}}});

  for (int step = 0; step <= 180; ++step) {
    if (step % 6 == 0)
      std::printf("%.1f s: crate at %.3f m, ball at %.3f m\n", world.time(), world.body(box).pose.p.z(),
                  world.body(ball).pose.p.z());
    world.step();
  }
  const limber::Vec3 above = world.body(ball).pose.p + limber::Vec3(0.0, 0.0, 1.0);
  if (const auto hit = world.cast_ray({.from = above, .way = {0.0, 0.0, -2.0}}))
    std::printf("a ray from above meets the %s at %.3f m\n", hit->body == ball ? "ball" : "ground", hit->position.z());
}
