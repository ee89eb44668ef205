// Joints, hands and unequal masses beside contacts, through World and ContactFinder at 60 steps a second: whether each
// step settles, how far joints come apart, and what the energy does. Prints Markdown.
// Figures: docs/reports/contact.md.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "grounded_world.h"

namespace limber::testing {
namespace {

constexpr int kSteps = 300;

/// A rigid body as large as the sample body and so many times as heavy.
std::shared_ptr<const ModalModel> heavy(double times) {
  ModalModelData d = sample_model_data({.modes = 0});
  d.mass *= times;
  d.inertia *= times;
  return std::make_shared<const ModalModel>(std::move(d));
}

/// One that bends by as much under what is so many times heavier as it would under its own like.
std::shared_ptr<const ModalModel> link(int modes, double times = 1.0) {
  const double stiffer = std::sqrt(times);
  return sample_model({.modes = modes, .lowest_hz = 30.0 * stiffer, .decay = 6.0 * stiffer});
}

struct Scene : GroundedWorld {
  using GroundedWorld::GroundedWorld;
  std::vector<BodyId> bodies;
  std::vector<JointId> joints;
  std::function<void(int)> drive = [](int) {};  // before each step, with its number

  BodyId add(std::shared_ptr<const ModalModel> model, const RigidTransform& pose, const Vec3& velocity = Vec3::Zero(),
             const Vec3& angular_velocity = Vec3::Zero()) {
    bodies.push_back(
        world.add_body(std::move(model), {.pose = pose, .velocity = velocity, .angular_velocity = angular_velocity}));
    return bodies.back();
  }
};

/// Four links on ball joints from a hook, let go level; the last is rigid where it is so many times as heavy.
void chain(Scene& s, int modes, double height, double times) {
  BodyId before{};
  for (int i = 0; i < 4; ++i) {
    const Vec3 start(i * kSampleSize, 0.0, height);
    const auto model = i == 3 && times > 1.0 ? heavy(times) : link(modes, times);
    const BodyId next = s.add(model, {.p = start + 0.5 * kSampleSize * Vec3::UnitX()});
    s.joints.push_back(s.world.add_joint(before, next, {.type = JointType::kBall, .frame = {.origin = start}},
                                         {.radius = 0.25}, {.radius = 0.25}));
    before = next;
  }
}

/// A hand that takes a block along the ground, 5 mm into it.
void pushed(Scene& s, int modes) {
  const auto model = link(modes);
  const BodyId block = s.add(model, {.p = {0.0, 0.0, depth_below_origin(*model)}});
  s.step(30);
  const HandleId hand = s.world.add_handle(block, kMarked);
  s.drive = [&s, hand, target = s.world.position(block, kMarked)](int i) mutable {
    target += Vec3(0.5 / 60.0, 0.0, i < 30 ? -0.005 / 30.0 : 0.0);
    s.world.set_handle_target(hand, {.position = target});
  };
}

/// An arm that turns at 20 rad/s between stops at ±0.5 rad: on a hook; or on a base that lies on the ground, is four
/// times as heavy and is thrown about by it.
void stops(Scene& s, int modes, bool on_base) {
  JointSpec hinge{.type = JointType::kRevolute, .frame = {.origin = {0.0, 0.0, 1.0}}};
  hinge.frame.axes.col(0) = Vec3::UnitY(), hinge.frame.axes.col(1) = Vec3::UnitZ(),
  hinge.frame.axes.col(2) = Vec3::UnitX();
  hinge.limits.rotation = {-0.5, 0.5};
  BodyId base{};
  if (on_base) {
    const auto model = heavy(4.0);
    hinge.frame.origin.z() = 2.0 * depth_below_origin(*model) + 0.1;
    base = s.add(model, {.p = {0.0, 0.0, depth_below_origin(*model)}});
    s.step(30);
  }
  const Vec3 omega(0.0, 20.0, 0.0), arm = 0.5 * kSampleSize * Vec3::UnitX();
  const BodyId body = s.add(link(modes), {.p = hinge.frame.origin + arm}, omega.cross(arm), omega);
  s.joints.push_back(s.world.add_joint(base, body, hinge, {.radius = 0.25}, {.radius = 0.25}));
}

/// A body on another, which is 1e4 times lighter.
void on_light(Scene& s, int modes) {
  constexpr double kHeight = 0.2;  // m, of the body below
  const auto below = link(modes, 1e4), above = heavy(1e4);
  const double half = depth_below_origin(*below);
  s.add(below, {.p = {0.0, 0.0, half}});
  s.add(above, {.p = {0.0, 0.0, kHeight + half}});
}

struct Seen {
  int unsettled = 0, iterations = 0, newton_steps = 0;
  StepAttempts attempts;
  double residual = 0.0, apart = 0.0, rise = 0.0, removed = 0.0, deepest = 0.0;
};

Seen watch(Scene& s, double scale) {
  Seen seen;
  double before = total_energy(s.world, s.bodies);
  for (int i = 0; i < kSteps; ++i) {
    s.drive(i);
    s.world.step();
    const ConstraintReport& report = s.world.constraint_report();
    seen.unsettled += report.solved ? 0 : 1;
    seen.iterations = std::max(seen.iterations, report.iterations);
    seen.residual = std::max(seen.residual, 1e-9 * report.residual);
    seen.newton_steps = std::max(seen.newton_steps, report.newton_steps);
    seen.attempts.add(report.attempts);
    seen.removed += report.energy_removed / scale;
    for (const JointId joint : s.joints) seen.apart = std::max(seen.apart, s.world.joint(joint).distance_error);
    for (const BodyId body : s.bodies) seen.deepest = std::max(seen.deepest, -lowest(s.world, body));
    const double now = total_energy(s.world, s.bodies);
    seen.rise = std::max(seen.rise, (now - before) / scale);
    before = now;
  }
  return seen;
}

void run(const std::string& name, const std::function<void(Scene&, int)>& build) {
  for (const int modes : {0, 8})
    for (const double recovery : {0.05, 0.0}) {
      Scene s(exactly({.friction = 0.5, .recovery_speed = recovery}));
      build(s, modes);
      double scale = 0.0;
      for (const BodyId body : s.bodies) {
        const BodyEnergy e = s.world.energy(body);
        scale +=
            e.kinetic_rigid + e.kinetic_modal + e.elastic + s.world.model(body).data().mass * kGravity * kSampleSize;
      }
      const Seen seen = watch(s, scale);
      const auto n = [&](StepAttempt a) { return seen.attempts[a]; };
      std::printf("| %s | %d | %g | %d | %.0e | %d, %d | %d, %d | %.1e | %.1e | %.1e | %.1e |\n", name.c_str(), modes,
                  recovery, seen.unsettled, seen.residual, seen.iterations, seen.newton_steps, n(StepAttempt::kDivided),
                  n(StepAttempt::kRefused), seen.apart, seen.deepest / kSampleSize, seen.rise, seen.removed);
      std::fflush(stdout);
    }
}

/// A block on a slope, below the friction angle or above it. At the end at 10 m/s.
void slope(int modes, double angle, double friction) {
  ContactFinder finder;
  World world;
  world.set_contact_source(&finder, {.solver = ContactSolver::kExact, .friction = friction});
  const Quaternion tilt = quaternion_from_rotation_vector({0.0, angle, 0.0});
  world.add_static(std::make_shared<Shape>(HalfSpace{}), {tilt, Vec3::Zero()});
  const auto model = link(modes);
  const Vec3 normal = tilt * Vec3::UnitZ(), down = tilt * Vec3::UnitX();
  const BodyId block = world.add_body(model, {.pose = {tilt, depth_below_origin(*model) * normal}});
  const auto place = [&] { return world.body(block).pose.p; };
  int unsettled = 0;
  const auto go = [&](int steps) {
    for (int i = 0; i < steps; ++i) {
      world.step();
      unsettled += world.constraint_report().solved ? 0 : 1;
    }
  };
  go(120);
  const Vec3 start = place(), speed = world.body(block).velocity;
  go(60);
  const double gained = (world.body(block).velocity - speed).dot(down), creep = (place() - start).norm() / kSampleSize;
  const double law = kGravity * (std::sin(angle) - friction * std::cos(angle));
  if (law < 0.0) {
    std::printf("| %.3f of it | %d | %d | %.1e | | |\n", angle / std::atan(friction), modes, unsettled, creep);
    return;
  }
  while (world.body(block).velocity.dot(down) < 10.0) go(1);
  double lowest_gap = 1e30;
  for (Index v = 0; v < model->collision().vertices(); ++v)
    for (std::size_t t = 0; t < model->collision().triangles.size(); ++t)
      for (std::size_t c = 0; c < 3; ++c)
        if (model->collision().triangles[t][c] == v) {
          SurfacePoint at{.triangle = static_cast<Index>(t), .weight = {0.0, 0.0, 0.0}};
          at.weight[c] = 1.0;
          lowest_gap = std::min(lowest_gap, normal.dot(world.position(block, at)));
        }
  std::printf("| %.3f of it | %d | %d | | %.1e | %.1e |\n", angle / std::atan(friction), modes, unsettled,
              std::abs(gained / law - 1.0), lowest_gap / kSampleSize);
}

void run_all() {
  std::printf("%d steps each. Energy over kinetic and elastic energy at first and Σ m g size.\n\n", kSteps);
  std::printf(
      "| scene | modes | recovery, m/s | unsettled | off the law (residual × 1e-9) | most rounds, Newton steps | "
      "divided, "
      "refused | joints "
      "apart, m | deepest / size | "
      "largest rise | taken by the guard |\n|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (const double times : {1.0, 10.0, 100.0, 1e3, 1e4}) {
    char name[80];
    std::snprintf(name, sizeof name, "chain, its end on the ground %g times as heavy", times);
    run(name, [times](Scene& s, int modes) { chain(s, modes, 1.2, times); });
  }
  run("chain in the air, its end 1e4 times as heavy", [](Scene& s, int modes) { chain(s, modes, 4.0, 1e4); });
  run("block pushed into the ground by a hand", pushed);
  run("stops hit at 20 rad/s", [](Scene& s, int modes) { stops(s, modes, false); });
  run("the same on a base on the ground", [](Scene& s, int modes) { stops(s, modes, true); });
  run("1e4 times heavier on light", on_light);
  std::printf(
      "\n| angle / friction angle | modes | unsettled | creep / size in a second | acceleration, relative error | "
      "floats at 10 m/s, gap / size |\n|---|---|---|---|---|---|\n");
  for (const int modes : {0, 8})
    for (const double part : {0.9, 0.99, 1.05, 1.3}) slope(modes, part * std::atan(0.5), 0.5);
}

}  // namespace
}  // namespace limber::testing

int main() { limber::testing::run_all(); }
