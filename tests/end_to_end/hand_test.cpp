// Hands that lead baked bodies: contacts only push, indentations are those of forces at hand, and no hand does more
// work than its largest force times the way of its point.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include "asked.h"
#include "grounded_world.h"
#include "limber/precompute/bake.h"
#include "tet_box.h"

namespace limber::testing {
namespace {

constexpr double kSide = 0.4, kMostForce = 3000.0, kFriction = 0.5;  // m; N along each axis
const HandleOptions kLimitedHand{.max_force = kMostForce};
const HandleOptions kSpringHand{.max_force = kMostForce, .stiffness = 4000.0, .damping = 60.0};

std::shared_ptr<const ModalModel> rubber_box(bool residual, int cells) {
  BakeOptions o;
  o.materials = {{"*", {.youngs_modulus = 1e7, .poisson_ratio = 0.4, .density = 1100.0}}};
  o.analysis.modes = o.limits.max_modes = 12;
  o.residual.surface = residual;
  o.damping = RayleighDamping::from_ratio(0.03, 50.0, 500.0);
  Warnings warnings;
  return bake({.name = "box", .mesh = tet_box(cells, cells, cells, Vec3::Constant(kSide))}, o, warnings)
      .asset.bodies[0];
}

/// A hand at the middle of a triangle, and the work that it could have done in a step.
struct Hand {
  Hand(World& world, BodyId of, Index triangle, const HandleOptions& options)
      : body(of), at{.triangle = triangle}, start(world.position(of, at)), id(world.add_handle(of, at, options)) {}
  void lead(World& world, const Vec3& offset) {
    before = world.position(body, at);
    world.set_handle_target(id, {.position = start + offset});
  }
  double most_work(const World& world) const { return kMostForce * (world.position(body, at) - before).lpNorm<1>(); }

  BodyId body;
  SurfacePoint at;
  Vec3 start, before = Vec3::Zero();
  HandleId id;
};

double largest_indentation(const World& world, BodyId body, Index triangles) {
  double largest = 0.0;
  for (Index t = 0; t < triangles; ++t) largest = std::max(largest, world.indentation(body, {.triangle = t}).norm());
  return largest;
}

/// Coulomb's law of what a contact did in a step. Forces of the parts of a step may lie in planes that have turned.
void expect_push(const ContactEvent& event) {
  const double pressed = event.impulse.dot(event.normal);
  EXPECT_GE(pressed, 0.0);
  EXPECT_LE((event.impulse - pressed * event.normal).norm(), (1.0 + 1e-6) * kFriction * pressed + 1e-12);
}

/// A box on the ground that a hand drags, turns over and puts down. A force of 1e4 N, three hands' and the weight,
/// makes indentations of a centimetre in it.
TEST(Hands, ContactsOfABoxThatIsLedPushAndDentItByTheirForces) {
  constexpr double kIndentation = 0.02, kSpeed = 10.0;
  const int steps = kSanitized ? 20 : 240;
  const auto model = rubber_box(true, 3);
  const auto triangles = static_cast<Index>(model->collision().triangles.size());
  for (const HandleOptions& options : {kSpringHand, kLimitedHand}) {
    GroundedWorld scene(exactly({.friction = kFriction}));
    World& world = scene.world;
    const BodyId box = world.add_body(model, {.pose = {{}, {0.0, 0.0, 0.5 * kSide}}});
    for (int i = 0; i < 10; ++i) world.step();
    Hand hand(world, box, 40, options);
    for (int i = 0; i < steps; ++i) {
      SCOPED_TRACE(::testing::Message() << "stiffness " << options.stiffness << ", step " << i);
      hand.lead(world, {0.5 * std::sin(0.05 * i), 0.3 * std::sin(0.031 * i), 0.15 * (1.0 - std::cos(0.04 * i))});
      world.step();
      for (const ContactEvent& event : world.contact_events()) expect_push(event);
      ASSERT_LT(largest_indentation(world, box, triangles), kIndentation);
      ASSERT_LT(world.body(box).velocity.norm(), kSpeed);
    }
  }
}

/// Two boxes on hinges, at whose end a hand pulls at what is out of reach: where they are stretched no impulse of a
/// size can move the point as its target moves.
TEST(Hands, LimitedOneDoesNoMoreWorkThanItsForceTimesItsWay) {
  constexpr double kReach = 0.45, kHeight = 0.8, kSpeed = 10.0, kApart = 1e-11;
  const int steps = kSanitized ? 10 : 300;
  const auto model = rubber_box(false, 4);
  for (const bool touches : {false, true}) {
    GroundedWorld scene(exactly({.friction = kFriction}));
    World plain({.step = scene.world.options().step});
    plain.set_contact_source(nullptr, exactly());
    World& world = touches ? scene.world : plain;
    JointSpec hinge{.type = JointType::kRevolute};
    hinge.frame.axes << 0, 0, 1, 1, 0, 0, 0, 1, 0;
    std::vector<BodyId> boxes;
    std::vector<JointId> hinges;
    BodyId last{};
    for (int i = 0; i < 2; ++i) {
      boxes.push_back(world.add_body(model, {.pose = {{}, {(0.5 + i) * kReach, 0.0, kHeight}}}));
      hinge.frame.origin = Vec3(kReach * i, 0.0, kHeight);
      hinges.push_back(world.add_joint(last, boxes.back(), hinge, {.radius = 0.12}, {.radius = 0.12}));
      last = boxes.back();
    }
    Hand hand(world, boxes[1], 40, kLimitedHand);
    for (int i = 0; i < steps; ++i) {
      SCOPED_TRACE(::testing::Message() << "contacts " << touches << ", step " << i);
      const double before = total_energy(world, boxes);
      hand.lead(world, {0.8 * std::sin(0.03 * i), 0.5 * std::sin(0.021 * i), 0.4 * std::sin(0.05 * i)});
      world.step();
      ASSERT_LE(total_energy(world, boxes) - before, (1.0 + 1e-6) * hand.most_work(world) + 1e-6);
      ASSERT_LE(world.handle(hand.id).force.lpNorm<Eigen::Infinity>(), (1.0 + 1e-9) * kMostForce);
      for (const BodyId id : boxes) ASSERT_LT(world.body(id).velocity.norm(), kSpeed);
      for (const JointId id : hinges) ASSERT_LT(world.joint(id).distance_error, kApart);
    }
  }
}

}  // namespace
}  // namespace limber::testing
