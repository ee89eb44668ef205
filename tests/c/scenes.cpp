// The scenes of scenes.c in C++.
//   test_cpp_scenes         prints their hashes
//   test_cpp_scenes --sets  plays them on every instruction set with fused multiply-add; fails unless the hashes are
//   the same
#include <hwy/targets.h>

#include <cinttypes>
#include <cstdio>
#include <cstring>
#include <map>
#include <memory>
#include <string>

#include "instruction_sets.h"
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

std::uint64_t hash_after(World& world, int steps) {
  for (int i = 0; i < steps; ++i) world.step();
  return world.state_hash();
}

std::uint64_t flight() {
  World world;
  const BodyId bar = add_jelly(world, {0, 0, 2}, {1, 2, 3});
  world.apply_impulse(bar, {.triangle = 5}, {0.5, 0.1, 2}, Axes::kBody, 0.004);
  return hash_after(world, 600);
}

std::uint64_t joints() {
  World world;
  world.set_contact_source(nullptr, {.solver = ContactSolver::kExact});
  const BodyId a = add_crate(world, {0, 0, 2}, Vec3::Zero());
  const BodyId b = add_jelly(world, {0, 0, 1.4}, Vec3::Zero());
  world.add_joint({}, a, {.type = JointType::kBall, .frame = {.origin = {0.25, 0, 2}}});
  const JointId hinge = world.add_joint(
      a, b, {.type = JointType::kRevolute, .frame = {.origin = {0, 0, 1.7}}, .limits = {.rotation = {-0.5, 0.8}}});
  world.set_joint_actuation(hinge, 0, {.motor_velocity = 2.0, .motor_max_force = 5.0, .friction = 0.1});
  return hash_after(world, 120);
}

std::uint64_t contact(ContactSource& finder, ContactSolver solver, int crates, int steps) {
  World world;
  world.set_contact_source(&finder, {.solver = solver});
  world.add_static(std::make_shared<Shape>(HalfSpace{}));
  for (int i = 0; i < crates; ++i) add_crate(world, {0.02 * i, 0, 0.3 + 0.6 * i}, {0.1, 0, 0.2 * i});
  add_jelly(world, {0.1, 0, 0.6 + 0.6 * crates}, {0.5, 0, 0});
  return hash_after(world, steps);
}

std::map<std::string, std::uint64_t> play() {
  ContactFinder exact;
  ManifoldFinder game;
  return {{"flight", flight()},
          {"joints", joints()},
          {"contact_exact", contact(exact, ContactSolver::kExact, 2, 60)},
          {"contact_game", contact(game, ContactSolver::kGame, 6, 240)}};
}

bool same_on_every_instruction_set() {
  const auto expected = play();
  bool same = true;
  for_each_instruction_set([&](std::int64_t target) {
    if (!has_fused_multiply_add(target)) return;
    const bool equal = play() == expected;
    std::printf("%s: %s\n", hwy::TargetName(target), equal ? "same" : "DIFFERENT");
    same = same && equal;
  });
  return same;
}

}  // namespace
}  // namespace limber

int main(int argc, char** argv) {
  if (argc > 1 && std::strcmp(argv[1], "--sets") == 0) return limber::same_on_every_instruction_set() ? 0 : 1;
  const auto hashes = limber::play();
  for (const char* name : {"flight", "joints", "contact_exact", "contact_game"})
    std::printf("%s %016" PRIx64 "\n", name, hashes.at(name));
}
