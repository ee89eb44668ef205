#include <gtest/gtest.h>

#include <cmath>

#include "bar_model.h"
#include "contact_rules.h"
#include "counted_new.h"
#include "grounded_world.h"
#include "limber/core/error.h"
#include "limber/jobs_tbb/tbb_jobs.h"
#include "pile.h"
#include "thread_jobs.h"

namespace limber::testing {
namespace {

#if defined(__SANITIZE_ADDRESS__)
constexpr int kStepsToRest = 60;  // of the largest stack; the sanitizers take twenty times as long
constexpr int kPileBoxes = 9;
constexpr int kStepsOfLump = 20;
constexpr int kHashSteps = 20;
#else
constexpr int kStepsToRest = 300;
constexpr int kPileBoxes = 18;
constexpr int kStepsOfLump = 60;
constexpr int kHashSteps = 60;
#endif

TEST(WorldContact, AFallingBoxComesToRestOnTheGround) {
  for (const int modes : {0, 12}) {
    GroundedWorld scene;
    World& world = scene.world;
    const BodyId box = world.add_body(damped_box(modes, 30.0), {.pose = {{}, {0.0, 0.0, 0.6}}});
    for (int i = 0; i < 300; ++i) world.step();
    const Vec3 before = world.body(box).pose.p;
    for (int i = 0; i < 60; ++i) world.step();
    EXPECT_GT(lowest(world, box), -1e-3 * kSampleSize) << modes;
    EXPECT_LT((world.body(box).pose.p - before).norm(), 1e-4) << modes;
  }
}

TEST(WorldContact, ABoxOnABoxStands) {
  constexpr double kHeight = 0.2, kPenetration = 1e-3 * kSampleSize, kShift = 1e-4;  // m
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
  constexpr double kHeight = 0.2, kApart = 1e-5;                      // of a box; between boxes, m
  constexpr double kPenetration = 1e-3 * kSampleSize, kShift = 1e-4;  // m
  GroundedWorld scene;
  World& world = scene.world;
  const auto model = damped_box(0, 60.0);
  std::vector<BodyId> boxes;
  for (int i = 0; i < kBoxes; ++i) {
    const Vec3 place(0.02 * (i % 2), 0.015 * (i % 3), depth_below_origin(*model) + kApart + i * (kHeight + kApart));
    boxes.push_back(world.add_body(model, {.pose = {quaternion_from_rotation_vector({0.0, 0.0, 0.05 * i}), place}}));
  }
  for (int i = 0; i < kStepsToRest; ++i) world.step();
  std::vector<Vec3> before;
  for (const BodyId box : boxes) before.push_back(world.body(box).pose.p);
  for (int i = 0; i < 60; ++i) world.step();
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    EXPECT_LT((world.body(boxes[i]).pose.p - before[i]).norm(), kShift) << i;
    EXPECT_NEAR(lowest(world, boxes[i]), static_cast<double>(i) * kHeight, kPenetration) << i;
  }
}

TEST(WorldContact, StacksOfRigidBoxesThatAreDroppedStand) {
  constexpr double kHeight = 0.2, kApart = 0.02;                      // of a box; between boxes, m
  constexpr double kPenetration = 1e-3 * kSampleSize, kShift = 1e-4;  // m
  const auto model = damped_box(0, 60.0);
  for (const int count : {3, 5}) {
    GroundedWorld scene;
    World& world = scene.world;
    std::vector<BodyId> boxes;
    for (int i = 0; i < count; ++i) {
      const Vec3 place(0.02 * (i % 2), 0.015 * (i % 3), depth_below_origin(*model) + kApart + i * (kHeight + kApart));
      boxes.push_back(world.add_body(model, {.pose = {quaternion_from_rotation_vector({0.0, 0.0, 0.05 * i}), place}}));
    }
    scene.step(300);
    std::vector<Vec3> before;
    for (const BodyId box : boxes) before.push_back(world.body(box).pose.p);
    scene.step(60);
    for (std::size_t i = 0; i < boxes.size(); ++i) {
      EXPECT_LT((world.body(boxes[i]).pose.p - before[i]).norm(), kShift) << count << ", box " << i;
      EXPECT_NEAR(lowest(world, boxes[i]), static_cast<double>(i) * kHeight, kPenetration) << count << ", box " << i;
    }
  }
}

// An island of more than a hundred contacts is solved in blocks.
TEST(WorldContact, APileOfBoxesComesToRest) {
  constexpr double kPenetration = 1e-3 * kPileSize, kShift = 1e-4;  // m
  Pile pile(kPileBoxes, -1, false);
  for (int i = 0; i < 90; ++i) pile.step_once();
  std::vector<Vec3> before;
  for (const BodyId id : pile.bodies) before.push_back(pile.world.body(id).pose.p);
  for (int i = 0; i < 30; ++i) pile.step_once();
  EXPECT_TRUE(pile.world.constraint_report().solved);
  EXPECT_GE(pile.contacts, 3 * kPileBoxes);
  EXPECT_GT(pile.deepest, -kPenetration);
  for (std::size_t i = 0; i < before.size(); ++i)
    EXPECT_LT((pile.world.body(pile.bodies[i]).pose.p - before[i]).norm(), kShift) << i;
}

void expect_no_allocation_in_a_warm_pile(int bend) {
  Pile pile(kPileBoxes, bend, false);
  for (int i = 0; i < 90; ++i) pile.step_once();
  // Pushed from the side, so that contacts slide and the forces of the last step do not fit. Memory grows to the
  // largest islands seen, so that some pushes go before the one that counts.
  const auto push = [&](double size) {
    for (const BodyId body : pile.bodies) pile.world.apply_impulse(body, SurfacePoint{}, {size, 0.4 * size, 0.0});
    for (int i = 0; i < 10; ++i) pile.step_once();
  };
  for (int i = 0; i < 5; ++i) push(i % 2 == 0 ? 1.0 : -1.0);
  const long before = allocations();
  push(0.3);
  EXPECT_EQ(allocations() - before, 0);
  EXPECT_GE(pile.contacts, 3 * kPileBoxes);
}

TEST(WorldContact, AWarmStepOfAPileAllocatesNothing) { expect_no_allocation_in_a_warm_pile(-1); }

TEST(WorldContact, AWarmStepOfAPileWithBodiesThatBendAllocatesNothing) { expect_no_allocation_in_a_warm_pile(6); }

/// Bricks that fly towards each other and end in one lump: an island of more than fifty contacts.
void expect_momenta_kept_in_a_lump(int modes) {
  ContactFinder finder;
  World world({.gravity = Vec3::Zero()});
  world.set_contact_source(&finder, {.recovery_speed = 0.0});
  const Vec3 half(0.15, 0.12, 0.09);
  const auto model = sample_model({.modes = modes, .lowest_hz = 60.0, .decay = 12.0, .half_extent = half});
  const auto brick = modes > 0 ? nullptr : std::make_shared<const Shape>(Box{.half_extents = half});
  std::vector<BodyId> bodies;
  for (int i = 0; i < 27; ++i) {
    const Vec3 at(0.5 * (i % 3 - 1), 0.45 * (i / 3 % 3 - 1), 0.4 * (i / 9 - 1));
    bodies.push_back(world.add_body(model, {.pose = {quaternion_from_rotation_vector({0.1 * i, 0.0, 0.0}), at},
                                            .velocity = -3.0 * at + Vec3(0.0, 0.2, 0.1 * std::sin(i)),
                                            .angular_velocity = {0.0, 0.0, std::cos(i)},
                                            .shape = brick}));
  }
  const auto momentum = [&] {
    Vec3 sum = Vec3::Zero();
    for (const BodyId body : bodies) sum += world.linear_momentum(body);
    return sum;
  };
  const auto angular_momentum = [&] {
    Vec3 sum = Vec3::Zero();
    for (const BodyId body : bodies)
      sum += world.angular_momentum(body) + world.body(body).pose.p.cross(world.linear_momentum(body));
    return sum;
  };
  std::size_t most = 0;
  const Vec3 linear = momentum(), angular = angular_momentum();
  double energy = total_energy(world, bodies);
  const double scale = energy;
  for (int i = 0; i < kStepsOfLump; ++i) {
    world.step();
    most = std::max(most, world.contact_events().size());
    const double now = total_energy(world, bodies);
    EXPECT_LE(now, energy + 1e-6 * scale) << i;
    energy = now;
  }
  EXPECT_GT(most, 50u);
  EXPECT_LT((momentum() - linear).norm(), 1e-10 * linear.norm());
  EXPECT_LT((angular_momentum() - angular).norm(), 1e-10 * angular.norm());
}

TEST(WorldContact, BodiesThatMeetInALumpKeepTheirMomenta) { expect_momenta_kept_in_a_lump(0); }

TEST(WorldContact, BodiesThatBendAndMeetInALumpKeepTheirMomenta) { expect_momenta_kept_in_a_lump(6); }

/// Flexible boxes share loads between their contacts in many ways; each step finds one of them, and they come to rest.
TEST(WorldContact, StacksOfFlexibleBoxesThatAreDroppedStandAndEveryStepSettles) {
  constexpr double kHeight = 0.2, kApart = 0.02;                      // of a box; between boxes, m
  constexpr double kPenetration = 1e-3 * kSampleSize, kShift = 1e-4;  // m
  for (const int dropped : {0, 14}) {
    const auto model = sample_model({.modes = 6, .dropped = dropped, .lowest_hz = 60.0, .decay = 12.0});
    GroundedWorld scene;
    World& world = scene.world;
    std::vector<BodyId> boxes;
    for (int i = 0; i < 3; ++i) {
      const Vec3 place(0.02 * (i % 2), 0.015 * (i % 3), depth_below_origin(*model) + kApart + i * (kHeight + kApart));
      boxes.push_back(world.add_body(model, {.pose = {quaternion_from_rotation_vector({0.0, 0.0, 0.05 * i}), place}}));
    }
    int unsettled = 0;
    for (int i = 0; i < kStepsToRest; ++i) {
      world.step();
      unsettled += world.constraint_report().solved ? 0 : 1;
    }
    EXPECT_EQ(unsettled, 0) << dropped;
    std::vector<Vec3> before;
    for (const BodyId box : boxes) before.push_back(world.body(box).pose.p);
    scene.step(60);
    for (std::size_t i = 0; i < boxes.size(); ++i) {
      EXPECT_LT((world.body(boxes[i]).pose.p - before[i]).norm(), kShift) << dropped << ", box " << i;
      EXPECT_NEAR(lowest(world, boxes[i]), static_cast<double>(i) * kHeight, kPenetration) << dropped << ", box " << i;
    }
  }
}

/// Bars that fall across each other have no vertex within the other: the crossings of their rims carry them.
TEST(WorldContact, FlexibleBarsDroppedAcrossEachOtherLieStill) {
  constexpr double kLength = 0.6, kDepth = 1e-3 * kLength, kShift = 1e-4;
  const auto bar = sample_model({.modes = 6, .lowest_hz = 60.0, .decay = 12.0, .half_extent = {0.3, 0.06, 0.05}});
  const double low = depth_below_origin(*bar);
  for (const double roll : {0.1, 0.3, 0.5}) {
    GroundedWorld scene;
    const Quaternion across = quaternion_from_rotation_vector({0.0, 0.0, 1.2}),
                     tilted = quaternion_from_rotation_vector({roll, 0.1, 0.0});
    scene.world.add_body(bar, {.pose = {{}, {0.0, 0.0, low}}});
    const BodyId upper = scene.world.add_body(bar, {.pose = {across * tilted, {0.0, 0.0, 3.0 * low + 0.05}}});
    scene.step(90);
    double deepest = 0.0;
    scene.world.set_contact_veto([&](const ContactPoint& contact) {
      deepest = std::min(deepest, contact.gap);
      return true;
    });
    const Vec3 place = scene.world.body(upper).pose.p;
    scene.step(60);
    EXPECT_GT(deepest, -kDepth) << "rolled by " << roll;
    EXPECT_LT((scene.world.body(upper).pose.p - place).norm(), kShift) << "rolled by " << roll;
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
  EXPECT_LT(largest_rise(world, boxes, 180), kRise * 3.0 * model->data().mass * kGravity * kSampleSize);
}

/// Four corners can share a weight in many ways that no gap shows but by what each contact yields: all of a step has to
/// see that they do, or forces jump between them and the bar sinks. Without recovery nothing would push it out again.
TEST(WorldContact, ABarThatTopplesLiesStill) {
  constexpr double kPenetration = 1e-3;  // m, of a bar of 1 m
  GroundedWorld scene({.recovery_speed = 0.0});
  ModalModelData bar = bar_data(20, false);
  for (double& decay : bar.decays) decay = 0.03 * std::sqrt(bar.eigenvalues[0]);
  for (double& lambda : bar.eigenvalues) lambda *= 1e4;
  const Quaternion upright = quaternion_from_rotation_vector({0.0, -0.5 * std::numbers::pi + 0.1, 0.0});
  const BodyId body =
      scene.world.add_body(std::make_shared<const ModalModel>(std::move(bar)), {.pose = {upright, {0, 0, 0.8}}});
  for (int i = 0; i < 300; ++i) {
    scene.step(1);
    EXPECT_TRUE(scene.world.constraint_report().solved) << "step " << i;
  }
  EXPECT_GT(lowest(scene.world, body), -kPenetration);
  EXPECT_LT(scene.world.body(body).velocity.norm(), 1e-6);
}

/// What the dropped modes yield to the contacts at rest is what they would yield if they were kept.
TEST(WorldContact, ABoxWithResidualComplianceRestsAsOneWithAllItsModes) {
  constexpr double kHz = 30.0, kFloat = 1e-5;  // of what the dropped modes yield, which is stored in single precision
  constexpr double kGap = 1e-9;                // m, to which contacts are solved
  const double decay = 0.05 * 2.0 * std::numbers::pi * kHz;
  const auto rest_height = [](const SampleOptions& sample) {
    GroundedWorld scene({.friction = 0.0});
    ModalModelData data = sample_model_data(sample);
    const auto model = std::make_shared<const ModalModel>(std::move(data));
    const BodyId box = scene.world.add_body(model, {.pose = {{}, {0.0, 0.0, depth_below_origin(*model)}}});
    scene.step(300);
    return scene.world.body(box).pose.p.z();
  };
  const SampleOptions few{.modes = 6, .dropped = 14, .lowest_hz = kHz, .decay = decay};
  const double all = rest_height({.modes = 20, .lowest_hz = kHz, .decay = decay});
  const double without = rest_height({.modes = 6, .lowest_hz = kHz, .decay = decay});
  const double with = rest_height(few);
  EXPECT_GT(std::abs(without - all), 1e-6);
  EXPECT_NEAR(with, all, kFloat * std::abs(without - all) + kGap);
}

/// Dents stay with the material, whatever contacts come and go; what they store is counted.
TEST(WorldContact, EnergyNeverRisesWhereBodiesWithResidualComplianceSlideAndRoll) {
  constexpr double kRise = 1e-6;
  const auto model = sample_model({.modes = 6, .dropped = 14, .lowest_hz = 20.0});
  for (const ImpactModel impact : {ImpactModel::kAbsorbed, ImpactModel::kHeldFromTouch}) {
    GroundedWorld scene({.recovery_speed = 0.0, .residual_compliance = true, .impact = impact});
    World& world = scene.world;
    std::vector<BodyId> boxes;
    for (int i = 0; i < 3; ++i)
      boxes.push_back(world.add_body(
          model, {.pose = {quaternion_from_rotation_vector({0.3, 0.2 * i, 0.1}), {0.05 * i, 0.0, 0.5 + 0.5 * i}},
                  .velocity = {1.0, 0.0, 0.0}}));
    EXPECT_LT(largest_rise(world, boxes, 180), kRise * 3.0 * model->data().mass * kGravity * kSampleSize)
        << static_cast<int>(impact);
  }
}

/// A damped box that is dropped bounces, in steps that are cut where it strikes and lets go, and comes to rest, where
/// steps are whole.
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
    cuts += world.constraint_report().attempts.cuts();
    fastest = std::max(fastest, world.body(box).velocity.z());
    worst = std::max(worst, world.energy(box).total() - before);
    before = world.energy(box).total();
  }
  EXPECT_GT(cuts, 0);
  EXPECT_GT(fastest, 1.0);  // of the 3 m/s that it falls at: it has bounced
  EXPECT_LT(worst, kRise * scale);
  const Vec3 rest = world.body(box).pose.p;
  for (int i = 0; i < 60; ++i) {
    world.step();
    EXPECT_EQ(world.constraint_report().attempts.cuts(), 0);
  }
  EXPECT_LT((world.body(box).pose.p - rest).norm(), 1e-4);
}

