// What World promises of contacts: filters, events, friction of pairs, seams, memory and determinism.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "asked.h"
#include "counted_new.h"
#include "grounded_world.h"
#include "limber/core/error.h"
#include "limber/jobs_tbb/tbb_jobs.h"
#include "pile.h"
#include "thread_jobs.h"

namespace limber::testing {
namespace {

constexpr int kHashSteps = kSanitized ? 20 : 60;

void expect_no_allocation_in_a_warm_pile(int bend) {
  Pile pile(kPileBoxes, bend, false, exactly());
  for (int i = 0; i < 90; ++i) pile.step_once();
  // Pushed from the side, so that contacts slide and the forces of the last step do not fit. Memory grows to the
  // largest islands seen: the push that counts is one that has been before.
  const auto push = [&](double size) {
    for (const BodyId body : pile.bodies) pile.world.apply_impulse(body, SurfacePoint{}, {size, 0.4 * size, 0.0});
    for (int i = 0; i < 10; ++i) pile.step_once();
  };
  push(1.0);
  std::vector<std::byte> state;
  pile.world.save_state(state);
  push(-1.0);
  pile.world.restore_state(state);
  const long before = allocations();
  push(-1.0);
  EXPECT_EQ(allocations() - before, 0);
  EXPECT_GE(pile.contacts, 3 * kPileBoxes);
}

TEST(WorldContact, AWarmStepOfAPileAllocatesNothing) { expect_no_allocation_in_a_warm_pile(-1); }

TEST(WorldContact, AWarmStepOfAPileWithBodiesThatBendAllocatesNothing) { expect_no_allocation_in_a_warm_pile(6); }

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
  EXPECT_NEAR(lowest(world, box), 1.1, 1e-3 * kSampleSize);
  world.remove_body(table);
  EXPECT_FALSE(world.contains(table));
  for (int i = 0; i < 120; ++i) world.step();
  EXPECT_NEAR(lowest(world, box), 0.0, 1e-3 * kSampleSize);
  world.remove_body(box);
  world.step();
  for (const ContactEvent& contact : world.contact_events()) EXPECT_EQ(contact.phase, ContactPhase::kEnded);
  world.step();
  EXPECT_TRUE(world.contact_events().empty());
}

struct Slide {
  double change = 0.0;   // of the velocity, m/s, the most in any step
  double slowest = 1.0;  // speed along the way, of that at the start
};

/// Slides a box that meets by its own triangles for 8 m, without friction, over what is in the world.
Slide slide(World& world, double speed, double yaw) {
  const auto model = damped_box(0, 30.0);
  const Vec3 velocity(speed, 0.0, 0.0);
  const BodyId box = world.add_body(
      model, {.pose = {quaternion_from_rotation_vector({0.0, 0.0, yaw}), {0.0, 0.013, depth_below_origin(*model)}},
              .velocity = velocity});
  Slide seen;
  for (int i = 0; i < static_cast<int>(8.0 / speed * 60.0); ++i) {
    world.step();
    const Vec3& v = world.body(box).velocity;
    seen.change = std::max(seen.change, (v - velocity).norm());
    seen.slowest = std::min(seen.slowest, v.x() / speed);
  }
  return seen;
}

void add_floor(World& world, bool tiles, const HeightField& field) {
  for (int i = 0; tiles && i < 10; ++i)
    world.add_static(std::make_shared<Shape>(Box{{0.5, 0.5, 0.1}}), {{}, {static_cast<double>(i), 0.0, -0.1}});
  if (!tiles) world.add_static(std::make_shared<Shape>(field), {{}, {-0.5, -0.5, 0.0}});
}

TEST(WorldContact, ABoxSlidesOverAFloorOfBoxesAndOfTrianglesAsOverAPlane) {
  constexpr double kChange = 1e-5;    // of the speed: tiles hand loads over within the tolerance of gaps
  constexpr double kGameLoss = 1e-3;  // of the speed
  HeightField field{.columns = 41, .rows = 5, .spacing_x = 0.25, .spacing_y = 0.25, .heights = {}};
  field.heights.assign(41 * 5, 0.0f);
  for (const double speed : all_or_first<double>({3.0, 1.0, 10.0}))
    for (const double yaw : {0.0, 0.3}) {
      SCOPED_TRACE(::testing::Message() << speed << " m/s, turned by " << yaw);
      for (const bool tiles : {true, false}) {
        ContactFinder finder;
        World world;
        world.set_contact_source(&finder, exactly({.friction = 0.0}));
        add_floor(world, tiles, field);
        EXPECT_LT(slide(world, speed, yaw).change, kChange * speed) << (tiles ? "boxes" : "height field");
        ManifoldFinder manifolds;
        World game;
        game.set_contact_source(&manifolds, {.friction = 0.0});
        add_floor(game, tiles, field);
        EXPECT_GT(slide(game, speed, yaw).slowest, 1.0 - kGameLoss) << (tiles ? "boxes" : "height field");
      }
    }
}

TEST(WorldContact, FrictionOfAPairIsTheGeometricMeanOfBoth) {
  constexpr double kSpeed = 3.0;
  GroundedWorld scene;
  World& world = scene.world;
  const auto model = damped_box(0, 30.0);
  const auto add = [&](std::optional<double> friction, double y) {
    return world.add_body(
        model,
        {.pose = {{}, {0.0, y, depth_below_origin(*model)}}, .velocity = {kSpeed, 0.0, 0.0}, .friction = friction});
  };
  const BodyId plain = add({}, 0.0), smooth = add(0.0, 2.0), rough = add(0.08, 4.0);
  scene.step(30);
  // The ground has 0.5, as whoever does not say; friction begins with the second step (docs/contact.md).
  const auto expected = [](double mu) { return kSpeed - mu * kGravity * 0.5; };
  EXPECT_NEAR(world.body(plain).velocity.x(), expected(0.5), 0.5 * kGravity / 60.0);
  EXPECT_NEAR(world.body(smooth).velocity.x(), kSpeed, 1e-9);
  EXPECT_NEAR(world.body(rough).velocity.x(), expected(0.2), 0.2 * kGravity / 60.0);
  EXPECT_THROW(world.add_body(model, {.friction = -0.1}), InvalidArgument);
  EXPECT_THROW(world.add_static(std::make_shared<Shape>(HalfSpace{}), {}, {}, -1.0), InvalidArgument);
}

TEST(WorldContact, BodiesOfAJointDoNotMeetUnlessAskedTo) {
  for (const bool collide : {false, true}) {
    GroundedWorld scene;
    World& world = scene.world;
    const auto model = damped_box(0, 30.0);
    const BodyId a = world.add_body(model, {.pose = {{}, {0.0, 0.0, 2.0}}});
    const BodyId b = world.add_body(model, {.pose = {{}, {0.02, 0.01, 2.25}}, .velocity = {0.0, 0.0, -1.0}});
    Mat3 upwards;  // a slide along z
    upwards << 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0;
    const JointSpec slide{.type = JointType::kPrismatic, .frame = {.origin = {0.0, 0.0, 2.1}, .axes = upwards}};
    const JointId joint = world.add_joint(a, b, slide, {}, {}, collide);
    scene.step(9);
    const double apart = world.body(b).pose.p.z() - world.body(a).pose.p.z();
    EXPECT_EQ(apart > 0.2 - 1e-3, collide) << apart;
    world.remove_joint(joint);
    scene.step(2);
    if (!collide) {
      EXPECT_FALSE(world.contact_events().empty()) << "what overlaps is pushed apart now";
    }
  }
}

TEST(WorldContact, AMovingBodyIsMetAsTheShapeItIsGiven) {
  constexpr double kRadius = 0.5;
  GroundedWorld scene;
  World& world = scene.world;
  const auto model = damped_box(4, 30.0);
  const BodyId ball = world.add_body(
      model, {.pose = {{}, {0.0, 0.0, kRadius + 0.1}}, .shape = std::make_shared<const Shape>(Sphere{kRadius})});
  scene.step(120);
  EXPECT_NEAR(world.body(ball).pose.p.z(), kRadius, 1e-4);
  EXPECT_THROW(world.add_body(model, {.shape = std::make_shared<const Shape>(HalfSpace{})}), InvalidArgument);
}

TEST(WorldContact, AWarmStepAllocatesNothing) {
  GroundedWorld scene;
  scene.world.add_body(damped_box(4, 30.0), {.pose = {{}, {0.0, 0.0, 0.2}}});
  scene.step(200);
  const long before = allocations();
  scene.step(60);
  EXPECT_EQ(allocations() - before, 0);
  EXPECT_FALSE(scene.world.contact_events().empty());
}

/// The states' hashes on the way of twelve flexible bodies that rub: a heap, three stacks that are dropped and a pair
/// that meets in the air.
std::vector<std::uint64_t> hashes_of_islands_in_contact(Jobs& jobs) {
  GroundedWorld scene({.friction = 0.6}, {}, jobs);
  World& world = scene.world;
  const auto model = sample_model({.modes = 6, .lowest_hz = 60.0, .decay = 12.0});
  const auto add = [&](const Vec3& at, const Vec3& turn, const Vec3& velocity) {
    world.add_body(model, {.pose = {quaternion_from_rotation_vector(turn), at}, .velocity = velocity});
  };
  for (int i = 0; i < 4; ++i)
    add({0.45 * (i % 2), 0.0, 0.25 + 0.3 * (i / 2)}, {0.2 * std::sin(i), 0.1 * std::cos(i), 0.3 * i}, {0.1, 0.0, -1.0});
  for (int stack = 0; stack < 3; ++stack)
    for (int i = 0; i < 3; ++i) add({3.0 + 2.0 * stack, 0.01 * i, 0.13 + 0.22 * i}, {0.0, 0.0, 0.05 * i}, Vec3::Zero());
  for (const double side : {-1.0, 1.0}) add({side * 0.5, 5.0, 6.0}, {0.3, 0.2 * side, 0.0}, {-side * 2.0, 0.0, 0.0});

  std::vector<std::uint64_t> hashes;
  int islands = 0, rows = 0;
  for (int step = 1; step <= kHashSteps; ++step) {
    world.step();
    islands = std::max(islands, world.constraint_report().islands);
    rows = std::max(rows, world.constraint_report().rows);
    if (step % 10 == 0) hashes.push_back(world.state_hash());
  }
  EXPECT_GE(islands, 4);
  EXPECT_GE(rows, 80);
  return hashes;
}

TEST(WorldContact, StateHashIsTheSameForAnyThreadCount) {
  const std::vector<std::uint64_t> serial = hashes_of_islands_in_contact(serial_jobs());
  for (const int threads : all_or_first<int>({3, 1, 2, 8})) {
    ThreadJobs jobs(threads);
    EXPECT_EQ(hashes_of_islands_in_contact(jobs), serial) << threads << " threads";
  }
  TbbJobs jobs;
  EXPECT_EQ(hashes_of_islands_in_contact(jobs), serial) << "oneTBB";
}

TEST(Contact, AChainWhoseDraggingEndWeighsTenThousandLinksHoldsTogetherOnTheGround) {
  GroundedWorld s(exactly({.friction = 0.5, .recovery_speed = 0.0}));
  std::vector<BodyId> bodies;
  std::vector<JointId> joints;
  BodyId before{};
  for (int i = 0; i < 4; ++i) {
    const Vec3 start(i * kSampleSize, 0.0, 1.2);
    ModalModelData d = sample_model_data({.modes = 0});
    if (i == 3) d.mass *= 1e4, d.inertia *= 1e4;
    const BodyId next = s.world.add_body(std::make_shared<const ModalModel>(std::move(d)),
                                         {.pose = {.p = start + 0.5 * kSampleSize * Vec3::UnitX()}});
    joints.push_back(s.world.add_joint(before, next, {.type = JointType::kBall, .frame = {.origin = start}},
                                       {.radius = 0.25}, {.radius = 0.25}));
    bodies.push_back(before = next);
  }
  StepAttempts attempts;
  double apart = 0.0, deepest = 0.0;
  for (int i = 0; i < 120; ++i) {
    s.world.step();
    EXPECT_TRUE(s.world.constraint_report().solved) << i;
    attempts.add(s.world.constraint_report().attempts);
    for (const JointId joint : joints) apart = std::max(apart, s.world.joint(joint).distance_error);
    for (const BodyId body : bodies) deepest = std::max(deepest, -lowest(s.world, body));
  }
  EXPECT_GT(attempts[StepAttempt::kInTheMiddle], 0);
  EXPECT_LE(apart, 1e-8);
  EXPECT_LE(deepest, 1e-6 * kSampleSize);
}

}  // namespace
}  // namespace limber::testing
