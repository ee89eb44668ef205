#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "counted_new.h"
#include "limber/collision/contact_finder.h"
#include "limber/engine/world.h"
#include "sample_models.h"

namespace limber::testing {
namespace {

constexpr double kSize = 0.6;  // of the sample box, m
constexpr double kGravity = 9.80665;

/// Boxes whose first mode has 3 % of critical damping.
std::shared_ptr<const ModalModel> damped_box(int modes, double hz) {
  return sample_model({.modes = modes, .lowest_hz = hz, .decay = 0.03 * 2.0 * std::numbers::pi * hz});
}

/// A world with the ground, and its finder.
struct GroundedWorld {
  explicit GroundedWorld(const ContactOptions& options = {}) {
    world.set_contact_source(&finder, options);
    ground = world.add_static(std::make_shared<Shape>(HalfSpace{}));
  }
  ContactFinder finder;
  World world{{.step = 1.0 / 60.0}};
  BodyId ground;
};

/// The lowest vertex of a body's render surface.
double lowest(const World& world, BodyId id) {
  std::vector<float> positions(3 * static_cast<std::size_t>(world.model(id).render().vertices()));
  std::vector<float> normals;
  world.reconstruct(id, positions, normals);
  float low = positions[2];
  for (std::size_t i = 2; i < positions.size(); i += 3) low = std::min(low, positions[i]);
  return static_cast<double>(low);
}

TEST(WorldContact, AFallingBoxComesToRestOnTheGround) {
  for (const int modes : {0, 12}) {
    GroundedWorld scene;
    World& world = scene.world;
    const BodyId box = world.add_body(damped_box(modes, 30.0), {.pose = {{}, {0.0, 0.0, 0.6}}});
    for (int i = 0; i < 300; ++i) world.step();
    const Vec3 before = world.body(box).pose.p;
    for (int i = 0; i < 60; ++i) world.step();
    EXPECT_GT(lowest(world, box), -1e-3 * kSize) << modes;
    EXPECT_LT((world.body(box).pose.p - before).norm(), 1e-4) << modes;
  }
}

TEST(WorldContact, ABoxOnABoxStands) {
  constexpr double kHeight = 0.2, kPenetration = 1e-3 * kSize, kShift = 1e-4;  // m
  for (const int modes : {0, 6}) {
    GroundedWorld scene;
    World& world = scene.world;
    const auto model = damped_box(modes, 60.0);
    const BodyId lower = world.add_body(model, {.pose = {{}, {0.0, 0.0, 0.13}}});
    const BodyId upper = world.add_body(
        model, {.pose = {quaternion_from_rotation_vector({0.0, 0.0, 0.05}), {0.02, 0.015, 0.13 + kHeight + 0.02}}});
    for (int i = 0; i < 300; ++i) world.step();
    const Vec3 before = world.body(upper).pose.p;
    for (int i = 0; i < 60; ++i) world.step();
    EXPECT_LT((world.body(upper).pose.p - before).norm(), kShift) << modes;
    EXPECT_GT(lowest(world, lower), -kPenetration) << modes;
    EXPECT_NEAR(lowest(world, upper), kHeight, 2.0 * kPenetration) << modes;
  }
}

TEST(WorldContact, AStackOfTenRigidBoxesStands) {
  constexpr int kBoxes = 10;
  constexpr double kHeight = 0.2, kBelow = 0.11385, kApart = 1e-5;  // of a box; below its origin; between boxes, m
  constexpr double kPenetration = 1e-3 * kSize, kShift = 1e-4;      // m
  GroundedWorld scene;
  World& world = scene.world;
  const auto model = damped_box(0, 60.0);
  std::vector<BodyId> boxes;
  for (int i = 0; i < kBoxes; ++i) {
    const Vec3 place(0.02 * (i % 2), 0.015 * (i % 3), kBelow + kApart + i * (kHeight + kApart));
    boxes.push_back(world.add_body(model, {.pose = {quaternion_from_rotation_vector({0.0, 0.0, 0.05 * i}), place}}));
  }
  for (int i = 0; i < 300; ++i) world.step();
  std::vector<Vec3> before;
  for (const BodyId box : boxes) before.push_back(world.body(box).pose.p);
  for (int i = 0; i < 60; ++i) world.step();
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    EXPECT_LT((world.body(boxes[i]).pose.p - before[i]).norm(), kShift) << i;
    EXPECT_NEAR(lowest(world, boxes[i]), static_cast<double>(i) * kHeight, kPenetration) << i;
  }
}

TEST(WorldContact, EnergyOfBoxesThatFallOnEachOtherNeverRises) {
  constexpr double kRise = 1e-6;
  // What overlaps stays so: pushing it apart is work that the island is given.
  GroundedWorld scene({.recovery_speed = 0.0});
  World& world = scene.world;
  const auto model = sample_model({.modes = 8, .lowest_hz = 20.0});
  std::vector<BodyId> boxes;
  for (int i = 0; i < 3; ++i)
    boxes.push_back(world.add_body(
        model, {.pose = {quaternion_from_rotation_vector({0.3, 0.2 * i, 0.1}), {0.05 * i, 0.0, 0.5 + 0.5 * i}}}));
  const auto energy = [&] {
    double sum = 0.0;
    for (const BodyId box : boxes) sum += world.energy(box).total();
    return sum;
  };
  const double scale = 3.0 * model->data().mass * kGravity * kSize;
  double before = energy(), worst = 0.0;
  for (int i = 0; i < 180; ++i) {
    world.step();
    worst = std::max(worst, energy() - before);
    before = energy();
  }
  EXPECT_LT(worst, kRise * scale);
}

/// A damped box that is dropped bounces, in steps that are cut where it strikes, and comes to rest.
TEST(WorldContact, ImpactsInCutStepsGainNoEnergyAndEndAtRest) {
  constexpr double kRise = 1e-6;
  GroundedWorld scene({.recovery_speed = 0.0, .impact = ImpactModel::kHeldFromTouch});
  World& world = scene.world;
  const BodyId box = world.add_body(damped_box(8, 30.0), {.pose = {{}, {0.0, 0.0, 0.6}}});
  const double scale = world.energy(box).total();
  double before = scale, worst = 0.0, fastest = 0.0;
  int cuts = 0;
  for (int i = 0; i < 600; ++i) {
    world.step();
    cuts += world.constraint_report().cuts;
    fastest = std::max(fastest, world.body(box).velocity.z());
    worst = std::max(worst, world.energy(box).total() - before);
    before = world.energy(box).total();
  }
  EXPECT_GT(cuts, 0);
  EXPECT_GT(fastest, 1.0);  // of the 3 m/s that it falls at: it has bounced
  EXPECT_LT(worst, kRise * scale);
  const Vec3 rest = world.body(box).pose.p;
  for (int i = 0; i < 60; ++i) world.step();
  EXPECT_LT((world.body(box).pose.p - rest).norm(), 1e-4);
}

TEST(WorldContact, EventsNameTheBodiesAndTheVetoLetsThemFall) {
  GroundedWorld scene;
  World& world = scene.world;
  const BodyId box = world.add_body(damped_box(0, 30.0), {.pose = {{}, {0.0, 0.0, 0.12}}});
  for (int i = 0; i < 30; ++i) world.step();
  ASSERT_FALSE(world.contact_events().empty());
  double impulse = 0.0;
  for (const ContactEvent& contact : world.contact_events()) {
    EXPECT_EQ(std::min(contact.a, contact.b), static_cast<Index>(scene.ground.index));
    EXPECT_EQ(std::max(contact.a, contact.b), static_cast<Index>(box.index));
    impulse += std::abs(contact.impulse.z());
  }
  EXPECT_NEAR(impulse, world.model(box).data().mass * kGravity / 60.0, 1e-6);
  world.set_contact_veto([](const ContactPoint&) { return false; });
  for (int i = 0; i < 60; ++i) world.step();
  EXPECT_LT(world.body(box).pose.p.z(), -1.0);
}

TEST(WorldContact, StaticShapesAndBodiesComeAndGo) {
  GroundedWorld scene;
  World& world = scene.world;
  const BodyId table = world.add_static(std::make_shared<Shape>(Box{{1.0, 1.0, 0.1}}), {{}, {0.0, 0.0, 1.0}});
  const BodyId box = world.add_body(damped_box(0, 30.0), {.pose = {{}, {0.0, 0.0, 1.3}}});
  for (int i = 0; i < 120; ++i) world.step();
  EXPECT_NEAR(lowest(world, box), 1.1, 1e-3 * kSize);
  world.remove_body(table);
  EXPECT_FALSE(world.contains(table));
  for (int i = 0; i < 120; ++i) world.step();
  EXPECT_NEAR(lowest(world, box), 0.0, 1e-3 * kSize);
  world.remove_body(box);
  world.step();
  for (const ContactEvent& contact : world.contact_events()) EXPECT_EQ(contact.phase, ContactPhase::kEnded);
  world.step();
  EXPECT_TRUE(world.contact_events().empty());
}

TEST(WorldContact, AWarmStepAtRestAllocatesNothing) {
  GroundedWorld scene;
  World& world = scene.world;
  world.add_body(damped_box(4, 30.0), {.pose = {{}, {0.0, 0.0, 0.2}}});
  for (int i = 0; i < 200; ++i) world.step();
  const long before = allocations();
  world.step();
  EXPECT_EQ(allocations() - before, 0);
}

}  // namespace
}  // namespace limber::testing
