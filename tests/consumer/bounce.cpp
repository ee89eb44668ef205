// The first program of somebody who has read docs/hello.md: a ball that bounces, and a box that comes to rest.
#include <cstdio>
#include <memory>

#include "limber/collision/manifold_finder.h"
#include "limber/engine/world.h"

int main() {
  limber::ManifoldFinder finder;
  limber::World world;
  world.set_contact_source(&finder);
  world.add_static(std::make_shared<limber::Shape>(limber::HalfSpace{}));
  const auto sphere = std::make_shared<limber::Shape>(limber::Sphere{0.25});
  const auto crate = std::make_shared<limber::Shape>(limber::Box{{0.5, 0.5, 0.5}});
  const auto ball = world.add_rigid(sphere, 500.0, {.pose = {.p = {0, 0, 2}}, .restitution = 0.7});
  const auto box = world.add_rigid(crate, 700.0, {.pose = {.p = {3, 0, 2}}, .angular_velocity = {1, 0.5, 0}});
  for (int step = 0; step <= 240; world.step(), ++step)
    if (step % 10 == 0)
      std::printf("%.2f s: ball %.3f m, box %.3f m at %.4f m/s\n", world.time(), world.body(ball).pose.p.z(),
                  world.body(box).pose.p.z(), world.body(box).velocity.norm());
}
