// Contact by small steps (ContactSolver::kGame): what rests, slides, rebounds and piles up.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "asked.h"
#include "bar_model.h"
#include "instruction_sets.h"
#include "limber/collision/manifold_finder.h"
#include "limber/jobs_tbb/tbb_jobs.h"
#include "pile.h"

namespace limber::testing {
namespace {

constexpr double kSize = 0.3;
const Vec3 kHalf = Vec3(0.5, 0.4, 0.3) * kSize;

ContactOptions game(int substeps = SmallSteps{}.substeps, double friction = 0.5) {
  return {.solver = ContactSolver::kGame, .small_steps = {.substeps = substeps}, .friction = friction};
}

std::shared_ptr<const ModalModel> rigid_box(double factor = 1.0) {
  ModalModelData data = sample_model_data({.modes = 0, .half_extent = kHalf});
  data.mass *= factor;
  data.inertia *= factor;
  return std::make_shared<const ModalModel>(std::move(data));
}

/// Bricks by their shape, on the ground or wherever they are put.
struct Bricks : GroundedWorld {
  explicit Bricks(const ContactOptions& options = game(), const WorldOptions& world_options = {})
      : GroundedWorld(options, world_options), shape(std::make_shared<const Shape>(Box{.half_extents = kHalf})) {}
  BodyId add(const BodyPlacement& placement, double factor = 1.0) {
    BodyPlacement at = placement;
    at.shape = shape;
    bodies.push_back(world.add_body(rigid_box(factor), at));
    return bodies.back();
  }
  double scale() const {
    double mass = 0.0;
    for (const BodyId body : bodies) mass += world.model(body).data().mass;
    return mass * kGravity * kSize;
  }
  std::shared_ptr<const Shape> shape;
  std::vector<BodyId> bodies;
};

/// Contacts that do not press have rows of one attitude; the body turns on by its inertia all the same.
TEST(GameContact, WhatTumblesCloseAboveTheGroundKeepsItsEnergy) {
  const Vec3 half(0.25, 0.06, 0.04);
  GroundedWorld scene(game(), {.gravity = Vec3::Zero()});
  const BodyId bar = scene.world.add_body(sample_model({.modes = 0, .half_extent = half}),
                                          {.pose = {{}, {0.0, 0.0, 1.01 * half.norm()}},
                                           .velocity = Vec3::Zero(),
                                           .angular_velocity = {20.0, 25.0, 10.0},
                                           .shape = std::make_shared<const Shape>(Box{.half_extents = half})});
  const double energy = scene.world.energy(bar).total();
  int rows = 0;
  for (int i = 0; i < 120; ++i) {
    scene.step(1);
    rows += scene.world.constraint_report().rows;
    ASSERT_NEAR(scene.world.energy(bar).total(), energy, 1e-3 * energy) << i;
  }
  EXPECT_GT(rows, 0);
  EXPECT_TRUE(scene.world.contact_events().empty());
}

/// Forces of a blow that the next substep begins with add no energy at its end.
TEST(GameContact, AHighPileThatFallsGainsNoEnergyInAnyStep) {
  Pile pile(kSanitized ? 50 : 300, -1, false, game());
  double scale = 0.0;
  for (const BodyId body : pile.bodies) scale += pile.world.model(body).data().mass * kGravity * kPileSize;
  const auto energy = [&] {
    double sum = 0.0;
    for (const BodyId body : pile.bodies) sum += pile.world.energy(body).total();
    return sum;
  };
  double before = energy();
  for (int i = 0; i < 120; ++i) {
    pile.step_once();
    const double after = energy();
    ASSERT_LE(after - before, 2e-3 * scale) << i;
    before = after;
  }
}

TEST(GameContact, AStackOfTenStandsAndComesToRest) {
  Bricks scene;
  for (int i = 0; i < 10; ++i)
    scene.add({.pose = {quaternion_from_rotation_vector({0.0, 0.0, 0.05 * i}),
                        {0.03 * kSize * (i % 2), 0.025 * kSize * (i % 3), kHalf.z() + i * (2.0 * kHalf.z() + 1e-4)}}});
  const int steps = asked("LIMBER_STEPS", 300);
  scene.step(steps);
  const RigidTransform before = scene.world.body(scene.bodies.back()).pose;
  scene.step(60);
  const RigidTransform after = scene.world.body(scene.bodies.back()).pose;
  // The bending of a stack comes to rest slowly: it sways for half a minute.
  const double sway = steps < 3540 ? 1e-2 : 1e-6;
  EXPECT_LT((after.p - before.p).norm(), sway * kSize);
  EXPECT_NEAR(after.p.z(), kHalf.z() * 19.0, 10 * 2e-3 * kSize);
  EXPECT_TRUE(scene.world.constraint_report().solved);
}

/// Corners are met one after the other: whichever comes first must not tilt a body.
TEST(GameContact, CubesSetDownInLineStayInLine) {
  for (const double size : {0.05, 1.0}) {
    ManifoldFinder finder;
    World world({.step = 1.0 / 60.0});
    world.set_contact_source(&finder);
    world.add_static(std::make_shared<const Shape>(HalfSpace{}));
    const auto cube = std::make_shared<const Shape>(Box{Vec3::Constant(0.5 * size)});
    BodyId top;
    for (int i = 0; i < 10; ++i) top = world.add_rigid(cube, 700.0, {.pose = {.p = {0.0, 0.0, (0.5 + i) * size}}});
    for (int i = 0; i < 300; ++i) world.step();
    const BodyView view = world.body(top);
    EXPECT_LT(view.pose.p.head<2>().norm(), 3e-4) << size;
    EXPECT_LT(view.velocity.norm(), 2e-3) << size;
  }
}

/// Rows stay where they are while a body turns on by many times: its turn must not grow by that.
TEST(GameContact, WhatTumblesDownLandsWhateverStepComesBetween) {
  for (const double pause : {1.0, 10.0, 100.0, 3600.0})
    for (const int at : {5, 14, 20}) {
      Bricks scene;
      const auto bar = std::make_shared<const Shape>(Box{{0.15, 0.05, 0.03}});
      const BodyId body = scene.world.add_rigid(
          bar, 1000.0,
          {.pose = {.p = {0.0, 0.0, 0.25}}, .velocity = {1.0, 0.0, -1.0}, .angular_velocity = {0.0, 3.0, 2.0}});
      scene.step(at);
      scene.world.set_step(pause);
      scene.step(1);
      ASSERT_TRUE(scene.world.body(body).pose.p.allFinite()) << pause << " s after " << at;
      EXPECT_LT(scene.world.body(body).velocity.norm(), 2.0 * kGravity * (1.0 + pause)) << at;
      scene.world.set_step(1.0 / 60.0);
      scene.step(10);
      EXPECT_TRUE(scene.world.constraint_report().solved) << pause << " s after " << at;
    }
}

TEST(GameContact, LightBricksCarryOneAHundredTimesAsHeavy) {
  for (const auto& [light, substeps] : {std::pair{1, 16}, std::pair{2, 24}}) {
    Bricks scene(game(substeps));
    for (int i = 0; i <= light; ++i)
      scene.add({.pose = {{}, {0.0, 0.0, kHalf.z() + i * (2.0 * kHalf.z() + 1e-4)}}}, i < light ? 1.0 : 100.0);
    scene.step(600);
    const Vec3 before = scene.world.body(scene.bodies.back()).pose.p;
    scene.step(60);
    const Vec3 after = scene.world.body(scene.bodies.back()).pose.p;
    EXPECT_LT((after - before).norm(), 1e-6 * kSize) << light;
    EXPECT_NEAR(after.z(), kHalf.z() * (1.0 + 2.0 * light), 2e-3 * (1.0 + light) * kSize) << light;
  }
}

TEST(GameContact, ASlopeBelowTheAngleOfFrictionHoldsAndAboveItSlidesByCoulombsLaw) {
  for (const double share : {0.9, 1.05}) {
    const double angle = std::atan(share * 0.5);
    Bricks scene(game(), {.gravity = kGravity * Vec3(std::sin(angle), 0.0, -std::cos(angle))});
    const BodyId box = scene.add({.pose = {{}, {0.0, 0.0, kHalf.z() + 1e-6}}});
    scene.step(60);
    const BodyView at = scene.world.body(box);
    const double x = at.pose.p.x(), v = at.velocity.x();
    scene.step(120);
    const double slid = scene.world.body(box).pose.p.x() - x, gained = scene.world.body(box).velocity.x() - v;
    if (share < 1.0)
      EXPECT_LT(std::abs(slid) / 2.0, 1e-6 * kSize);
    else
      EXPECT_NEAR(gained / 2.0, kGravity * (std::sin(angle) - 0.5 * std::cos(angle)), 1e-3 * kGravity * 0.02236);
  }
}

TEST(GameContact, ContactsPushWhateverTheirFriction) {
  for (const double friction : {0.0, 1.0, 1e4, 1e6, std::numeric_limits<double>::infinity()}) {
    Bricks scene(game(8, friction));
    const BodyId box = scene.add(
        {.pose = {quaternion_from_rotation_vector({0.2, 0.3, 0.0}), {0.0, 0.0, 0.3}}, .velocity = {1.0, 0.5, 0.0}});
    double energy = total_energy(scene.world, scene.bodies), lowest = 1.0;
    for (int i = 0; i < 120; ++i) {
      scene.step(1);
      const double now = total_energy(scene.world, scene.bodies);
      EXPECT_LE(now, energy + 1e-2 * scene.scale()) << friction;
      energy = now;
      lowest = std::min(lowest, scene.world.body(box).pose.p.z());
      EXPECT_TRUE(scene.world.constraint_report().solved) << friction;
    }
    EXPECT_GT(lowest, kHalf.z() - 0.02 * kSize) << friction;
  }
}

/// Once it has come to lie it stays where it is, even for infinite friction.
TEST(GameContact, WhatFallsWithHugeFrictionLiesAndStays) {
  for (const double friction : {1.0, 1e2, 1e4, 1e6, std::numeric_limits<double>::infinity()}) {
    Bricks scene(game(8, friction));
    const BodyId box = scene.add(
        {.pose = {quaternion_from_rotation_vector({0.2, 0.3, 0.0}), {0.0, 0.0, 0.5}}, .velocity = {0.5, 0.2, 0.0}});
    scene.step(240);
    const RigidTransform before = scene.world.body(box).pose;
    scene.step(120);
    const RigidTransform after = scene.world.body(box).pose;
    EXPECT_LT((after.p - before.p).norm(), 1e-4 * kSize) << friction;
    EXPECT_NEAR(after.p.z(), kHalf.z(), 5e-3 * kSize) << friction;
    EXPECT_TRUE(scene.world.constraint_report().solved) << friction;
  }
}

TEST(GameContact, WhatSlidesWithoutFrictionKeepsItsSpeed) {
  Bricks scene(game(8, 0.0));
  const BodyId box = scene.add({.pose = {{}, {0.0, 0.0, kHalf.z()}}, .velocity = {2.0, 0.0, 0.0}});
  scene.step(300);
  EXPECT_NEAR(scene.world.body(box).velocity.x(), 2.0, 1e-6);
}

TEST(GameContact, TwoBodiesThatMeetInFlightKeepTheirMomenta) {
  for (const int modes : {0, 6}) {
    GroundedWorld scene(game(), {.gravity = Vec3::Zero()});
    const auto model = sample_model({.modes = modes, .lowest_hz = 60.0});
    std::vector<BodyId> bodies;
    bodies.push_back(scene.world.add_body(model, {.pose = {{}, {0.0, 0.0, 5.0}}, .angular_velocity = {1.0, 0.5, 0.0}}));
    bodies.push_back(scene.world.add_body(
        model, {.pose = {quaternion_from_rotation_vector({0.3, 0.2, 0.1}), {0.9, 0.1, 5.1}}, .velocity = {-3, 0, 0}}));
    const auto momentum = [&] {
      Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
      for (const BodyId body : bodies) {
        linear += scene.world.linear_momentum(body);
        angular +=
            scene.world.angular_momentum(body) + scene.world.body(body).pose.p.cross(scene.world.linear_momentum(body));
      }
      return std::pair(linear, angular);
    };
    const auto before = momentum();
    const double energy = total_energy(scene.world, bodies);
    bool met = false;
    for (int i = 0; i < 40; ++i) {
      scene.step(1);
      met = met || !scene.world.contact_events().empty();
    }
    EXPECT_TRUE(met);
    const auto after = momentum();
    EXPECT_LT((after.first - before.first).norm(), 1e-5 * before.first.norm());
    // Of the turn it is kept to the gap at which the points of a contact face each other.
    EXPECT_LT((after.second - before.second).norm(), 1e-2 * before.second.norm());
    EXPECT_LT(total_energy(scene.world, bodies), energy * 1.001);
  }
}

/// Its speed after it struck a wall end on, for one before of 1.
double rebound(int steps_of_contact, int substeps, double phase) {
  const double step = kBarContactTime / steps_of_contact, speed = 0.01;
  GroundedWorld scene(game(substeps, 0.0), {.step = step, .gravity = Vec3::Zero()});
  scene.world.add_static(std::make_shared<Shape>(HalfSpace{.normal = Vec3::UnitX()}));
  const BodyId bar = scene.world.add_body(
      bar_model(20, false), {.pose = {{}, {0.5 + (1.3 + phase) * step * speed, 0.0, 2.0}}, .velocity = {-speed, 0, 0}});
  const double energy = scene.world.energy(bar).total();
  for (int i = 0; i < 8 * steps_of_contact / 5 + 6; ++i) {
    scene.step(1);
    EXPECT_LT(scene.world.energy(bar).total(), 1.0001 * energy);
  }
  return scene.world.body(bar).velocity.x() / speed;
}

TEST(GameContact, ABarReturnsFromAWallAsFastAsSubstepsShowItsWave) {
  double least_coarse = 1.0, least_fine = 1.0;
  for (int phase = 0; phase < 8; ++phase) {
    least_coarse = std::min(least_coarse, rebound(5, 8, phase / 8.0));
    least_fine = std::min(least_fine, rebound(10, 8, phase / 8.0));
  }
  EXPECT_GT(least_coarse, 0.9);
  EXPECT_GT(least_fine, 0.93);
}

TEST(GameContact, AFallingPileGainsNoEnergyAndDoesNotOverlapForLong) {
  Pile pile(kPileBoxes, -1, false, game());
  double energy = total_energy(pile.world, pile.bodies), rise = 0.0, falling = 0.0, resting = 0.0, mass = 0.0;
  for (const BodyId body : pile.bodies) mass += pile.world.model(body).data().mass;
  for (int i = 0; i < 150; ++i) {
    pile.step_once();
    (i < 120 ? falling : resting) = std::max(i < 120 ? falling : resting, -pile.deepest);
    const double now = total_energy(pile.world, pile.bodies);
    rise = std::max(rise, now - energy);
    energy = now;
    EXPECT_TRUE(pile.world.constraint_report().solved);
  }
  EXPECT_LT(falling, 0.1 * kPileSize);
  EXPECT_LT(resting, 3e-3 * kPileSize);
  EXPECT_LT(rise, 1e-2 * mass * kGravity * kPileSize);
}

TEST(GameContact, FlexibleBoxesOnEachOtherComeToRest) {
  GroundedWorld scene(game());
  const auto model = sample_model({.modes = 12, .lowest_hz = 60.0, .decay = 12.0});
  std::vector<BodyId> boxes;
  for (int i = 0; i < 4; ++i)
    boxes.push_back(
        scene.world.add_body(model, {.pose = {quaternion_from_rotation_vector({0.0, 0.0, 0.1 * i}),
                                              {0.02 * (i % 2), 0.01 * i, depth_below_origin(*model) + 0.21 * i}}}));
  scene.step(180);
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    const BodyView at = scene.world.body(boxes[i]);
    EXPECT_LT(at.velocity.norm(), 0.02);
    EXPECT_NEAR(at.pose.p.z(), depth_below_origin(*model) + 0.2 * static_cast<double>(i), 5e-3);
  }
}

TEST(GameContact, ResidualComplianceYieldsByItsForce) {
  GroundedWorld scene(game());
  const auto model = sample_model({.modes = 4, .dropped = 8, .lowest_hz = 30.0, .decay = 20.0});
  const BodyId box = scene.world.add_body(model, {.pose = {{}, {0.0, 0.0, depth_below_origin(*model) + 0.05}}});
  for (int i = 0; i < 240; ++i) {
    scene.step(1);
    for (const ContactEvent& event : scene.world.contact_events()) EXPECT_GE(event.impulse.dot(event.normal), 0.0);
  }
  Vec3 impulse = Vec3::Zero();
  double indentation = 0.0;
  for (const ContactEvent& event : scene.world.contact_events()) impulse += event.impulse;
  for (Index t = 0; t < 12; ++t)
    indentation = std::max(indentation, scene.world.indentation(box, {.triangle = t}).norm());
  const double weight = model->data().mass * kGravity;
  EXPECT_NEAR(impulse.norm() * 60.0, weight, 0.01 * weight);
  EXPECT_GT(indentation, 0.0);
  EXPECT_LT(indentation, 0.5 * kSize);
  EXPECT_LT(scene.world.body(box).velocity.norm(), 1e-3);
}

/// What a blow presses into springs and modes comes back once.
TEST(GameContact, WhatLandsOnASpringyBoxIsNotThrownOff) {
  const auto model = sample_model({.modes = 4, .dropped = 8, .lowest_hz = 30.0, .decay = 2.0});
  for (int i = 0; i < all_or_tenth(12); ++i) {
    Bricks scene;
    scene.bodies.push_back(scene.world.add_body(model, {.pose = {{}, {0.0, 0.0, depth_below_origin(*model)}}}));
    scene.step(30);
    scene.add({.pose = {quaternion_from_rotation_vector({0.02 * i, 0.02 * i, 0.0}), {0.01 * i, 0.0, 0.6}},
               .velocity = {0.0, 0.0, -3.0 - 0.5 * i}},
              8.0);
    const auto energy = [&] {
      return scene.world.energy(scene.bodies[0]).total() + scene.world.energy(scene.bodies[1]).total();
    };
    double before = energy();
    for (int k = 0; k < 40; ++k) {
      scene.step(1);
      const double after = energy();
      ASSERT_LT(after - before, 2e-2 * scene.scale()) << i << ", step " << k;
      before = after;
    }
  }
}

TEST(GameContact, ManifoldsOfFourCarryAPile) {
  const ContactOptions options = game();
  ManifoldFinder manifolds;
  Pile pile(kPileBoxes, -1, false, options);
  pile.world.set_contact_source(&manifolds, options);
  for (int i = 0; i < 150; ++i) pile.step_once();
  EXPECT_LT(-pile.deepest, 5e-3 * kPileSize);
}

/// Of a pile of rigid bricks, every tenth of which bends, after it has fallen.
std::uint64_t hash_of_fallen_pile(Jobs& jobs) {
  Pile pile(27, 6, false, game(), {}, jobs);
  for (int i = 0; i < 90; ++i) pile.step_once();
  return pile.world.state_hash();
}

TEST(GameContact, AFallIsTheSameBitsForAnyThreadsAndEveryInstructionSet) {
  const std::uint64_t serial = hash_of_fallen_pile(serial_jobs());
  for (const int threads : all_or_first<int>({3, 1, 2, 8})) {
    TbbJobs jobs(threads);
    EXPECT_EQ(hash_of_fallen_pile(jobs), serial) << threads << " threads";
  }
  for_each_instruction_set([&](std::int64_t target) {
    if (!has_fused_multiply_add(target)) return;
    EXPECT_EQ(hash_of_fallen_pile(serial_jobs()), serial) << target;
  });
}

/// Of towers of two side by side: more pairs that share no body than one thread takes of them at once.
std::uint64_t hash_of_towers(Jobs& jobs) {
  GroundedWorld scene({.solver = ContactSolver::kGame}, {}, jobs);
  const Vec3 half = Vec3(0.5, 0.5, 0.4) * kSize;
  const auto bent = sample_model({.modes = 6, .lowest_hz = 60.0, .decay = 12.0, .half_extent = half});
  const auto brick = std::make_shared<const Shape>(Box{.half_extents = half});
  constexpr int kSide = 18;
  for (int i = 0; i < 2 * kSide * kSide; ++i) {
    const int place = i / 2, level = i % 2;
    const Vec3 at(1.02 * kSize * (place % kSide), 1.02 * kSize * (place / kSide), (0.42 + 0.85 * level) * kSize);
    BodyPlacement placement{
        .pose = {quaternion_from_rotation_vector({0.02 * std::sin(i), 0.02 * std::cos(i), 0.0}), at}};
    if (i % 5 != 0) placement.shape = brick;
    scene.world.add_body(bent, placement);
  }
  for (int i = 0; i < 4; ++i) scene.world.step();
  return scene.world.state_hash();
}

TEST(GameContact, ManyPairsAtOnceAreTheSameBitsForAnyThreads) {
  const std::uint64_t serial = hash_of_towers(serial_jobs());
  for (const int threads : all_or_first<int>({3, 1, 2, 8})) {
    TbbJobs jobs(threads);
    EXPECT_EQ(hash_of_towers(jobs), serial) << threads << " threads";
  }
}

// Pairs of bodies with so many modes have theirs in memory of their own. Balls that do not bend by theirs move as
// rigid ones do.
TEST(GameContact, ModesThatASurfaceDoesNotShowChangeNothing) {
  const auto fall = [](Index modes, double rolling_friction) {
    GroundedWorld scene({.solver = ContactSolver::kGame, .rolling_friction = rolling_friction});
    const auto ball = std::make_shared<Shape>(Sphere{.radius = 0.5 * kSize});
    const auto model = sample_model({.modes = modes, .half_extent = Vec3::Constant(0.4 * kSize)});
    std::vector<BodyId> balls;
    for (int i = 0; i < 12; ++i)
      balls.push_back(scene.world.add_body(
          model, {.pose = {{}, kSize * Vec3(0.9 * (i % 3) + 0.1 * std::sin(i), 0.1 * (i % 2), 0.5 + 0.95 * (i / 3))},
                  .velocity = {0.0, 0.0, -0.5},
                  .angular_velocity = {0.0, 5.0, 3.0},
                  .shape = ball}));
    scene.step(3);
    std::vector<Vec3> motions;
    for (const BodyId id : balls)
      for (const Vec3& motion : {scene.world.body(id).velocity, scene.world.body(id).angular_velocity})
        motions.push_back(motion);
    return motions;
  };
  for (const double rolling_friction : {0.0, 0.05}) {
    const std::vector<Vec3> rigid = fall(0, rolling_friction), modal = fall(40, rolling_friction);
    for (std::size_t i = 0; i < rigid.size(); ++i)
      EXPECT_LT((rigid[i] - modal[i]).norm(), 1e-4) << i << " with " << rolling_friction;
  }
}

TEST(GameContact, NoSeamStopsWhatSlidesOverFlushBoxes) {
  ManifoldFinder manifolds;
  World world;
  world.set_contact_source(&manifolds, game(8, 0.0));
  const auto floor = std::make_shared<const Shape>(Box{.half_extents = {0.5, 0.5, 0.5}});
  for (int i = 0; i < 12; ++i) world.add_static(floor, {{}, {static_cast<double>(i), 0.0, -0.5}});
  const BodyId cube = world.add_body(rigid_box(), {.pose = {{}, {0.0, 0.0, 0.1}},
                                                   .velocity = {2.0, 0.0, 0.0},
                                                   .shape = std::make_shared<const Shape>(Box{{0.1, 0.1, 0.1}})});
  for (int i = 0; i < 300; ++i) world.step();
  EXPECT_NEAR(world.body(cube).velocity.x(), 2.0, 1e-3 * 2.0);
  EXPECT_NEAR(world.body(cube).pose.p.x(), 10.0, 0.01);
}

TEST(GameContact, AFastBallDoesNotPassAThinPlate) {
  for (int i = 0; i < 20; ++i) {
    ManifoldFinder manifolds;
    World world;
    world.set_contact_source(&manifolds, game());
    world.add_static(std::make_shared<const Shape>(Box{.half_extents = {1.0, 1.0, 1e-3}}));
    const BodyId ball = world.add_body(rigid_box(), {.pose = {{}, {0.01 * i, 0.0, 0.3 + 0.02 * i}},
                                                     .velocity = {5.0, 0.0, -50.0},
                                                     .shape = std::make_shared<const Shape>(Sphere{0.05})});
    for (int step = 0; step < 5; ++step) world.step();
    EXPECT_GT(world.body(ball).pose.p.z(), 0.0) << i;
  }
}

TEST(GameContact, RollingResistanceSlowsABallByItsCoefficient) {
  ContactOptions options = game(8, 0.8);
  options.rolling_friction = 0.05;
  GroundedWorld scene(options);
  ModalModelData data = sample_model_data({.modes = 0});
  data.inertia = 0.4 * data.mass * 0.04 * Mat3::Identity();
  const BodyId ball = scene.world.add_body(std::make_shared<const ModalModel>(std::move(data)),
                                           {.pose = {{}, {0.0, 0.0, 0.2}},
                                            .velocity = {2.0, 0.0, 0.0},
                                            .angular_velocity = {0.0, 10.0, 0.0},
                                            .shape = std::make_shared<const Shape>(Sphere{0.2})});
  scene.step(6);
  const double before = scene.world.body(ball).velocity.x();
  scene.step(60);
  const double slowing = 0.05 * kGravity / 1.4;
  EXPECT_NEAR(before - scene.world.body(ball).velocity.x(), slowing, 0.01 * slowing);
}

}  // namespace
}  // namespace limber::testing
