// Gravity's share, damping and locked axes of single bodies; bodies that are led.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <vector>

#include "counted_new.h"
#include "grounded_world.h"
#include "limber/core/error.h"

namespace limber {
namespace {

using testing::GroundedWorld;
using testing::share;

constexpr double kG = 9.80665;
constexpr AxisLocks kNoTurn{.rotation = {true, true, true}};

TEST(FrameSettings, GravityScaleFallsWithItsShareOfGravity) {
  World world({.step = 0.1});
  std::vector<BodyId> bodies;
  const auto ball = share(Sphere{0.1});
  for (const double scale : {1.0, 0.25, 0.0, -1.0}) {
    bodies.push_back(world.add_rigid(ball, 1000.0));
    world.set_gravity_scale(bodies.back(), scale);
  }
  for (int i = 0; i < 10; ++i) world.step();
  for (const BodyId body : bodies) {
    const double fall = -0.5 * world.frame_settings(body).gravity_scale * kG;
    EXPECT_NEAR(world.body(body).pose.p.z(), fall, 1e-13);
    EXPECT_NEAR(world.energy(body).total(), 0.0, 1e-12 * world.model(body).data().mass * kG);
  }
}

/// A body that lies weighs its share: half of it carries what friction holds of it.
TEST(FrameSettings, GravityScaleIsTheWeightThatPressesOnTheGround) {
  for (const ContactSolver solver : {ContactSolver::kGame, ContactSolver::kExact}) {
    GroundedWorld g({.solver = solver}, {.step = 1.0 / 120.0});
    const BodyId box = g.world.add_rigid(share(Box{{0.5, 0.5, 0.5}}), 100.0,
                                         {.pose = {.p = {0, 0, 0.5}}, .frame = {.gravity_scale = 0.5}});
    g.step(120);
    double impulse = 0.0;
    for (const ContactEvent& event : g.world.contact_events()) impulse += event.impulse.z();
    EXPECT_NEAR(std::abs(impulse), 0.5 * 100.0 * kG / 120.0, 1e-3 * 100.0 * kG / 120.0);
    EXPECT_NEAR(g.world.body(box).pose.p.z(), 0.5, 1e-3);
  }
}

/// On ice: v = v₀ e^{−ct}, whatever the step.
TEST(FrameSettings, DampingSlowsABodyInContactByTheExponential) {
  for (const double step : {1.0 / 60.0, 1.0 / 240.0}) {
    GroundedWorld g({.friction = 0.0}, {.step = step});
    const BodyId box =
        g.world.add_rigid(share(Box{{0.5, 0.5, 0.1}}), 500.0, {.pose = {.p = {0, 0, 0.1}}, .velocity = {3, 0, 0}});
    g.world.set_damping(box, 0.8, 0.0);
    g.step(static_cast<int>(std::lround(1.0 / step)));
    EXPECT_NEAR(g.world.body(box).velocity.x(), 3.0 * std::exp(-0.8), 1e-5);
  }
}

/// A parachute: the speed of fall comes to g/c and to no more.
TEST(FrameSettings, LinearDampingGivesATerminalSpeed) {
  World world({.step = 0.5});
  const BodyId ball = world.add_rigid(share(Sphere{0.1}), 1000.0, {.frame = {.linear_damping = 2.0}});
  for (int i = 0; i < 40; ++i) world.step();
  EXPECT_NEAR(world.body(ball).velocity.z(), -kG / 2.0, 1e-12);
}

/// A body that may not turn stands with most of it over an edge, and slides off it upright.
TEST(FrameSettings, ALockedBodyDoesNotTipOverAnEdge) {
  GroundedWorld g({}, {.step = 1.0 / 120.0});
  g.world.add_static(share(Box{{0.5, 0.5, 0.5}}), {{}, {0, 0, 0.5}});
  const auto box = share(Box{{0.4, 0.4, 0.4}});
  const BodyId locked = g.world.add_rigid(box, 500.0, {.pose = {.p = {0.8, 0, 1.4}}, .frame = {.locks = kNoTurn}}),
               other = g.world.add_rigid(box, 500.0, {.pose = {.p = {0, 0.8, 1.4}}});
  g.step(120);
  EXPECT_EQ(g.world.body(locked).pose.q.w, 1.0);
  EXPECT_NEAR(g.world.body(locked).pose.p.z(), 1.4, 1e-3);
  EXPECT_LT(g.world.body(other).pose.p.z(), 1.3);
}

/// Struck along a locked axis by another, which comes back as from what stands.
TEST(FrameSettings, ABodyLockedAlongAnAxisIsAWallThere) {
  GroundedWorld g({.friction = 0.0}, {.step = 1.0 / 240.0});
  const auto box = share(Box{{0.2, 0.2, 0.2}}), ball = share(Sphere{0.2});
  const BodyId wall = g.world.add_rigid(box, 100.0, {.pose = {.p = {0, 0, 0.2}}}),
               ram = g.world.add_rigid(ball, 1000.0, {.pose = {.p = {-1, 0, 0.2}}, .velocity = {2, 0, 0}}),
               other = g.world.add_rigid(ball, 1000.0, {.pose = {.p = {-1, 3, 0.2}}, .velocity = {2, 0, 0}});
  g.world.add_static(box, {.p = {0, 3, 0.2}});
  g.world.set_locks(wall, {.translation = {true, false, false}, .rotation = {true, true, true}});
  g.step(240);
  EXPECT_EQ(g.world.body(wall).pose.p.x(), 0.0);
  EXPECT_EQ(g.world.body(wall).velocity.x(), 0.0);
  EXPECT_LE(g.world.body(ram).pose.p.x(), -0.4 + 1e-3);
  EXPECT_NEAR(g.world.body(ram).velocity.x(), g.world.body(other).velocity.x(), 1e-4);
  EXPECT_NEAR(g.world.body(ram).pose.p.x(), g.world.body(other).pose.p.x(), 1e-4);
  g.world.set_velocity(wall, {5, 1, 0}, {1, 1, 1});  // what is locked is left out
  EXPECT_EQ(g.world.body(wall).velocity, Vec3(0, 1, 0));
  EXPECT_EQ(g.world.body(wall).angular_velocity, Vec3(0, 0, 0));
}

/// A ball on a rod below a cart on rails: the rails are locks. Nothing acts along them, so the common centre of mass
/// stays; nothing does work, so energy does.
TEST(FrameSettings, ACartOnLockedAxesSwingsWithItsPendulum) {
  World world({.step = 1.0 / 240.0});
  const BodyId cart = world.add_rigid(share(Box{{0.3, 0.2, 0.1}}), 100.0);
  world.set_locks(cart, {.translation = {false, true, true}, .rotation = {true, true, true}});
  const BodyId bob = world.add_rigid(share(Sphere{0.1}), 1000.0, {.pose = {.p = {0.6, 0, -0.8}}});
  world.add_joint(cart, bob,
                  {.type = JointType::kRevolute,
                   .frame = {.axes = to_matrix(quaternion_from_rotation_vector(Vec3(0, 0, std::acos(0.0))))}});
  const double m = world.model(bob).data().mass, M = world.model(cart).data().mass;
  const auto energy = [&] { return world.energy(cart).total() + world.energy(bob).total(); };
  const double before = energy();
  double farthest = 0.0, drift = 0.0, centre = 0.0;
  for (int i = 0; i < 480; ++i) {
    world.step();
    const Vec3 at = world.body(cart).pose.p;
    EXPECT_EQ(at.tail<2>(), Vec3::Zero().tail<2>());
    EXPECT_EQ(world.body(cart).pose.q.w, 1.0);
    farthest = std::max(farthest, at.x());
    centre = std::max(centre, std::abs(M * at.x() + m * world.body(bob).pose.p.x() - 0.6 * m) / (m + M));
    drift = std::max(drift, std::abs(energy() - before));
  }
  EXPECT_LT(centre, 1e-5);
  EXPECT_NEAR(farthest, 1.2 * m / (m + M), 2e-3);  // where the bob is on the other side
  EXPECT_LT(drift, 2e-3 * m * kG);
}

TEST(FrameSettings, ArgumentsAreChecked) {
  World world;
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  const BodyId body = world.add_rigid(share(Box{}), 1.0), ground = world.add_static(share(HalfSpace{}));
  EXPECT_THROW(world.set_gravity_scale(body, kNaN), InvalidArgument);
  EXPECT_THROW(world.set_gravity_scale(ground, 1.0), InvalidArgument);
  EXPECT_THROW(world.set_damping(body, -1.0, 0.0), InvalidArgument);
  EXPECT_THROW(world.set_damping(body, 0.0, std::numeric_limits<double>::infinity()), InvalidArgument);
  const BodyId hung = world.add_body(testing::sample_model({.motion = FrameMotion::kPoint}));
  world.set_damping(hung, 0.0, 1.0);
  EXPECT_THROW(world.set_damping(hung, 1.0, 1.0), InvalidArgument);
  EXPECT_THROW(world.set_locks(hung, kNoTurn), InvalidArgument);
  EXPECT_EQ(world.frame_settings(body).gravity_scale, 1.0);
  world.set_damping(hung, 0.0, 0.0);
  ContactFinder finder;
  world.set_locks(body, kNoTurn);
  EXPECT_THROW(world.set_contact_source(&finder, testing::exactly()), InvalidArgument);
  world.set_locks(body, {});
  world.set_contact_source(&finder, testing::exactly());
  EXPECT_THROW(world.set_locks(body, kNoTurn), InvalidArgument);
  EXPECT_THROW(world.add_rigid(share(Box{}), 1.0, {.frame = {.angular_damping = 1.0}}), InvalidArgument);
}

/// A pendulum that swings in syrup: θ̈ = −c θ̇ − ω₀² θ.
TEST(FrameSettings, AngularDampingStillsAHangingBody) {
  World world({.step = 1.0 / 240.0});
  const BodyId bell = world.add_body(testing::sample_model({.motion = FrameMotion::kLine}));
  world.set_velocity(bell, Vec3::Zero(), 1e-3 * world.model(bell).data().line_axis);
  world.set_damping(bell, 0.0, 0.5);
  world.set_gravity({0, 0, 0});
  for (int i = 0; i < 480; ++i) world.step();
  EXPECT_NEAR(world.body(bell).angular_velocity.norm(), 1e-3 * std::exp(-1.0), 1e-15);
}

TEST(FrameSettings, AreInSnapshotsAndAllocateNothing) {
  GroundedWorld g;
  std::vector<BodyId> boxes;
  const auto box = share(Box{{0.2, 0.2, 0.2}});
  for (int i = 0; i < 8; ++i)
    boxes.push_back(g.world.add_rigid(
        box, 500.0,
        {.pose = {.p = {0.05 * i, 0, 0.2 + 0.41 * i}},
         .frame = {.gravity_scale = 0.5 + 0.1 * i,
                   .linear_damping = 0.1,
                   .angular_damping = 0.2,
                   .locks = {.translation = {i == 3, false, false}, .rotation = {i % 2 == 0, false, i == 5}}}}));
  g.step(60);
  std::vector<std::byte> state;
  g.world.save_state(state);
  const long before = testing::allocations();
  g.step(60);
  EXPECT_EQ(testing::allocations() - before, 0);
  const std::uint64_t hash = g.world.state_hash();
  for (const BodyId body : boxes) g.world.set_gravity_scale(body, -1.0), g.world.set_locks(body, {});
  g.step(10);
  g.world.restore_state(state);
  EXPECT_EQ(g.world.frame_settings(boxes[3]).locks.translation[0], true);
  g.step(60);
  EXPECT_EQ(g.world.state_hash(), hash);
}

/// A lift carries what stands on it, and a ram pushes what is in its way, whatever it weighs.
TEST(KinematicBodies, GoAsTheyAreLedAndCarryOthers) {
  GroundedWorld g({}, {.step = 1.0 / 120.0});
  const BodyId lift = g.world.add_kinematic(share(Box{{1.0, 1.0, 0.1}}), {.pose = {.p = {0, 0, 1.0}}});
  const BodyId crate = g.world.add_rigid(share(Box{{0.3, 0.3, 0.3}}), 5000.0, {.pose = {.p = {0.2, 0, 1.4}}});
  EXPECT_EQ(g.world.body_type(g.ground), BodyType::kStatic);
  EXPECT_EQ(g.world.body_type(lift), BodyType::kKinematic);
  EXPECT_EQ(g.world.body_type(crate), BodyType::kDynamic);
  g.step(30);
  for (int i = 1; i <= 240; ++i) {
    g.world.set_kinematic_frame(lift, {.pose = {.p = {0, 0, 1.0 + 0.5 * i / 120.0}}, .velocity = {0, 0, 0.5}});
    g.world.step();
  }
  EXPECT_EQ(g.world.body(lift).pose.p, Vec3(0, 0, 2.0));
  EXPECT_NEAR(g.world.body(crate).pose.p.z(), 2.4, 1e-3);
  EXPECT_NEAR(g.world.body(crate).velocity.z(), 0.5, 1e-3);
  EXPECT_THROW(g.world.set_kinematic_frame(crate, {}), InvalidArgument);
  EXPECT_THROW(g.world.add_kinematic(share(HalfSpace{})), InvalidArgument);
  EXPECT_THROW(g.world.add_kinematic(nullptr), InvalidArgument);
}

}  // namespace
}  // namespace limber
