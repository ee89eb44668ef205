// Machines of joints in game contact: actuation at its closed forms, loops of more rows than freedoms, chains, doors
// and cars that touch things.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "grounded_world.h"

namespace limber::testing {
namespace {

const ContactOptions kGame{.solver = ContactSolver::kGame};

/// A joint's frame whose x axis is as given.
JointSpec about(const Vec3& x, const Vec3& origin, JointType type = JointType::kRevolute) {
  JointSpec spec{.type = type, .frame = {.origin = origin}};
  const Vec3 y = x.unitOrthogonal();
  spec.frame.axes << x, y, x.cross(y);
  return spec;
}

/// The largest opening of joints and the steps that were not solved, step by step.
struct Watched : GroundedWorld {
  explicit Watched(const WorldOptions& options = {}) : GroundedWorld(kGame, options) {}
  JointId join(BodyId a, BodyId b, const JointSpec& spec) {
    joints.push_back(world.add_joint(a, b, spec));
    return joints.back();
  }
  void watch(int steps) {
    for (int i = 0; i < steps; ++i) {
      step(1);
      unsolved += world.constraint_report().solved ? 0 : 1;
      for (const JointId joint : joints)
        apart = std::max({apart, world.joint(joint).distance_error, world.joint(joint).angle_error});
    }
  }
  std::vector<JointId> joints;
  double apart = 0.0;  // m or rad
  int unsolved = 0;
};

/// A link of the world on a hinge about y at its end, level: positive angles let it down.
struct Lever : Watched {
  explicit Lever(const WorldOptions& options = {}, double angle = 0.0) : Watched(options) {
    const auto model = sample_model({.modes = 0});
    const Quaternion q = quaternion_from_rotation_vector({0.0, angle, 0.0});
    const Vec3 hook(0.0, 0.0, 3.0);
    body = world.add_body(model, {.pose = {q, hook + q * Vec3(kArm, 0.0, 0.0)}});
    joint = join(BodyId{}, body, about(Vec3::UnitY(), hook));
    lift = model->data().mass * kGravity * kArm;
    inertia = model->data().inertia(1, 1) + model->data().mass * kArm * kArm;
  }
  double angle() const { return world.joint(joint).position[0]; }
  static constexpr double kArm = 0.3;
  BodyId body;
  JointId joint;
  double lift = 0.0, inertia = 0.0;  // m g arm, N·m; about the hinge, kg·m²
};

TEST(GameMachines, AMotorGivesItsTorqueUntilItTurnsAtItsSpeed) {
  Lever lever({.gravity = Vec3::Zero()});
  constexpr double kTorque = 2.0, kSpeed = 5.0;
  lever.world.set_joint_actuation(lever.joint, 0, {.motor_velocity = kSpeed, .motor_max_force = kTorque});
  const int reaches = static_cast<int>(60.0 * kSpeed * lever.inertia / kTorque);
  ASSERT_GT(reaches, 5);
  lever.watch(reaches);
  const double t = reaches / 60.0, h = 1.0 / 60.0 / SmallSteps{}.substeps;
  // Velocities act from a substep's start: half a substep ahead of ½ τ t²/I.
  EXPECT_NEAR(lever.angle(), 0.5 * kTorque / lever.inertia * t * (t + h), 2e-3 * lever.angle());
  EXPECT_NEAR(lever.world.joint(lever.joint).force[0], kTorque, 1e-6 * kTorque);
  lever.watch(30);
  EXPECT_NEAR(lever.world.body(lever.body).angular_velocity.y(), kSpeed, 1e-5 * kSpeed);
  EXPECT_NEAR(lever.world.joint(lever.joint).force[0], 0.0, 1e-3 * kTorque);
  EXPECT_LT(lever.apart, 1e-6);
}

/// m g arm sin(angle from straight down) = torque. Beyond it the lever swings by its speed over its frequency.
TEST(GameMachines, AMotorStallsWhereTheWeightBalancesIt) {
  constexpr double kFrom = std::numbers::pi / 6.0, kSpeed = 0.02;
  Lever lever({}, 0.5 * std::numbers::pi - kFrom);
  const double torque = 0.6 * lever.lift, frequency = std::sqrt(0.8 * lever.lift / lever.inertia);
  lever.world.set_joint_actuation(lever.joint, 0, {.motor_velocity = -kSpeed, .motor_max_force = torque});
  lever.watch(480);
  EXPECT_NEAR(kFrom - lever.angle(), std::asin(0.6), 1.1 * kSpeed / frequency);
  EXPECT_NEAR(lever.world.joint(lever.joint).force[0], -torque, 1e-6 * torque);
}

TEST(GameMachines, ADriveRestsAtItsSag) {
  Lever lever;
  const double k = 20.0 * lever.lift;
  lever.world.set_joint_actuation(lever.joint, 0, {.drive_stiffness = k, .drive_damping = 0.2 * std::sqrt(k)});
  lever.watch(600);
  EXPECT_NEAR(k * lever.angle(), lever.lift * std::cos(lever.angle()), 1e-4 * lever.lift);
  EXPECT_NEAR(lever.world.joint(lever.joint).force[0], -k * lever.angle(), 1e-4 * lever.lift);
}

/// A pendulum with dry friction τ loses 2 τ/(m g arm) of its swing each time, and stays where the weight is less.
TEST(GameMachines, APendulumWithDryFrictionStopsAsItsLawSays) {
  constexpr double kSwing = 0.2;
  for (const double share : {0.025, 0.25}) {
    Lever lever({}, 0.5 * std::numbers::pi - kSwing);
    const double friction = share * lever.lift;
    lever.world.set_joint_actuation(lever.joint, 0, {.friction = friction});
    const auto lean = [&] { return lever.angle() - kSwing; };  // from straight down
    double last = lean(), before = last;
    std::vector<double> turns;
    for (int i = 0; i < 600; ++i) {
      lever.watch(1);
      if ((lean() - last) * (last - before) < 0.0) turns.push_back(std::abs(last));
      before = last, last = lean();
    }
    if (share > kSwing) {
      EXPECT_NEAR(last, -kSwing, 1e-6) << "it sticks from the first";
      continue;
    }
    ASSERT_GE(turns.size(), 3U);
    for (std::size_t i = 0; i < turns.size(); ++i)
      EXPECT_NEAR(turns[i], kSwing - 2.0 * share * static_cast<double>(i + 1), 0.1 * share) << i;
    EXPECT_LT(std::sin(std::abs(last)), share * 1.01) << "and stays where friction carries it";
    const double stays = last;
    lever.watch(60);
    EXPECT_NEAR(lean(), stays, 1e-6);
  }
}

TEST(GameMachines, AnEndStopHitAtTwentyRadiansASecondDoesNotRebound) {
  constexpr double kStop = 0.5;
  Watched scene({.gravity = Vec3::Zero()});
  const Vec3 hook(0.0, 0.0, 3.0);
  const BodyId body = scene.world.add_body(
      sample_model({.modes = 0}),
      {.pose = {{}, hook + Vec3(0.3, 0.0, 0.0)}, .velocity = {0.0, 0.0, -6.0}, .angular_velocity = {0.0, 20.0, 0.0}});
  JointSpec hinge = about(Vec3::UnitY(), hook);
  hinge.limits.rotation = {-kStop, kStop};
  const JointId joint = scene.join(BodyId{}, body, hinge);
  for (int i = 0; i < 60; ++i) {
    scene.watch(1);
    EXPECT_LT(scene.world.joint(joint).position[0], kStop + 1e-8);
  }
  EXPECT_NEAR(scene.world.joint(joint).position[0], kStop, 1e-4);
  EXPECT_LT(scene.world.body(body).angular_velocity.norm(), 1e-3);
  EXPECT_EQ(scene.unsolved, 0);
}

/// Bricard's loop of six hinges along a cube's edges has one freedom where counting gives none.
TEST(GameMachines, BricardsLoopMovesWithOneFreedom) {
  Watched scene;
  const Vec3 base(0.0, 0.0, 5.0);
  const Vec3 corners[] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {1, 1, 1}, {0, 1, 1}, {0, 0, 1}};
  const Vec3 axes[] = {Vec3::UnitY(), Vec3::UnitZ(), Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ(), Vec3::UnitX()};
  std::vector<BodyId> rods;
  double scale = 0.0;
  for (int i = 1; i < 6; ++i) {
    const Vec3 from = corners[i], to = corners[(i + 1) % 6], along = (to - from).cwiseAbs();
    const auto rod = sample_model({.modes = 0, .half_extent = 0.5 * along + 0.03 * (Vec3::Ones() - along)});
    rods.push_back(scene.world.add_body(rod, {.pose = {{}, base + 0.5 * (from + to)}}));
    for (std::size_t j = 0; j + 1 < rods.size(); ++j) scene.world.ignore_collision(rods[j], rods.back(), true);
    scene.join(i == 1 ? BodyId{} : rods[rods.size() - 2], rods.back(),
               about(axes[static_cast<std::size_t>(i)], base + from));
    scale += rod->data().mass * kGravity;
  }
  scene.join(rods.back(), BodyId{}, about(axes[0], base));
  const double before = total_energy(scene.world, rods);
  double moved = 0.0;
  const Vec3 start = scene.world.body(rods[2]).pose.p;
  for (int i = 0; i < 300; ++i) {
    scene.watch(1);
    moved = std::max(moved, (scene.world.body(rods[2]).pose.p - start).norm());
    EXPECT_LT(total_energy(scene.world, rods) - before, 0.02 * scale);
  }
  EXPECT_GT(moved, 0.5);
  EXPECT_GT(total_energy(scene.world, rods) - before, -0.1 * scale) << "no regularisation that damps";
  EXPECT_LT(scene.apart, 1e-5);
  EXPECT_EQ(scene.unsolved, 0);
}

/// Three hinges in line, five of whose fifteen rows are enough, and a ball that is thrown at the leaf.
TEST(GameMachines, ADoorInItsFrameIsThrownOpenByABall) {
  Watched scene;
  const auto leaf = sample_model({.modes = 0, .half_extent = {0.4, 0.02, 1.0}});
  const BodyId door = scene.world.add_body(leaf, {.pose = {{}, {0.41, 0.0, depth_below_origin(*leaf) + 0.05}}});
  JointSpec hinge = about(Vec3::UnitZ(), {0.0, 0.0, 0.0});
  hinge.limits.rotation = {0.0, 1.5};
  std::vector<JointId> hinges;
  for (const double z : {0.25, 1.05, 1.85}) {
    hinge.frame.origin.z() = z;
    hinges.push_back(scene.join(BodyId{}, door, hinge));
  }
  const auto post = std::make_shared<Shape>(Box{{0.05, 0.05, 1.05}});
  scene.world.add_static(post, {{}, {-0.1, 0.0, 1.05}});
  scene.world.add_static(post, {{}, {0.88, 0.0, 1.05}});
  scene.watch(60);
  EXPECT_NEAR(scene.world.joint(hinges[0]).position[0], 0.0, 1e-8) << "it hangs still";
  double carried = 0.0;
  for (const JointId joint : hinges) carried += scene.world.joint(joint).lock_force.z();
  EXPECT_NEAR(carried, leaf->data().mass * kGravity, 1e-3 * leaf->data().mass * kGravity) << "hinges share its weight";
  const BodyId ball = scene.world.add_body(
      sample_model({.modes = 0, .half_extent = {0.1, 0.1, 0.1}}),
      {.pose = {{}, {0.6, -0.6, 1.2}}, .velocity = {0.0, 12.0, 0.0}, .shape = std::make_shared<Shape>(Sphere{0.1})});
  double widest = 0.0;
  for (int i = 0; i < 240; ++i) {
    scene.watch(1);
    const double angle = scene.world.joint(hinges[0]).position[0];
    widest = std::max(widest, angle);
    EXPECT_GT(angle, -1e-8);
  }
  EXPECT_GT(widest, 1.0);
  EXPECT_LT(widest, 1.5 + 1e-8);
  EXPECT_LT(scene.apart, 1e-6);
  EXPECT_EQ(scene.unsolved, 0);
  EXPECT_TRUE(scene.world.contains(ball));
}

/// Links of 0.2 m along x, on ball joints.
std::vector<BodyId> lay_chain(Watched& scene, int links, const Vec3& start,
                              const Vec3& velocity_of_last = Vec3::Zero()) {
  const auto model = sample_model({.modes = 0, .half_extent = {0.1, 0.03, 0.03}});
  std::vector<BodyId> bodies;
  for (int i = 0; i < links; ++i) {
    const Vec3 from = start + Vec3(0.2 * i, 0.0, 0.0);
    bodies.push_back(scene.world.add_body(
        model, {.pose = {{}, from + Vec3(0.1, 0.0, 0.0)},
                .velocity = (i + 0.5) / links * velocity_of_last,
                .angular_velocity = Vec3(0.0, -velocity_of_last.z(), velocity_of_last.y()) / (0.2 * links),
                .shape = std::make_shared<Shape>(Box{{0.08, 0.03, 0.03}})}));
    if (i > 0)
      scene.join(bodies[static_cast<std::size_t>(i - 1)], bodies.back(), about(Vec3::UnitX(), from, JointType::kBall));
  }
  return bodies;
}

TEST(GameMachines, AChainThrownOverABarHangsFromIt) {
  Watched scene;
  constexpr double kRadius = 0.15;
  const Vec3 bar(2.0, 0.0, 3.0);
  scene.world.add_static(std::make_shared<Shape>(Capsule{kRadius, 1.0}),
                         {quaternion_from_rotation_vector({0.5 * std::numbers::pi, 0.0, 0.0}), bar});
  const std::vector<BodyId> chain = lay_chain(scene, 20, {0.0, 0.0, 3.5});
  for (int i = 0; i < 300; ++i) {
    scene.watch(1);
    for (const BodyId link : chain) {
      const Vec3 off = scene.world.body(link).pose.p - bar;
      EXPECT_GT(std::hypot(off.x(), off.z()), kRadius) << "no link goes through the bar";
    }
  }
  double top = 0.0;
  for (const BodyId link : chain) top = std::max(top, scene.world.body(link).pose.p.z());
  EXPECT_GT(top, bar.z() + kRadius);
  EXPECT_LT(scene.world.body(chain.front()).pose.p.z(), bar.z() - 1.0) << "both ends hang";
  EXPECT_LT(scene.world.body(chain.back()).pose.p.z(), bar.z() - 1.0);
  EXPECT_LT(scene.apart, 1e-6);
  EXPECT_EQ(scene.unsolved, 0);
}

TEST(GameMachines, AChainWindsItselfRoundAPost) {
  Watched scene({.gravity = Vec3::Zero()});
  constexpr double kRadius = 0.2;
  scene.world.add_static(std::make_shared<Shape>(Capsule{kRadius, 2.0}), {{}, {0.0, 0.0, 3.0}});
  const std::vector<BodyId> chain = lay_chain(scene, 16, {0.0, -kRadius - 0.04, 3.0}, {0.0, 8.0, 0.0});
  scene.join(BodyId{}, chain.front(), about(Vec3::UnitX(), {0.0, -kRadius - 0.04, 3.0}, JointType::kBall));
  const double before = total_energy(scene.world, chain);
  double turned = 0.0, last = std::atan2(-kRadius, 3.1);
  for (int i = 0; i < 240; ++i) {
    scene.watch(1);
    const Vec3 p = scene.world.body(chain.back()).pose.p;
    const double now = std::atan2(p.y(), p.x());
    turned += std::remainder(now - last, 2.0 * std::numbers::pi);
    last = now;
    EXPECT_LT(total_energy(scene.world, chain), 1.02 * before);
    for (const BodyId link : chain) EXPECT_GT(scene.world.body(link).pose.p.head<2>().norm(), kRadius);
  }
  EXPECT_GT(turned, 2.0 * std::numbers::pi);
  EXPECT_LT(scene.apart, 1e-6);
  EXPECT_EQ(scene.unsolved, 0);
}

TEST(GameMachines, ACarOnFourHingesDrivesOverBumps) {
  Watched scene;
  const BodyId body =
      scene.world.add_body(sample_model({.modes = 0, .half_extent = {0.9, 0.4, 0.1}}), {.pose = {{}, {0.0, 0.0, 0.5}}});
  const auto tyre = sample_model({.modes = 0, .half_extent = {0.25, 0.1, 0.25}});
  std::vector<BodyId> wheels, all{body};
  for (const double x : {-0.7, 0.7})
    for (const double y : {-0.6, 0.6}) {
      wheels.push_back(scene.world.add_body(
          tyre, {.pose = {{}, {x, y, 0.25}}, .friction = 0.9, .shape = std::make_shared<Shape>(Sphere{0.25})}));
      const JointId axle = scene.join(body, wheels.back(), about(Vec3::UnitY(), {x, y, 0.25}));
      scene.world.set_joint_actuation(axle, 0, {.motor_velocity = 12.0, .motor_max_force = 8.0});
      all.push_back(wheels.back());
    }
  const auto bump = std::make_shared<Shape>(Capsule{0.2, 2.0});
  for (int i = 0; i < 5; ++i)
    scene.world.add_static(
        bump, {quaternion_from_rotation_vector({0.5 * std::numbers::pi, 0.0, 0.0}), {2.0 + 1.1 * i, 0.0, -0.12}});
  double highest = 0.0, fastest = 0.0;
  for (int i = 0; i < 360; ++i) {
    scene.watch(1);
    highest = std::max(highest, scene.world.body(body).pose.p.z());
    fastest = std::max(fastest, scene.world.body(body).velocity.norm());
  }
  EXPECT_GT(scene.world.body(body).pose.p.x(), 7.0) << "it gets over all of them";
  EXPECT_GT((scene.world.body(body).pose.q * Vec3::UnitZ()).z(), 0.9) << "on its wheels";
  EXPECT_LT(highest, 1.2);
  EXPECT_LT(fastest, 1.3 * 12.0 * 0.25) << "m/s: no faster than wheels and bumps make it";
  EXPECT_LT(scene.apart, 1e-6);
  EXPECT_EQ(scene.unsolved, 0);
}

}  // namespace
}  // namespace limber::testing
