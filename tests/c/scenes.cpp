// The scenes of scenes.c in C++.
#include <cinttypes>
#include <cstdio>
#include <memory>

#include "limber/collision/contact_finder.h"
#include "limber/collision/manifold_finder.h"
#include "limber/engine/world.h"
#include "limber/model/soft_bodies.h"

namespace limber {
namespace {

BodyId add_crate(World& world, const Vec3& at, const Vec3& turn) {
  return world.add_rigid(std::make_shared<Shape>(Box{Vec3::Constant(0.25)}), 700.0,
                         {.pose = {.q = quaternion_from_rotation_vector(turn), .p = at}});
}

BodyId add_jelly(World& world, const Vec3& at, const Vec3& spin) {
  const Material jelly{.youngs_modulus = 1e5, .poisson_ratio = 0.4, .density = 1000.0};
  return world.add_body(make_soft_box({0.1, 0.1, 0.3}, {3, 3, 6}, jelly, 8),
                        {.pose = {.p = at}, .angular_velocity = spin});
}

void end(const char* name, World& world, int steps) {
  for (int i = 0; i < steps; ++i) world.step();
  std::printf("%s %016" PRIx64 "\n", name, world.state_hash());
}

void flight() {
  World world;
  const BodyId bar = add_jelly(world, {0, 0, 2}, {1, 2, 3});
  world.apply_impulse(bar, {.triangle = 5}, {0.5, 0.1, 2}, Axes::kBody, 0.004);
  end("flight", world, 600);
}

void joints() {
  World world;
  world.set_contact_source(nullptr, {.solver = ContactSolver::kExact});
  const BodyId a = add_crate(world, {0, 0, 2}, Vec3::Zero());
  const BodyId b = add_jelly(world, {0, 0, 1.4}, Vec3::Zero());
  world.add_joint({}, a, {.type = JointType::kBall, .frame = {.origin = {0.25, 0, 2}}});
  const JointId hinge = world.add_joint(
      a, b, {.type = JointType::kRevolute, .frame = {.origin = {0, 0, 1.7}}, .limits = {.rotation = {-0.5, 0.8}}});
  world.set_joint_actuation(hinge, 0, {.motor_velocity = 2.0, .motor_max_force = 5.0, .friction = 0.1});
  end("joints", world, 120);
}

void contact(const char* name, ContactSource& finder, ContactSolver solver, int crates, int steps) {
  World world;
  world.set_contact_source(&finder, {.solver = solver});
  world.add_static(std::make_shared<Shape>(HalfSpace{}));
  for (int i = 0; i < crates; ++i) add_crate(world, {0.02 * i, 0, 0.3 + 0.6 * i}, {0.1, 0, 0.2 * i});
  add_jelly(world, {0.1, 0, 0.6 + 0.6 * crates}, {0.5, 0, 0});
  end(name, world, steps);
}

}  // namespace
}  // namespace limber

int main() {
  limber::flight();
  limber::joints();
  limber::ContactFinder exact;
  limber::contact("contact_exact", exact, limber::ContactSolver::kExact, 2, 60);
  limber::ManifoldFinder game;
  limber::contact("contact_game", game, limber::ContactSolver::kGame, 6, 240);
}
