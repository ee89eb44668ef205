// 11_many_hands: how are several points of a body held and led at once, and moved by forces that act elsewhere?
//   bake:  scripts/make-bar 0.4 0.2 0.03 16 8 2 > slab.mesh
//          limber-precompute slab.mesh --youngs-modulus 1e6 --poisson-ratio 0.4 --density 1100 --modes 30 -o slab.glb
//   run:   11_many_hands slab.glb
//   see:   a rubber slab held at its corners while two points within are led up and down, all six at their places in
//          every frame; then its middle is given a velocity, an acceleration and a place by forces at the corners alone
//   next:  World::manipulate and limber/constraints/manipulation.h
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <vector>

#include "limber/engine/world.h"
#include "limber/model/asset.h"

int main(int argc, char** argv) try {
  const auto slab = limber::read_asset(argc > 1 ? argv[1] : "slab.glb").bodies.at(0);
  limber::World world({.step = 1.0 / 60.0});
  // To round-off: the default, game contact, leaves a little (docs/contact.md).
  world.set_contact_source(nullptr, {.solver = limber::ContactSolver::kExact});
  const limber::BodyId id = world.add_body(slab);
  const auto near = [&](double x, double y) {
    return limber::patch_around(*slab, limber::SurfacePoint::Surface::kRender, {x, y, 0.015}, 0.0).front();
  };
  const std::vector<limber::SurfacePoint> corners{near(-0.2, -0.1), near(0.2, -0.1), near(-0.2, 0.1), near(0.2, 0.1)};
  const limber::SurfacePoint middle = near(0.0, 0.0);

  // Six points, each at its own place at the end of every step: [H03]'s position level.
  std::vector<limber::SurfacePoint> points = corners;
  points.push_back(near(-0.075, 0.0));
  points.push_back(near(0.075, 0.0));
  std::vector<limber::HandleId> hands;
  std::vector<limber::Vec3> start;
  for (const limber::SurfacePoint& at : points) {
    hands.push_back(world.add_handle(id, at));
    start.push_back(world.position(id, at));
  }
  double worst = 0.0, bent = 0.0;
  for (int frame = 1; frame <= 120; ++frame) {
    const double up = 0.02 * std::sin(0.1 * frame);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const double lift = i < corners.size() ? 0.0 : (i % 2 == 0 ? up : -up);
      world.set_handle_target(hands[i], {.position = start[i] + limber::Vec3(0.0, 0.0, lift)});
    }
    world.step();
    for (const limber::HandleId hand : hands) worst = std::max(worst, world.handle(hand).error);
    bent = std::max(bent, world.position(id, points.back()).z() - world.position(id, points[4]).z());
  }
  std::printf("six points held: worst error %.1e m, led apart by %.3f m\n", worst, bent);
  for (const limber::HandleId hand : hands) world.remove_handle(hand);

  // The middle moves as wanted, by forces at the corners.
  std::vector<limber::BodyForce> at_corners;
  for (const limber::SurfacePoint& corner : corners)
    for (int axis = 0; axis < 3; ++axis) at_corners.push_back({id, corner, limber::Vec3::Unit(axis)});
  std::vector<double> impulses(at_corners.size());
  const auto move = [&](const limber::Vec3& wanted, limber::ManipulationLevel level) {
    std::vector<limber::BodyWish> wishes;
    for (int axis = 0; axis < 3; ++axis) wishes.push_back({id, middle, limber::Vec3::Unit(axis), wanted[axis]});
    return world.manipulate(wishes, at_corners, impulses, level, 200);
  };
  const limber::Vec3 velocity(0.0, 0.0, 2.0);
  move(velocity, limber::ManipulationLevel::kVelocity);
  std::printf("velocity: off by %.1e m/s at once\n", (world.velocity(id, middle) - velocity).norm());

  const limber::ManipulationResult result = move(limber::Vec3::Zero(), limber::ManipulationLevel::kAcceleration);
  std::printf("acceleration: off by %.1e m/s2, %d directions met\n", result.residual, result.rank);
  world.step();

  const limber::Vec3 place = world.position(id, middle) + limber::Vec3(0.01, 0.0, 0.02);
  move(place, limber::ManipulationLevel::kPosition);
  world.step();
  std::printf("place: off by %.1e m after the step\n", (world.position(id, middle) - place).norm());
} catch (const std::exception& e) {
  std::fprintf(stderr, "11_many_hands: %s\n", e.what());
  return 1;
}
