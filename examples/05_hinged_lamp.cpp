// 05_hinged_lamp: what holds flexible parts together?
//   bake:  scripts/make-bar 0.5 0.02 0.01 60 4 4 > bar.mesh
//          limber-precompute bar.mesh --youngs-modulus 2e8 --poisson-ratio 0.35 --density 1200 --modes 20 -o arm.glb
//   run:   05_hinged_lamp arm.glb
//   see:   a desk lamp of two flexible arms on hinges: drives carry it, a motor turns the elbow against its stop; the
//          hinges hold to round-off while the arms bend
//   next:  06_chain
#include <algorithm>
#include <cstdio>
#include <exception>

#include "limber/engine/world.h"
#include "limber/model/asset.h"

namespace {

/// A hinge about the world's y axis.
limber::JointSpec hinge(const limber::Vec3& origin) {
  limber::JointSpec spec{.type = limber::JointType::kRevolute, .frame = {.origin = origin}};
  spec.frame.axes << 0, 0, 1,  //
      1, 0, 0,                 //
      0, 1, 0;
  return spec;
}

}  // namespace

int main(int argc, char** argv) try {
  const auto arm = limber::read_asset(argc > 1 ? argv[1] : "arm.glb").bodies.at(0);
  float low = 0.0f, high = 0.0f;  // the arm's ends along x, body frame
  for (const limber::Vec3f& p : arm->collision().rest) low = std::min(low, p.x()), high = std::max(high, p.x());
  const double length = high - low;

  limber::World world({.step = 1.0 / 60.0});
  // To round-off: the default, game contact, leaves a little (docs/contact.md).
  world.set_contact_source(nullptr, {.solver = limber::ContactSolver::kExact});
  const limber::BodyId upper = world.add_body(arm, {.pose = {.p = {-low, 0, 0}}});
  const limber::BodyId lower = world.add_body(arm, {.pose = {.p = {length - low, 0, 0}}});
  // Each hinge sits on the end faces of the arms: what lies within 3 cm of it.
  const limber::JointAttachment end_face{.radius = 0.03};
  const limber::JointId shoulder = world.add_joint({}, upper, hinge({0, 0, 0}), {}, end_face);
  limber::JointSpec limited = hinge({length, 0, 0});
  limited.limits.rotation = {-0.5, 0.8};
  const limber::JointId elbow = world.add_joint(upper, lower, limited, end_face, end_face);

  world.set_joint_actuation(shoulder, 0, {.drive_target = -0.6, .drive_stiffness = 60.0, .drive_damping = 3.0});
  world.set_joint_actuation(elbow, 0, {.motor_velocity = 1.0, .motor_max_force = 2.0});
  double worst = 0.0;
  for (int frame = 1; frame <= 240; ++frame) {
    world.step();
    worst = std::max({worst, world.joint(shoulder).distance_error, world.joint(elbow).distance_error});
    if (frame % 40 != 0) continue;
    const double bent = world.energy(upper).elastic + world.energy(lower).elastic;
    std::printf("%.2f s: shoulder %6.3f rad, elbow %6.3f rad (%6.2f N m), bending %.1e J\n", frame / 60.0,
                world.joint(shoulder).position[0], world.joint(elbow).position[0], world.joint(elbow).force[0], bent);
  }
  std::printf("hinges off by %.1e m at most\n", worst);
} catch (const std::exception& e) {
  std::fprintf(stderr, "05_hinged_lamp: %s\n", e.what());
  return 1;
}
