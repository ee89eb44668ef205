// Compounds: bodies of several shapes, which others meet by their parts.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include "counted_new.h"
#include "grounded_world.h"
#include "limber/core/error.h"

namespace limber {
namespace {

using testing::GroundedWorld;
using testing::share;

/// A table of 1 m by 1 m, 0.6 m high, on four legs; its frame's origin is in the middle of the floor below it.
std::vector<ShapePart> table() {
  std::vector<ShapePart> parts{{share(Box{{0.5, 0.5, 0.05}}), {.p = {0, 0, 0.55}}}};
  const auto leg = share(Box{{0.05, 0.05, 0.25}});
  for (const double x : {-0.45, 0.45})
    for (const double y : {-0.45, 0.45}) parts.push_back({leg, {.p = {x, y, 0.25}}});
  return parts;
}

BodyId add_table(World& world, const Vec3& foot, const BodyPlacement& placement = {}) {
  const MassProperties mass = mass_properties(table(), 500.0);
  BodyPlacement at = placement;
  at.pose.p = foot + mass.center_of_mass;
  return world.add_rigid(table(), mass, at);
}

/// A dumb-bell: two balls and a bar, by hand.
TEST(Compound, MassesAddUpAndMomentsByTheParallelAxes) {
  const Quaternion along_x = quaternion_from_rotation_vector({0, std::numbers::pi / 2, 0});
  const auto ball = share(Sphere{0.2}), bar = share(Box{{0.02, 0.02, 0.5}});
  const std::vector<ShapePart> parts{
      {ball, {.p = {1.5, 2, 3}}}, {ball, {.p = {0.5, 2, 3}}}, {bar, {along_x, {1, 2, 3}}}};
  const MassProperties mass = mass_properties(parts, 1000.0);
  const double m = 1000.0 * 4.0 / 3.0 * std::numbers::pi * 0.008, b = 1000.0 * 0.04 * 0.04;
  EXPECT_NEAR(mass.mass, 2 * m + b, 1e-12 * m);
  EXPECT_LT((mass.center_of_mass - Vec3(1, 2, 3)).norm(), 1e-14);
  const double own = 0.4 * m * 0.04, along = b / 3.0 * 2 * 0.0004, across = b / 3.0 * (0.25 + 0.0004);
  EXPECT_NEAR(mass.inertia(0, 0), 2 * own + along, 1e-12 * m);
  EXPECT_NEAR(mass.inertia(1, 1), 2 * (own + 0.25 * m) + across, 1e-12 * m);
  EXPECT_NEAR(mass.inertia(2, 2), 2 * (own + 0.25 * m) + across, 1e-12 * m);
  EXPECT_LT(std::abs(mass.inertia(0, 1)) + std::abs(mass.inertia(0, 2)) + std::abs(mass.inertia(1, 2)), 1e-12 * m);
  EXPECT_THROW(mass_properties(std::vector<ShapePart>{}, 1.0), InvalidArgument);
  EXPECT_THROW(mass_properties(std::vector<ShapePart>{{nullptr, {}}}, 1.0), InvalidArgument);
  EXPECT_THROW(mass_properties(std::vector<ShapePart>{{share(HalfSpace{}), {}}}, 1.0), InvalidArgument);
}

/// Two halves of a box weigh, turn and slide as the box: v²/(2 μ g).
TEST(Compound, TwoHalvesOfABoxMoveAsTheBox) {
  const auto half = share(Box{{0.25, 0.5, 0.1}});
  const std::vector<ShapePart> halves{{half, {.p = {-0.25, 0, 0}}}, {half, {.p = {0.25, 0, 0}}}};
  const Box whole{{0.5, 0.5, 0.1}};
  const MassProperties a = mass_properties(halves, 500.0), b = mass_properties(whole, 500.0);
  EXPECT_NEAR(a.mass, b.mass, 1e-12 * b.mass);
  EXPECT_LT((a.inertia - b.inertia).norm(), 1e-12 * b.inertia.norm());
  GroundedWorld g({.friction = 0.4}, {.step = 1.0 / 240.0});
  const BodyId box = g.world.add_rigid(halves, 500.0, {.pose = {.p = {0, 0, 0.1}}, .velocity = {3, 0, 0}});
  g.step(480);
  const double way = 9.0 / (2.0 * 0.4 * 9.80665);
  EXPECT_NEAR(g.world.body(box).pose.p.x(), way, 0.01 * way);
  EXPECT_NEAR(g.world.body(box).pose.p.z(), 0.1, 1e-3);
}

/// A table stands; a ball rolls through below it, and another comes to rest on it.
TEST(Compound, OthersMeetThePartsAndGoBetweenThem) {
  GroundedWorld g({}, {.step = 1.0 / 120.0});
  const BodyId desk = add_table(g.world, {0, 0, 0});
  const BodyId below = g.world.add_rigid(
                   share(Sphere{0.15}), 500.0,
                   {.pose = {.p = {-1.5, 0, 0.15}}, .velocity = {3, 0, 0}, .angular_velocity = {0, 20, 0}}),
               above = g.world.add_rigid(share(Box{{0.1, 0.1, 0.1}}), 500.0, {.pose = {.p = {0.2, 0.1, 0.8}}});
  const Vec3 start = g.world.body(desk).pose.p;
  g.step(120);
  EXPECT_GT(g.world.body(below).pose.p.x(), 1.0);
  EXPECT_NEAR(g.world.body(above).pose.p.z(), 0.7, 2e-3);
  EXPECT_LT((g.world.body(desk).pose.p - start).norm(), 2e-3);
  EXPECT_GT(g.world.contact_impulse(above, desk).z(), 0.0);
  for (const ContactEvent& event : g.world.contact_events())
    for (const Index body : {event.a, event.b}) EXPECT_TRUE(g.world.contains(g.world.id_of(body)));
  g.step(120);  // until the ball is far away
  const long before = testing::allocations();
  g.step(60);
  EXPECT_EQ(testing::allocations() - before, 0);
}

TEST(Compound, QueriesAndSensorsKnowTheWhole) {
  World world;
  const BodyId desk = add_table(world, {0, 0, 0});
  const auto through_a_leg = world.cast_ray({.from = {-2, 0.45, 0.2}, .way = {4, 0, 0}});
  ASSERT_TRUE(through_a_leg);
  EXPECT_EQ(through_a_leg->body, desk);
  EXPECT_NEAR(through_a_leg->position.x(), -0.5, 1e-9);
  EXPECT_FALSE(world.cast_ray({.from = {-2, 0, 0.2}, .way = {4, 0, 0}}));
  std::vector<BodyHit> hits;
  world.cast_ray({.from = {-2, 0.45, 0.2}, .way = {4, 0, 0}}, hits);  // two legs
  EXPECT_EQ(hits.size(), 1u);
  std::vector<BodyId> bodies;
  world.find_overlaps(Sphere{2.0}, {}, bodies);
  EXPECT_EQ(bodies, std::vector<BodyId>{desk});
  world.list(bodies);
  EXPECT_EQ(bodies, std::vector<BodyId>{desk});
  EXPECT_EQ(world.body_count(), 1u);
  const BodyFilter none{.accepts = [&](BodyId id) { return id != desk; }};
  EXPECT_FALSE(world.cast_ray({.from = {-2, 0.45, 0.2}, .way = {4, 0, 0}}, none));
  const BodyId sensor = world.add_sensor(share(Sphere{2.0}));
  world.step();
  EXPECT_EQ(world.sensor_events().size(), 1u);
  world.set_velocity(desk, {100, 0, 0}, Vec3::Zero());
  for (int i = 0; i < 6; ++i) world.step();
  world.list_inside(sensor, bodies);
  EXPECT_TRUE(bodies.empty());
  world.remove_body(desk);
  EXPECT_EQ(world.body_count(), 1u);
  EXPECT_FALSE(world.cast_ray({.from = {8, 0.45, 0.2}, .way = {4, 0, 0}}));
}

/// A blow where a ray meets a leg gives the table the momentum, and the spin about its centre of mass, of a blow there.
TEST(Compound, APlaceThatAQueryTellsTakesLoads) {
  World world({.gravity = Vec3::Zero()});
  const BodyPlacement askew{.pose = {quaternion_from_rotation_vector({0.3, -0.5, 0.8}), {}}};
  const BodyId desk = add_table(world, {1, 2, 3}, askew);
  const RigidTransform X = world.body(desk).pose;
  const Vec3 to_leg(0.45, -0.45, 0.2 - mass_properties(table(), 500.0).center_of_mass.z());
  const auto hit = world.cast_ray({.from = X * (to_leg + Vec3(0, -2, 0)), .way = X.q * Vec3(0, 4, 0)});
  ASSERT_TRUE(hit && hit->at);
  EXPECT_EQ(hit->body, desk);
  EXPECT_LT((hit->position - X * (to_leg - Vec3(0, 0.05, 0))).norm(), 1e-9);
  EXPECT_LT((world.position(desk, *hit->at) - hit->position).norm(), 1e-6);  // drawn surfaces are single precision
  const Vec3 blow(10, -20, 30);
  world.apply_impulse(desk, *hit->at, blow);
  world.step();
  EXPECT_LT((world.linear_momentum(desk) - blow).norm(), 1e-9);
  EXPECT_LT((world.angular_momentum(desk) - (hit->position - X.p).cross(blow)).norm(), 1e-5);
  const HandleId hand = world.add_handle(desk, *hit->at);
  world.set_velocity(desk, {1, 1, 1}, {2, -1, 0.5});
  const Vec3 held = world.handle(hand).target.position;
  for (int i = 0; i < 30; ++i) world.step();
  EXPECT_LT((world.position(desk, *hit->at) - held).norm(), 1e-6);
}

/// A lift of a floor and two walls carries a ball up, and the walls take it along sideways.
TEST(Compound, OneThatIsLedCarriesOthers) {
  GroundedWorld g({}, {.step = 1.0 / 120.0});
  const auto floor = share(Box{{0.5, 0.5, 0.05}}), wall = share(Box{{0.05, 0.5, 0.3}});
  const BodyId lift = g.world.add_kinematic({{floor, {}}, {wall, {.p = {-0.5, 0, 0.3}}}, {wall, {.p = {0.5, 0, 0.3}}}},
                                            {.pose = {.p = {0, 0, 1}}, .velocity = {0.5, 0, 0.25}});
  EXPECT_EQ(g.world.body_type(lift), BodyType::kKinematic);
  const BodyId ball = g.world.add_rigid(share(Sphere{0.1}), 500.0, {.pose = {.p = {0, 0, 1.15}}});
  g.step(480);
  EXPECT_LT((g.world.body(lift).pose.p - Vec3(2, 0, 2)).norm(), 1e-9);
  EXPECT_NEAR(g.world.body(ball).pose.p.z(), 2.15, 5e-3);
  EXPECT_LT(std::abs(g.world.body(ball).pose.p.x() - 2.0), 0.45 - 0.1 + 5e-3);  // between the walls
  const auto hit = g.world.cast_ray({.from = {0, 0, 1.9}, .way = {4, 0, 0}});
  EXPECT_FALSE(hit);  // below the cabin
  EXPECT_EQ(g.world.cast_ray({.from = {0, 0.3, 2.3}, .way = {4, 0, 0}})->body, lift);
  EXPECT_THROW(g.world.add_kinematic(std::vector<ShapePart>{}), InvalidArgument);
}

/// An arm from one joint keeps apart what overlaps.
TEST(Compound, JointsKeepAllPartsApart) {
  GroundedWorld g;
  const BodyId desk = add_table(g.world, {0, 0, 0});
  const BodyId box = g.world.add_rigid(share(Box{{0.2, 0.2, 0.2}}), 500.0, {.pose = {.p = {0, 0, 0.5}}});
  g.world.add_joint(desk, box, {.type = JointType::kFixed, .frame = {.origin = {0, 0, 0.5}}});
  g.step(60);
  EXPECT_EQ(g.world.contact_impulse(desk, box), Vec3::Zero());
  EXPECT_NEAR(g.world.body(box).pose.p.z(), 0.5, 2e-3);
}

TEST(Compound, SleepsWakesAndIsInSnapshots) {
  GroundedWorld g({}, {.sleep = {.enabled = true}});
  const BodyId desk = add_table(g.world, {0, 0, 0.01});
  g.step(120);
  EXPECT_TRUE(g.world.is_asleep(desk));
  std::vector<std::byte> state;
  g.world.save_state(state);
  const BodyId ball = g.world.add_rigid(share(Sphere{0.1}), 500.0, {.pose = {.p = {0.1, 0, 1.0}}});
  add_table(g.world, {3, 0, 0.5});
  for (int i = 0; i < 60 && g.world.is_asleep(desk); ++i) g.world.step();
  EXPECT_FALSE(g.world.is_asleep(desk));
  g.step(20);
  EXPECT_GT(g.world.body(ball).pose.p.z(), 0.65);
  std::vector<std::byte> falling;
  g.world.save_state(falling);
  g.step(40);  // the other table lands
  const std::uint64_t hash = g.world.state_hash();
  g.world.restore_state(falling);
  g.step(40);
  EXPECT_EQ(g.world.state_hash(), hash);
  g.world.restore_state(state);  // what came since goes, parts and all
  EXPECT_EQ(g.world.body_count(), 2u);
  std::vector<std::byte> again;
  g.world.save_state(again);
  EXPECT_EQ(again, state);
}

/// Bodies of one kind share a model; another finder learns of the parts too.
TEST(Compound, SharesModelsAndIsToldToEveryFinder) {
  GroundedWorld g;
  const std::vector<ShapePart> parts = table();
  const BodyId a = g.world.add_rigid(parts, 500.0, {.pose = {.p = {0, 0, 1}}}),
               b = g.world.add_rigid(parts, 500.0, {.pose = {.p = {5, 0, 1}}});
  EXPECT_EQ(&g.world.model(a), &g.world.model(b));
  ManifoldFinder other;
  g.world.set_contact_source(&other);
  g.step(240);
  EXPECT_NEAR(g.world.body(a).pose.p.z(), mass_properties(parts, 500.0).center_of_mass.z(), 3e-3);
  g.world.set_contact_source(nullptr);
}

}  // namespace
}  // namespace limber
