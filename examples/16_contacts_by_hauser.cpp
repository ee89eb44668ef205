// 16_contacts_by_hauser: what do the paper's rules for contact do that limber's own do not?
//   bake:  scripts/make-bar 0.2 0.2 0.2 2 2 2 > box.mesh
//          limber-precompute box.mesh --youngs-modulus 1e7 --poisson-ratio 0.4 --density 1100 --damping-ratio 0.03@100,1000
//            --modes 8 -o box.glb
//   run:   16_contacts_by_hauser box.glb
//   see:   a box laid on a slope of 0.9 of the angle of friction, in its second second: limber's own keeps it where it is,
//          springs let it sink by a tenth of a millimetre, friction after the normals lets it slide; and how many linear
//          programs were solved
//   next:  limber-benchmark methods, docs/papers.md
#include <cmath>
#include <cstdio>
#include <exception>
#include <memory>
#include <vector>

#include "limber/collision/contact_finder.h"
#include "limber/engine/world.h"
#include "limber/hauser/hauser_method.h"
#include "limber/model/asset.h"

namespace {

using limber::ContactMethod;
using limber::FrictionModel;
using limber::Vec3;

void slide(const std::shared_ptr<const limber::ModalModel>& box, const char* name, const limber::ContactRule& rule) {
  constexpr double kFriction = 0.5, kHalf = 0.1;
  const double angle = 0.9 * std::atan(kFriction);
  const Vec3 normal(-std::sin(angle), 0.0, std::cos(angle));
  const limber::HauserMethod method(rule);
  limber::ContactFinder finder;
  limber::World world({.step = 1.0 / 60.0});
  world.set_island_solver(method.islands());
  world.set_contact_source(&finder, method.contacts({.friction = kFriction}));
  world.add_static(std::make_shared<limber::Shape>(limber::HalfSpace{normal, 0.0}));
  const limber::BodyId id = world.add_body(
      box, {.pose = {limber::quaternion_from_rotation_vector({0.0, -angle, 0.0}), (kHalf + 1e-5) * normal}});
  for (int i = 0; i < 60; ++i) world.step();
  const Vec3 before = world.body(id).pose.p;
  for (int i = 0; i < 60; ++i) world.step();
  const Vec3 way = world.body(id).pose.p - before;
  std::printf("%-34s creeps %.1e m in a second, %+.1e m above where it was laid, %ld programs\n", name, way.norm(),
              normal.dot(world.body(id).pose.p) - kHalf, method.programs().guard.solves);
}

}  // namespace

int main(int argc, char** argv) try {
  const auto box = limber::read_asset(argc > 1 ? argv[1] : "box.glb").bodies.at(0);
  slide(box, "limber's own", {});
  slide(box, "penalty", {.method = ContactMethod::kPenalty});
  slide(box, "velocity program", {.method = ContactMethod::kVelocityProgram});
  slide(box, "gap program", {.method = ContactMethod::kGapProgram});
  slide(box, "complementary, heuristic friction", {.friction = FrictionModel::kHeuristic});
} catch (const std::exception& e) {
  std::fprintf(stderr, "16_contacts_by_hauser: %s\n", e.what());
  return 1;
}