/// Where an impact lets go is found by doing parts of the step again, in memory that is there: a second fall from the
/// same place, which is the same fall, needs no more.
TEST(WorldContact, AWarmStepThatIsCutAllocatesNothing) {
  const std::vector<double> still(20, 0.0);
  const RigidTransform above{quaternion_from_rotation_vector({0.5, 0.4, 0.1}), {0.0, 0.0, 0.6}};
  GroundedWorld scene({.friction = 0.0, .impact = ImpactModel::kHeldFromTouch});
  World& world = scene.world;
  const BodyId box = world.add_body(sample_model({.modes = 20, .dropped = 30, .lowest_hz = 60.0}), {.pose = above});
  scene.step(120);
  world.set_pose(box, above);
  world.set_velocity(box, Vec3::Zero(), Vec3::Zero());
  world.set_amplitudes(box, still, still);
  const long before = allocations();
  int cuts = 0;
  for (int i = 0; i < 120; ++i) {
    world.step();
    cuts += world.constraint_report().attempts.cuts();
  }
  EXPECT_EQ(allocations() - before, 0);
  EXPECT_GT(cuts, 10);
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

/// Slides a box without friction for 8 m over what is in the world. @return the worst change of its velocity, m/s
double worst_of_slide(World& world, double speed, double yaw) {
  const auto model = damped_box(0, 30.0);
  const Vec3 velocity(speed, 0.0, 0.0);
  const BodyId box = world.add_body(
      model, {.pose = {quaternion_from_rotation_vector({0.0, 0.0, yaw}), {0.0, 0.013, depth_below_origin(*model)}},
              .velocity = velocity});
  double worst = 0.0;
  for (int i = 0; i < static_cast<int>(8.0 / speed * 60.0); ++i) {
    world.step();
    worst = std::max(worst, (world.body(box).velocity - velocity).norm());
  }
  return worst;
}

TEST(WorldContact, ABoxSlidesOverAFloorOfBoxesAndOfTrianglesAsOverAPlane) {
  constexpr double kChange = 1e-5;  // of the speed: tiles hand loads over within the tolerance of gaps
  HeightField field{.columns = 41, .rows = 5, .spacing_x = 0.25, .spacing_y = 0.25, .heights = {}};
  field.heights.assign(41 * 5, 0.0f);
  for (const double speed : {1.0, 3.0, 10.0})
    for (const double yaw : {0.0, 0.3}) {
      SCOPED_TRACE(::testing::Message() << speed << " m/s, turned by " << yaw);
      for (const bool tiles : {true, false}) {
        ContactFinder finder;
        World world;
        world.set_contact_source(&finder, {.friction = 0.0});
        for (int i = 0; tiles && i < 10; ++i)
          world.add_static(std::make_shared<Shape>(Box{{0.5, 0.5, 0.1}}), {{}, {static_cast<double>(i), 0.0, -0.1}});
        if (!tiles) world.add_static(std::make_shared<Shape>(field), {{}, {-0.5, -0.5, 0.0}});
        EXPECT_LT(worst_of_slide(world, speed, yaw), kChange * speed) << (tiles ? "boxes" : "height field");
      }
    }
}

TEST(WorldContact, BoxesExactlyOnEachOtherStand) {
  constexpr double kShift = 1e-4;  // m
  GroundedWorld scene;
  World& world = scene.world;
  const auto model = damped_box(0, 60.0);
  std::vector<BodyId> boxes;
  for (int i = 0; i < 5; ++i)
    boxes.push_back(world.add_body(model, {.pose = {{}, {0.0, 0.0, depth_below_origin(*model) + 0.2 * i}}}));
  scene.step(300);
  for (int i = 0; i < 5; ++i) {
    const Vec3 place(0.0, 0.0, depth_below_origin(*model) + 0.2 * i);
    EXPECT_LT((world.body(boxes[static_cast<std::size_t>(i)]).pose.p - place).norm(), kShift) << i;
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

TEST(WorldContact, AWarmStepAllocatesNothingByAnyRule) {
  for (const ContactRule& rule : all_contact_rules()) {
    GroundedWorld scene({.rule = rule});
    World& world = scene.world;
    world.add_body(damped_box(4, 30.0), {.pose = {{}, {0.0, 0.0, 0.2}}});
    for (int i = 0; i < 200; ++i) world.step();
    const long before = allocations();
    bool touched = false;  // under some rules a box that should rest hops a little
    for (int i = 0; i < 60; ++i) {
      world.step();
      touched = touched || !world.contact_events().empty();
    }
    EXPECT_EQ(allocations() - before, 0) << name(rule);
    // A program as it is may throw a box away for good.
    EXPECT_TRUE(touched || rule.guard == ProgramGuard::kNone) << name(rule);
  }
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
  for (const int threads : {1, 2, 3, 8}) {
    ThreadJobs jobs(threads);
    EXPECT_EQ(hashes_of_islands_in_contact(jobs), serial) << threads << " threads";
  }
  TbbJobs jobs;
  EXPECT_EQ(hashes_of_islands_in_contact(jobs), serial) << "oneTBB";
}

}  // namespace
}  // namespace limber::testing
