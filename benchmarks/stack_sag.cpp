// How far a stack of boxes that bend comes down under its own weight, from World at rest, beside K u = f of all nodes
// of all boxes (box_stack.h), whose faces slide or stick. Prints Markdown. Figures: docs/reports/contact.md.
//   stack_sag [BOXES [REFINED [FRICTION]]]    10 boxes of 3 × 2 × 2 cells, so many times as many (1); 0.5
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <vector>

#include "box_stack.h"
#include "cpu_time.h"
#include "limber/collision/contact_finder.h"
#include "limber/engine/world.h"
#include "limber/precompute/bake.h"

namespace limber::testing {
namespace {

constexpr double kGap = 1e-5;  // between boxes as they are laid, m
constexpr int kSteps = 240, kModes = 12;

std::shared_ptr<const ModalModel> baked(const BoxStack& stack) {
  BakeOptions o;
  o.materials = {{"*", stack.material}};
  o.analysis.modes = o.limits.max_modes = kModes;
  o.analysis.mass = MassKind::kConsistent;
  o.residual.surface = true;
  o.damping = RayleighDamping::from_ratio(1.0, 30.0, 300.0);
  Warnings warnings;
  return bake({.name = "box", .mesh = stack.mesh()}, o, warnings).asset.bodies[0];
}

void run(const BoxStack& stack, double friction, double sliding, double sticking) {
  const auto model = baked(stack);
  ContactFinder finder;
  World world;
  world.set_contact_source(&finder,
                           {.solver = ContactSolver::kExact, .friction = friction, .residual_compliance = true});
  world.add_static(std::make_shared<Shape>(HalfSpace{}));
  const Vec3 centre = model->data().origin_in_input - Vec3(0.5 * stack.size.x(), 0.5 * stack.size.y(), 0.0);
  std::vector<BodyId> bodies;
  double height = 0.0;
  for (int i = 0; i < stack.boxes; ++i) {
    const Quaternion q = quaternion_from_rotation_vector({0.0, 0.0, stack.angle(i)});
    const Vec3 place = stack.foot(i) + q * centre;
    height = place.z();
    bodies.push_back(world.add_body(model, {.pose = {q, place + i * kGap * Vec3::UnitZ()}}));
  }
  int unsettled = 0;
  double spent = 0.0, fastest = 0.0;
  for (int i = 0; i < kSteps; ++i) {
    const double begin = thread_seconds();
    world.step();
    spent += thread_seconds() - begin;
    unsettled += world.constraint_report().solved ? 0 : 1;
  }
  for (const BodyId id : bodies) fastest = std::max(fastest, world.body(id).velocity.norm());
  const double sunk = height - world.body(bodies.back()).pose.p.z();
  std::printf("| %d | %.4e | %.4f | %.4f | %.0e | %d | %.0f |\n", world.constraint_report().rows, sunk, sunk / sliding,
              sunk / sticking, fastest, unsettled, 1e6 * spent / kSteps);
  std::fflush(stdout);
}

}  // namespace
}  // namespace limber::testing

int main(int argc, char** argv) {
  using namespace limber::testing;
  const int boxes = argc > 1 ? std::atoi(argv[1]) : 10, refined = argc > 2 ? std::atoi(argv[2]) : 1;
  const double friction = argc > 3 ? std::atof(argv[3]) : 0.5;
  if (argc > 4 || boxes < 1 || refined < 1 || !(friction >= 0.0)) {
    std::fprintf(stderr, "usage: stack_sag [BOXES [REFINED [FRICTION]]]\n");
    return 2;
  }
  const BoxStack stack{.cells = {3 * refined, 2 * refined, 2 * refined}, .boxes = boxes};
  const WholeStack whole(stack);
  const double sliding = whole.sunk(false).back(), sticking = whole.sunk(true).back();
  std::printf("All nodes: faces that slide %.4e m, that stick %.4e m.\n\n", sliding, sticking);
  std::printf(
      "| rows | the highest box comes down by, m | of all nodes, sliding | sticking | fastest, "
      "m/s | not "
      "settled | µs a step |\n|---|---|---|---|---|---|---|\n");
  run(stack, friction, sliding, sticking);
  return 0;
}
