// Contacts and joints of bodies that were baked from a mesh: their own surfaces, with as many features as such have.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "energy_meter.h"
#include "grounded_world.h"
#include "limber/precompute/bake.h"
#include "tet_box.h"

namespace limber::testing {
namespace {

const Material kBarRubber{.youngs_modulus = 5e6, .poisson_ratio = 0.4, .density = 1100.0};
const Vec3 kBar{0.3, 0.1, 0.1};  // m
constexpr double kLength = 0.3;
TetMesh rubber_bar_mesh() { return tet_box(6, 2, 2, kBar); }

std::shared_ptr<const ModalModel> rubber_bar() {
  BakeOptions o;
  o.materials = {{"*", kBarRubber}};
  o.analysis.modes = o.limits.max_modes = 20;
  o.analysis.mass = MassKind::kConsistent;
  o.volume_block = true;
  o.damping = RayleighDamping::from_ratio(0.03, 50.0, 500.0);
  Warnings warnings;
  return bake({.name = "bar", .mesh = rubber_bar_mesh()}, o, warnings).asset.bodies[0];
}

struct Momenta {
  Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
};
Momenta momenta(const World& world, const std::vector<BodyId>& bodies) {
  Momenta sum;
  for (const BodyId id : bodies) {
    sum.linear += world.linear_momentum(id);
    sum.angular += world.angular_momentum(id) + world.body(id).pose.p.cross(world.linear_momentum(id));
  }
  return sum;
}

void expect_kept(const Momenta& before, const Momenta& after) {
  EXPECT_LT((after.linear - before.linear).norm(), 1e-10 * before.linear.norm());
  EXPECT_LT((after.angular - before.angular).norm(), 1e-10 * before.angular.norm());
}

TEST(BakedContact, ABarThatIsDroppedOnItsEdgeComesToLieAndItsContactsCarryItsWeight) {
  GroundedWorld scene({.friction = 0.6});
  World& world = scene.world;
  const BodyId bar =
      world.add_body(rubber_bar(), {.pose = {quaternion_from_rotation_vector({0.3, 0.2, 0.0}), {0.0, 0.0, 0.25}}});
  scene.step(240);
  Vec3 impulse = Vec3::Zero();
  std::size_t contacts = 0;
  const Vec3 place = world.body(bar).pose.p;
  for (int i = 0; i < 60; ++i) {
    world.step();
    for (const ContactEvent& event : world.contact_events())
      impulse += event.a == static_cast<Index>(bar.index) ? event.impulse : Vec3(-event.impulse);
    contacts = std::max(contacts, world.contact_events().size());
  }
  const double weight = world.model(bar).data().mass * kGravity;  // for 60 steps of a 60th of a second
  EXPECT_NEAR(std::abs(impulse.z()), weight, 1e-6 * weight);
  EXPECT_GE(contacts, 3u);
  EXPECT_LT((world.body(bar).pose.p - place).norm(), 1e-6 * kLength);
  EXPECT_GT(lowest(world, bar), -1e-3 * kLength);
}

/// One flies across the other, both spin: what they hit with are edges and faces of bent surfaces.
TEST(BakedContact, BarsThatCollideKeepTheirMomentaAndGainNoEnergy) {
  ContactFinder finder;
  World world({.gravity = Vec3::Zero()});
  world.set_contact_source(&finder, {.solver = ContactSolver::kExact, .friction = 0.5, .recovery_speed = 0.0});
  const auto model = rubber_bar();
  const EnergyMeter meter(rubber_bar_mesh(), kBarRubber, model);
  const std::vector<BodyId> bars = {
      world.add_body(model, {.pose = {}, .velocity = {0.0, 0.0, 0.3}, .angular_velocity = {0.5, 1.0, 0.0}}),
      world.add_body(model, {.pose = {quaternion_from_rotation_vector({0.3, 0.1, 1.4}), {0.05, 0.02, 0.3}},
                             .velocity = {0.0, 0.1, -2.0},
                             .angular_velocity = {0.0, 2.0, 1.0}})};
  const Momenta before = momenta(world, bars);
  const double scale = total_energy(world, bars);
  double worst = 0.0, last = scale, bent = 0.0, node_start = 0.0, node_excess = 0.0, first_bound = 0.0;
  bool met = false;
  for (int i = 0; i <= 60; ++i) {
    double nodes = 0.0, bound = 0.0;
    for (const BodyId id : bars) {
      const NodeEnergy e = meter.read(world.body(id), Vec3::Zero());
      nodes += e.total(), bound += e.spin_bound;
      bent = std::max(bent, e.strain);
    }
    if (i == 0) node_start = nodes, first_bound = bound;
    node_excess = std::max(node_excess, nodes - node_start - bound - first_bound);
    world.step();
    met = met || !world.contact_events().empty();
    const double now = total_energy(world, bars);
    worst = std::max(worst, now - last);
    last = now;
  }
  EXPECT_TRUE(met);
  EXPECT_GT(bent, 1e-3 * scale) << "they bend";
  expect_kept(before, momenta(world, bars));
  EXPECT_LT(worst, 1e-6 * scale);
  EXPECT_LT(node_excess, 1e-6 * scale);
}

TEST(BakedJoint, AChainOfBarsThatFlyAndBendHoldsTogetherAndKeepsItsMomenta) {
  World world({.gravity = Vec3::Zero()});
  world.set_contact_source(nullptr, exactly());
  const auto model = rubber_bar();
  std::vector<BodyId> links;
  std::vector<JointId> joints;
  for (int i = 0; i < 3; ++i) {
    links.push_back(world.add_body(model, {.pose = {.p = {kLength * i, 0.0, 0.0}}}));
    if (i == 0) continue;
    JointSpec joint{.type = i == 1 ? JointType::kRevolute : JointType::kBall};
    joint.frame.origin = {kLength * (i - 0.5), 0.0, 0.0};
    const JointAttachment end{.radius = 0.06};
    joints.push_back(world.add_joint(links[static_cast<std::size_t>(i - 1)], links.back(), joint, end, end));
  }
  world.apply_impulse(links[0], {.triangle = 0}, {0.3, -2.0, 4.0});
  world.apply_impulse(links[2], {.triangle = 5}, {0.5, 1.0, -1.0});
  const Momenta before = momenta(world, links);
  const double scale = total_energy(world, links);
  double bent = 0.0, worst = 0.0, last = scale;
  for (int i = 0; i < 120; ++i) {
    world.step();
    EXPECT_TRUE(world.constraint_report().solved) << i;
    for (const JointId joint : joints) {
      EXPECT_LT(world.joint(joint).distance_error, 1e-9 * kLength) << i;
      EXPECT_LT(world.joint(joint).angle_error, 1e-9) << i;
    }
    for (const BodyId id : links) bent = std::max(bent, world.energy(id).elastic);
    const double now = total_energy(world, links);
    worst = std::max(worst, now - last);
    last = now;
  }
  EXPECT_GT(bent, 1e-3 * scale) << "they bend";
  expect_kept(before, momenta(world, links));
  EXPECT_LT(worst, 1e-6 * scale);
}

}  // namespace
}  // namespace limber::testing
