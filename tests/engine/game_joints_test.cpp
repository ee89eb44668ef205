// Joints solved directly in game contact: chains, heavy ends, loops, tops, hands that contradict.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "asked.h"
#include "grounded_world.h"

namespace limber::testing {
namespace {

const ContactOptions kBySmallSteps{.solver = ContactSolver::kGame};

/// Links on ball joints from a hook, level or straight down.
struct Chain : GroundedWorld {
  Chain(int links, const Vec3& along, double end_times, int modes = 0, const ContactOptions& options = kBySmallSteps,
        double height = 10.0)
      : GroundedWorld(options) {
    const auto model = sample_model({.modes = modes, .lowest_hz = 40.0, .decay = 5.0});
    ModalModelData end = sample_model_data({.modes = 0});
    end.mass *= end_times, end.inertia *= end_times;
    const auto last = end_times > 1.0 ? std::make_shared<const ModalModel>(std::move(end)) : model;
    const double turn = std::acos(along.x());
    const Quaternion q = quaternion_from_rotation_vector({0.0, turn, 0.0});
    BodyId before{};
    for (int i = 0; i < links; ++i) {
      const Vec3 start = Vec3(0.0, 0.0, height) + i * kSampleSize * along;
      const auto& of = i + 1 < links ? model : last;
      bodies.push_back(world.add_body(of, {.pose = {q, start + 0.5 * kSampleSize * along}}));
      joints.push_back(world.add_joint(before, bodies.back(), {.type = JointType::kBall, .frame = {.origin = start}},
                                       {.radius = 0.25}, {.radius = 0.25}));
      scale += of->data().mass * kGravity * kSampleSize;
      before = bodies.back();
    }
  }
  double opening() const {
    double worst = 0.0;
    for (const JointId joint : joints) worst = std::max(worst, world.joint(joint).distance_error);
    return worst / kSampleSize;
  }
  std::vector<BodyId> bodies;
  std::vector<JointId> joints;
  double scale = 0.0;  // Σ m g size
};

TEST(GameJoints, AChainLetGoLevelStaysClosedAndKeepsItsEnergy) {
  for (const int modes : {0, 10}) {
    Chain chain(6, Vec3::UnitX(), 1.0, modes);
    const double before = total_energy(chain.world, chain.bodies);
    for (int i = 0; i < 180; ++i) {
      chain.step(1);
      EXPECT_LT(chain.opening(), 1e-6) << modes;
      EXPECT_LT(total_energy(chain.world, chain.bodies) - before, 0.01 * chain.scale) << modes;
    }
    // What half the chain's height gives, Σ m g L/2, is at hand.
    EXPECT_GT(total_energy(chain.world, chain.bodies) - before, (modes > 0 ? -0.1 : -0.05) * 3.0 * chain.scale)
        << modes;
  }
}

// Links that turn by as much as they do here within a substep are not closed by rows of its start: 6e-6 stay open.
TEST(GameJoints, AChainThatWhipsIsClosedAtTheEndOfEachStep) {
  Chain chain(12, Vec3::UnitX(), 1.0, 0);
  double worst = 0.0, fastest = 0.0;
  for (int i = 0; i < 480; ++i) {
    chain.step(1);
    worst = std::max(worst, chain.opening());
    fastest = std::max(fastest, chain.world.body(chain.bodies.back()).angular_velocity.norm());
  }
  EXPECT_LT(worst, 1e-7);
  EXPECT_GT(fastest, 30.0) << "rad/s";
}

TEST(GameJoints, AChainSwingsAsTheExactSolverHasIt) {
  const auto place = [](const ContactOptions& options) {
    Chain chain(3, Vec3::UnitX(), 1.0, 0, options);
    chain.step(45);
    return chain.world.body(chain.bodies.back()).pose.p;
  };
  // Velocities of small steps are half a substep late: of first order.
  const Vec3 limit = place({.solver = ContactSolver::kGame, .small_steps = {256}});
  const double coarse = (place({.solver = ContactSolver::kGame, .small_steps = {8}}) - limit).norm(),
               fine = (place({.solver = ContactSolver::kGame, .small_steps = {16}}) - limit).norm();
  EXPECT_LT(coarse, 0.02 * kSampleSize);
  EXPECT_LT(fine, 0.6 * coarse);
  EXPECT_LT((place(exactly()) - limit).norm(), 0.02 * kSampleSize) << "kExact";
}

TEST(GameJoints, AHeavyEndHangsWithoutSag) {
  for (const double times : all_or_first<double>({1e4, 100.0})) {
    Chain chain(10, -Vec3::UnitZ(), times);
    const double before = chain.world.body(chain.bodies.back()).pose.p.z();
    chain.step(120);
    EXPECT_NEAR(chain.world.body(chain.bodies.back()).pose.p.z(), before, 1e-9) << times;
    EXPECT_LT(chain.opening(), 1e-9) << times;
  }
}

/// Light links turn to and fro under the end's pull faster than two radians a substep.
TEST(GameJoints, AHeavyEndLetGoLevelSwingsItsLightLinksWithoutGain) {
  Chain chain(10, Vec3::UnitX(), 1e4);
  double before = total_energy(chain.world, chain.bodies);
  for (int i = 0; i < 180; ++i) {
    chain.step(1);
    EXPECT_LT(chain.opening(), 1e-4);
    EXPECT_LT(total_energy(chain.world, chain.bodies) - before, 2e-3 * chain.scale);
    before = total_energy(chain.world, chain.bodies);
  }
}

/// The end comes down on the ground while the chain is all but straight: what it then moves by is what links must make
/// up for that are too light to be turned that far.
TEST(GameJoints, AHeavyEndThatDropsOnTheGroundLeavesItsLinksClosed) {
  Chain chain(10, Vec3::UnitX(), 1e4, 0, {.solver = ContactSolver::kGame, .small_steps = {8}}, 3.0);
  for (int i = 0; i < 120; ++i) {
    chain.step(1);
    EXPECT_LT(chain.opening(), 1e-8) << i;
  }
  EXPECT_LT(chain.world.body(chain.bodies.back()).pose.p.z(), 0.2);
}

/// By both solvers: a step in which it turns by five radians is taken in parts.
/// What turns by a radian within a substep must keep its energy by itself: joints know nothing of it.
TEST(GameJoints, ASlenderPendulumGainsNoEnergyAtAnyStep) {
  for (const double step : {1.0 / 60.0, 0.1, 0.3, 1.0})
    for (const int links : {1, 3}) {
      World world({.step = step});
      world.set_contact_source(nullptr, kBySmallSteps);
      const Vec3 half(0.15, links > 1 ? 0.05 : 0.03, links > 1 ? 0.05 : 0.03);
      const auto bar = std::make_shared<const Shape>(Box{half});
      std::vector<BodyId> bodies;
      double scale = 0.0;
      for (int i = 0; i < links; ++i) {
        const Vec3 hook(2.0 * half.x() * i, 0.0, 0.0);
        const BodyId before = i > 0 ? bodies.back() : BodyId{};
        bodies.push_back(world.add_rigid(bar, 1000.0, {.pose = {.p = hook + half}}));
        world.add_joint(before, bodies.back(), {.type = JointType::kBall, .frame = {.origin = hook}});
        scale += world.model(bodies.back()).data().mass * kGravity * 2.0 * half.x() * links;
      }
      const double start = total_energy(world, bodies);
      for (int i = 0; i < 500; ++i) {
        world.step();
        ASSERT_LT(total_energy(world, bodies) - start, 1e-2 * scale) << step << " s, " << links << ", " << i;
      }
    }
}

/// Nobody steps so. But no number may come of it that is none.
TEST(GameJoints, AChainStaysFiniteAtStepsOfMinutes) {
  for (const double step : {3.0, 10.0, 100.0}) {
    World world({.step = step});
    world.set_contact_source(nullptr, kBySmallSteps);
    const auto bar = std::make_shared<const Shape>(Box{{0.15, 0.05, 0.05}});
    BodyId before{};
    for (int i = 0; i < 3; ++i) {
      const Vec3 hook(0.3 * i, 0.0, 0.0);
      const BodyId link = world.add_rigid(bar, 1000.0, {.pose = {.p = hook + Vec3(0.15, 0.05, 0.05)}});
      world.add_joint(before, link, {.type = JointType::kBall, .frame = {.origin = hook}});
      before = link;
    }
    for (int i = 0; i < 1000; ++i) world.step();
    EXPECT_TRUE(world.constraint_report().solved) << step;
    EXPECT_LT(world.body(before).pose.p.norm(), 10.0) << step;
  }
}

TEST(GameJoints, AFastTopPrecessesAndDoesNotFall) {
  for (const ContactOptions& options : {kBySmallSteps, exactly()})
    for (const double spin : {100.0, 300.0}) {
      constexpr double kRadius = 0.1, kArm = 0.1;
      GroundedWorld scene(options);
      ModalModelData d = sample_model_data({.modes = 0});
      d.mass = 1.0;
      const double axial = 0.5 * kRadius * kRadius;
      d.inertia = Vec3(axial, 0.5 * axial, 0.5 * axial).asDiagonal();
      const double law = kGravity * kArm / (axial * spin);
      const Vec3 hook(0.0, 0.0, 5.0);
      const BodyId disc = scene.world.add_body(std::make_shared<const ModalModel>(std::move(d)),
                                               {.pose = {{}, hook + kArm * Vec3::UnitX()},
                                                .velocity = {0.0, law * kArm, 0.0},
                                                .angular_velocity = {spin, 0.0, law}});
      scene.world.add_joint(BodyId{}, disc, {.type = JointType::kBall, .frame = {.origin = hook}});
      const double energy = scene.world.energy(disc).total();
      double turned = 0.0, last = 0.0;
      for (int i = 0; i < 120; ++i) {
        scene.step(1);
        const Vec3 p = scene.world.body(disc).pose.p - hook;
        const double now = std::atan2(p.y(), p.x());
        turned += std::remainder(now - last, 2.0 * std::numbers::pi);
        last = now;
        EXPECT_NEAR(p.z(), 0.0, 0.01 * kArm);
      }
      EXPECT_NEAR(turned, 2.0 * law, 0.01 * law) << spin;
      EXPECT_NEAR(scene.world.energy(disc).total(), energy, 1e-3 * energy) << spin;
    }
}

/// Bars that hang side by side from the world and carry one beam: three bars and more say the same twice.
TEST(GameJoints, FiveBarsInParallelSwingTheirBeamAsOnePendulum) {
  GroundedWorld scene(kBySmallSteps);
  const auto bar = sample_model({.modes = 0, .half_extent = {0.05, 0.05, 0.5}});
  const auto beam = sample_model({.modes = 0, .half_extent = {2.0, 0.1, 0.1}});
  const double angle = 0.3;
  const Vec3 down = 0.5 * Vec3(std::sin(angle), 0.0, -std::cos(angle));
  const Quaternion tilt = quaternion_from_rotation_vector({0.0, -angle, 0.0});
  const BodyId carried = scene.world.add_body(beam, {.pose = {{}, Vec3(0.0, 0.0, 5.0) + 2.0 * down}});
  std::vector<JointId> joints;
  for (int i = -2; i <= 2; ++i) {
    const Vec3 top(0.8 * i, 0.0, 5.0);
    const BodyId hanging = scene.world.add_body(bar, {.pose = {tilt, top + down}});
    JointSpec hinge{.type = JointType::kRevolute, .frame = {.origin = top}};
    hinge.frame.axes << Vec3::UnitY(), -Vec3::UnitX(), Vec3::UnitZ();
    joints.push_back(scene.world.add_joint(BodyId{}, hanging, hinge));
    hinge.frame.origin = top + 2.0 * down;
    joints.push_back(scene.world.add_joint(hanging, carried, hinge));
  }
  double least = 10.0;
  for (int i = 0; i < 240; ++i) {
    scene.step(1);
    for (const JointId joint : joints) {
      EXPECT_LT(scene.world.joint(joint).distance_error, 1e-5);
      EXPECT_LT(scene.world.joint(joint).angle_error, 1e-5);
    }
    EXPECT_LT(scene.world.body(carried).angular_velocity.norm(), 1e-3) << "it stays level";
    least = std::min(least, scene.world.body(carried).pose.p.x());
  }
  EXPECT_NEAR(least, -2.0 * down.x(), 0.01) << "and comes as high on the other side";
}

TEST(GameJoints, HandsThatContradictMeetInTheMiddle) {
  GroundedWorld scene({.solver = ContactSolver::kGame});
  const BodyId body = scene.world.add_body(sample_model({.modes = 0}), {.pose = {{}, {0.0, 0.0, 3.0}}});
  const HandleId left = scene.world.add_handle(body, kMarked), right = scene.world.add_handle(body, kMarked);
  const Vec3 start = scene.world.position(body, kMarked);
  for (int i = 1; i <= 60; ++i) {
    const Vec3 apart(0.005 * i, 0.0, 0.0), along(0.0, 0.01 * i, 0.0);
    scene.world.set_handle_target(left, {.position = start + along - apart});
    scene.world.set_handle_target(right, {.position = start + along + apart});
    scene.step(1);
    EXPECT_LT((scene.world.position(body, kMarked) - start - along).norm(), 1e-3);
  }
}

}  // namespace
}  // namespace limber::testing
