// 10_joints_from_a_mesh: can a drawing that names no joint be swung by its joints?
//   bake:  make_assembly lamp --out lamp.obj
//   run:   10_joints_from_a_mesh lamp.obj
//   see:   a desk lamp's three hinges and its ball joint, found in the triangles with how far each goes; then two
//          seconds of the lamp let go, its first part held: anchors drift by round-off, no stop is passed
//   next:  docs/joints.md
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <vector>

#include "limber/articulation/detect_joints.h"
#include "limber/articulation/range_of_motion.h"
#include "limber/engine/world.h"
#include "limber/mesh/read_mesh.h"
#include "limber/precompute/bake.h"
#include "limber/precompute/tetrahedralise.h"

namespace {

using limber::Index;

/// A part as a body that bends: its surface filled with tetrahedra, and their lowest modes.
std::shared_ptr<const limber::ModalModel> body_of(const limber::Component& part) {
  limber::Warnings warnings;
  limber::BakeOptions options;
  options.materials = {{"*", {.youngs_modulus = 2e9, .poisson_ratio = 0.35, .density = 1200.0}}};
  options.damping = limber::RayleighDamping::from_ratio(0.02, 100.0, 1000.0);
  options.analysis.modes = 6;
  const auto tets = limber::tetrahedralise(part.surface, {.cell_size = part.diagonal / 20.0}, warnings);
  return limber::bake({.name = part.name, .mesh = tets.mesh, .render = part.surface}, options, warnings)
      .asset.bodies[0];
}

/// The limits that a reader looks at first: of the turn, of the slide, or of a ball's cone.
limber::Interval first_limit(const limber::JointSpec& joint) {
  if (joint.type == limber::JointType::kBall) return {0.0, joint.limits.cone};
  return limber::freedoms(joint.type).rotations > 0 ? joint.limits.rotation : joint.limits.translation[0];
}

/// How far a coordinate is beyond its limits, m or rad.
double beyond(const limber::Interval& limit, double q) { return std::max({limit.low - q, q - limit.high, 0.0}); }

/// The most by which a joint is beyond any of its limits.
double beyond_limits(const limber::JointSpec& joint, const limber::JointView& at) {
  const limber::JointLimits& l = joint.limits;
  const auto& q = at.position;
  switch (joint.type) {
    case limber::JointType::kRevolute:
      return beyond(l.rotation, q[0]);
    case limber::JointType::kPrismatic:
      return beyond(l.translation[0], q[0]);
    case limber::JointType::kCylindrical:
      return std::max(beyond(l.rotation, q[0]), beyond(l.translation[0], q[1]));
    case limber::JointType::kPlanar:
      return std::max({beyond(l.translation[0], q[0]), beyond(l.translation[1], q[1]), beyond(l.rotation, q[2])});
    case limber::JointType::kBall:  // Euler angles about x, y, z; the cone is between the x axes of the two parts
      return std::max({beyond(l.euler[0], q[0]), beyond(l.euler[1], q[1]), beyond(l.euler[2], q[2]),
                       std::acos(std::cos(q[1]) * std::cos(q[2])) - l.cone});
    case limber::JointType::kFixed:
      break;
  }
  return 0.0;
}

}  // namespace

int main(int argc, char** argv) try {
  limber::Warnings warnings;
  const auto drawing = limber::read_grouped_surface(argc > 1 ? argv[1] : "lamp.obj", warnings);
  const limber::Assembly assembly = limber::find_components(drawing, {.rule = limber::ComponentRule::kGroups});
  const auto found = limber::detect_joints(assembly);
  const auto ranges = limber::ranges_of_motion(assembly, found);

  limber::World world({.step = 1.0 / 240.0});
  // To round-off: the default, game contact, leaves a little (docs/contact.md).
  world.set_contact_source(nullptr, {.solver = limber::ContactSolver::kExact});
  std::vector<limber::BodyId> bodies;
  for (const limber::Component& part : assembly.components) {
    const auto body = body_of(part);
    bodies.push_back(world.add_body(body, {.pose = {.p = body->data().origin_in_input}}));  // stands where it was drawn
  }
  // The first part is held by all of its surface, the others by the patches that touch.
  limber::JointSpec floor{.type = limber::JointType::kFixed};
  floor.frame.origin = world.body(bodies[0]).pose.p;
  world.add_joint({}, bodies[0], floor, {}, {.radius = assembly.components[0].diagonal});
  std::vector<limber::JointId> joints;
  for (std::size_t i = 0; i < found.size(); ++i) {
    const auto a = static_cast<std::size_t>(found[i].a), b = static_cast<std::size_t>(found[i].b);
    const limber::JointAttachment patch{.radius = found[i].influence.half_extents.norm()};
    joints.push_back(world.add_joint(bodies[a], bodies[b], ranges[i].joint, patch, patch));
  }

  std::vector<double> swing(joints.size(), 0.0), passed(joints.size(), 0.0);
  double drift = 0.0;
  for (int step = 0; step < 480; ++step) {
    world.step();
    for (std::size_t i = 0; i < joints.size(); ++i) {
      const limber::JointView at = world.joint(joints[i]);
      drift = std::max(drift, at.distance_error);
      passed[i] = std::max(passed[i], beyond_limits(ranges[i].joint, at));
      for (int c = 0; c < at.coordinates; ++c)
        swing[i] = std::max(swing[i], std::abs(at.position[static_cast<std::size_t>(c)]));
    }
  }
  for (std::size_t i = 0; i < joints.size(); ++i) {
    const auto name = [&](Index component) {
      return assembly.components[static_cast<std::size_t>(component)].name.c_str();
    };
    const limber::Interval limit = first_limit(ranges[i].joint);
    std::printf("%-8s %s - %s: confidence %.2f, goes from %.3f to %.3f; moved by %.3f at most, %.0e beyond a stop\n",
                limber::to_string(ranges[i].joint.type).data(), name(found[i].a), name(found[i].b), found[i].confidence,
                limit.low, limit.high, swing[i], passed[i]);
  }
  std::printf("anchors off by %.0e of the size\n", drift / assembly.diagonal);
  constexpr double kRoundOff = 1e-10;  // anchors: of the size; stops: rad, m
  const bool good = !joints.empty() && drift < kRoundOff * assembly.diagonal &&
                    std::ranges::all_of(passed, [](double x) { return x < kRoundOff; });
  return good ? 0 : 1;
} catch (const std::exception& e) {
  std::fprintf(stderr, "10_joints_from_a_mesh: %s\n", e.what());
  return 1;
}
