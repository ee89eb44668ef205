// Joints in the exact mode against closed forms and published figures: tops that precess, chains and loops over many
// steps, beams of baked parts on fixed joints that bend far, are spun up, or join a crank to a slider. Prints Markdown.
// Usage: joint_laws [tops|long|bend|princeton|spin|crank]
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <numbers>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "cpu_time.h"
#include "grounded_world.h"
#include "joint_parts.h"
#include "limber/precompute/bake.h"
#include "segmented_rod.h"
#include "tet_box.h"

namespace limber::testing {
namespace {

const char* name_of(ContactSolver solver) { return solver == ContactSolver::kGame ? "game" : "exact"; }

// Tops ----------------------------------------------------------------------------------------------------------------

/// A disc on a ball joint beside its middle, its axle level: in steady precession by m g l/(I ω).
void tops() {
  constexpr double kRadius = 0.1, kArm = 0.1;
  std::printf(
      "| solver | rad/s | precession after 2 s / law − 1 | lowest in 10 s / arm | largest change of energy in 10 s | "
      "steps "
      "not solved |\n|---|---|---|---|---|---|\n");
  for (const ContactSolver solver : {ContactSolver::kExact, ContactSolver::kGame})
    for (const double spin : {30.0, 100.0, 300.0}) {
      NoContacts none;
      World world;
      world.set_contact_source(&none, {.solver = solver});
      ModalModelData d = sample_model_data({.modes = 0});
      d.mass = 1.0;
      const double axial = 0.5 * kRadius * kRadius, law = kGravity * kArm / (axial * spin);
      d.inertia = Vec3(axial, 0.5 * axial, 0.5 * axial).asDiagonal();
      const BodyId disc = world.add_body(
          std::make_shared<const ModalModel>(std::move(d)),
          {.pose = {{}, {kArm, 0.0, 0.0}}, .velocity = {0.0, law * kArm, 0.0}, .angular_velocity = {spin, 0.0, law}});
      world.add_joint(BodyId{}, disc, {.type = JointType::kBall});
      const double before = world.energy(disc).total();
      double turned = 0.0, last = 0.0, low = 0.0, change = 0.0, after_two = 0.0;
      int failed = 0;
      for (int i = 0; i < 600; ++i) {
        world.step();
        failed += world.constraint_report().solved ? 0 : 1;
        const Vec3 p = world.body(disc).pose.p;
        const double now = std::atan2(p.y(), p.x());
        turned += std::remainder(now - last, 2.0 * std::numbers::pi);
        last = now;
        if (i == 119) after_two = turned;
        low = std::min(low, p.z());
        change = std::max(change, std::abs(world.energy(disc).total() / before - 1.0));
      }
      std::printf("| %s | %.0f | %+.4f | %.3f | %.1e | %d |\n", name_of(solver), spin, after_two / (2.0 * law) - 1.0,
                  low / kArm, change, failed);
      std::fflush(stdout);
    }
}

// Many steps ----------------------------------------------------------------------------------------------------------

/// What is seen of rigid bars on joints, let go, over 1e5 steps.
void watch_long(const char* name, World& world, const std::vector<BodyId>& bodies, const std::vector<JointId>& joints,
                double scale) {
  world.step();  // velocities meet the joints
  double apart = 0.0, rise = -1e30, fall = 0.0, before = total_energy(world, bodies);
  const double first = before, start = thread_seconds();
  int failed = 0;
  for (int i = 0; i < 100'000; ++i) {
    world.step();
    failed += world.constraint_report().solved ? 0 : 1;
    for (const JointId joint : joints) apart = std::max(apart, world.joint(joint).distance_error);
    const double now = total_energy(world, bodies);
    rise = std::max(rise, now - before);
    fall = std::max(fall, std::abs(now - first));
    before = now;
  }
  std::printf("| %s | %.1e | %.1e | %.1e | %d | %.0f |\n", name, apart, fall / scale, rise / scale, failed,
              1e6 * (thread_seconds() - start) / 1e5);
  std::fflush(stdout);
}

JointSpec hinge(const Vec3& at) {
  JointSpec spec{.type = JointType::kRevolute, .frame = {.origin = at}};
  spec.frame.axes.col(0) = Vec3::UnitY(), spec.frame.axes.col(1) = Vec3::UnitZ(),
  spec.frame.axes.col(2) = Vec3::UnitX();
  return spec;
}

/// Bars end to end from a place, on hinges about y or on balls.
void chain_long(const char* name, int links, bool balls, bool free) {
  NoContacts none;
  World world(free ? WorldOptions{.gravity = Vec3::Zero()} : WorldOptions{});
  world.set_contact_source(&none, exactly());
  const auto model = sample_model({.modes = 0});
  std::vector<BodyId> bodies;
  std::vector<JointId> joints;
  for (int i = 0; i < links; ++i) {
    const Vec3 from(i * kSampleSize, 0.0, 0.0);
    bodies.push_back(
        world.add_body(model, {.pose = {{}, from + 0.5 * kSampleSize * Vec3::UnitX()},
                               .angular_velocity = free ? Vec3(0.3 * i, 1.0 - i, 0.2) : Vec3(Vec3::Zero())}));
    if (free && i == 0) continue;
    JointSpec spec = hinge(from);
    if (balls) spec.type = JointType::kBall;
    joints.push_back(world.add_joint(i == 0 ? BodyId{} : bodies[bodies.size() - 2], bodies.back(), spec));
  }
  const double scale = links * model->data().mass * kGravity * kSampleSize;
  watch_long(name, world, bodies, joints, scale);
}

void four_bar_long() {
  NoContacts none;
  World world;
  world.set_contact_source(&none, exactly());
  const double crank = 0.2, coupler = 0.6, rocker = 0.5, ground = 0.55, d = std::hypot(ground, crank),
               along = (coupler * coupler - rocker * rocker + d * d) / (2.0 * d);
  const Vec3 o = Vec3::Zero(), a(0.0, 0.0, crank), g(ground, 0.0, 0.0), e = (g - a) / d, up(-e.z(), 0.0, e.x()),
             b = a + along * e + std::sqrt(coupler * coupler - along * along) * up;
  const auto model = sample_model({.modes = 0});
  std::vector<BodyId> bodies;
  const auto bar = [&](const Vec3& from, const Vec3& to) {
    const Vec3 x = (to - from).normalized();
    bodies.push_back(world.add_body(
        model,
        {.pose = {quaternion_from_rotation_vector(std::atan2(-x.z(), x.x()) * Vec3::UnitY()), 0.5 * (from + to)}}));
  };
  bar(o, a), bar(a, b), bar(g, b);
  const std::vector<JointId> joints = {
      world.add_joint(BodyId{}, bodies[0], hinge(o)), world.add_joint(bodies[0], bodies[1], hinge(a)),
      world.add_joint(bodies[1], bodies[2], hinge(b)), world.add_joint(BodyId{}, bodies[2], hinge(g))};
  watch_long("four-bar on hinges", world, bodies, joints, 3.0 * model->data().mass * kGravity * kSampleSize);
}

void many_steps() {
  std::printf(
      "| 1e5 steps, exact | opening, m | energy's largest change / Σ m g size | largest rise in a step | steps not "
      "solved | us a step |\n|---|---|---|---|---|---|\n");
  chain_long("pendulum on a hinge", 1, false, false);
  chain_long("chain of 5 on balls, hung", 5, true, false);
  chain_long("chain of 5 on balls, free", 5, true, true);
  four_bar_long();
}

// Beams ---------------------------------------------------------------------------------------------------------------

/// A bar of so many baked parts in line or on an arc, held at its start, whose end is pulled.
struct Beam {
  double length = 0.0, width = 0.0, height = 0.0;  // along x, y, z at its start
  double angle = 0.0;                              // that its middle turns through about z
  Material material;
  double damping = 0.0;  // s, of the modes: proportional to their stiffness
  double step = 0.0;
  Vec3 from = Vec3::Zero();  // its start
};

/// The middle of the beam, and its direction, after a share of the length.
RigidTransform place_of(const Beam& beam, double share) {
  const double turn = share * beam.angle, radius = beam.angle > 0.0 ? beam.length / beam.angle : 0.0;
  return {quaternion_from_rotation_vector(turn * Vec3::UnitZ()),
          beam.angle > 0.0 ? Vec3(radius * std::sin(turn), radius * (1.0 - std::cos(turn)), 0.0)
                           : Vec3(share * beam.length, 0.0, 0.0)};
}

/// The face at an end of a part, 0 or 1, and nothing beside it: what is within a sphere whose centre is far outside.
AttachmentPatch face(const Beam& part, double end) {
  const double half = 0.5001 * std::hypot(part.width, part.height), out = 20.0 * half;
  return {place_of(part, end) * Vec3(end > 0.0 ? out : -out, 0.0, 0.0), std::hypot(half, out)};
}

std::vector<SurfacePoint> points_of(const ModalModel& model, const AttachmentPatch& face) {
  return patch_around(model, SurfacePoint::Surface::kCollision, face.center - model.data().origin_in_input,
                      face.radius);
}

std::shared_ptr<const ModalModel> bake_part(const Beam& part, int cells, int modes) {
  TetMesh mesh = tet_box(cells, 2, 2, {1.0, part.width, part.height});
  for (Vec3& node : mesh.nodes)
    node = place_of(part, node.x()) * Vec3(0.0, node.y() - 0.5 * part.width, node.z() - 0.5 * part.height);
  BakeOptions o;
  o.materials = {{"*", part.material}};
  o.elements = Elements::kQuadratic;
  o.analysis.modes = o.limits.max_modes = modes;
  o.residual.patches = {face(part, 0.0), face(part, 1.0)};
  o.damping = {.stiffness_proportional = part.damping};
  Warnings warnings;
  return bake({.name = "part", .mesh = mesh}, o, warnings).asset.bodies[0];
}

struct Laid {
  std::vector<BodyId> bodies;
  std::vector<SurfacePoint> begin, end;  // of each, its faces
};

/// The parts of a beam, joined. @param first joins its start to `to`. @param moves its velocity there, and its turning
Laid lay(World& world, const Beam& beam, int parts, int cells, BodyId to, JointSpec first,
         const std::pair<Vec3, Vec3>& moves = {Vec3::Zero(), Vec3::Zero()}) {
  Beam part = beam;
  part.length /= parts, part.angle /= parts;
  const auto model = bake_part(part, cells, 12);
  Laid laid{.bodies = {}, .begin = points_of(*model, face(part, 0.0)), .end = points_of(*model, face(part, 1.0))};
  for (int i = 0; i < parts; ++i) {
    const RigidTransform at = place_of(beam, static_cast<double>(i) / parts);
    const Vec3 origin = at * model->data().origin_in_input;
    laid.bodies.push_back(world.add_body(model, {.pose = {at.q, beam.from + origin},
                                                 .velocity = moves.first + moves.second.cross(origin),
                                                 .angular_velocity = moves.second}));
    first.frame.origin = beam.from + at.p;
    world.add_joint(to, laid.bodies.back(), first, i == 0 ? JointAttachment{} : JointAttachment{laid.end},
                    {laid.begin});
    to = laid.bodies.back();
    first = {.type = JointType::kFixed};
  }
  return laid;
}

Vec3 middle_of(const World& world, BodyId body, const std::vector<SurfacePoint>& face) {
  Vec3 sum = Vec3::Zero();
  for (const SurfacePoint& at : face) sum += world.position(body, at);
  return sum / static_cast<double>(face.size());
}

/// How a run's steps ended.
struct Ends {
  int failed = 0;
  double residual = 0.0;  // ConstraintReport's largest
  void step(World& world) {
    world.step();
    failed += world.constraint_report().solved ? 0 : 1;
    residual = std::max(residual, world.constraint_report().residual);
  }
};

struct Pulled {
  Vec3 tip = Vec3::Zero();
  double seconds = 0.0, speed = 0.0;
  Ends ends;
};

/// Pulled at its end by a force that grows over half of the steps.
Pulled pull(const Beam& beam, int parts, int cells, const Vec3& force, int steps) {
  const double start = thread_seconds();
  NoContacts none;
  World world({.step = beam.step, .gravity = Vec3::Zero()});
  world.set_contact_source(&none, exactly());
  const Laid laid = lay(world, beam, parts, cells, {}, {.type = JointType::kFixed});
  const double share = 1.0 / static_cast<double>(laid.end.size());
  Pulled seen;
  for (int i = 0; i < steps; ++i) {
    const double part_of_force = std::min(1.0, 2.0 * (i + 1) / steps);
    for (const SurfacePoint& at : laid.end) world.apply_force(laid.bodies.back(), at, part_of_force * share * force);
    seen.ends.step(world);
  }
  seen.tip = middle_of(world, laid.bodies.back(), laid.end);
  for (const SurfacePoint& at : laid.end)
    seen.speed = std::max(seen.speed, world.velocity(laid.bodies.back(), at).norm());
  seen.seconds = thread_seconds() - start;
  return seen;
}

/// The 45° bend of Bathe and Bolourchi (1979), pulled out of its plane.
void bend() {
  const Beam beam{.length = 25.0 * std::numbers::pi,
                  .width = 1.0,
                  .height = 1.0,
                  .angle = 0.25 * std::numbers::pi,
                  .material = {.youngs_modulus = 1e7, .poisson_ratio = 0.0, .density = 1.0},
                  .damping = 2.0,
                  .step = 0.2};
  const Vec3 published(47.2, 15.9, 53.4);  // of the tip, in the axes here, under 600
  std::printf(
      "| 45 degree bend, parts | tip | off / way of the tip | speed left | steps not solved | largest residual | "
      "seconds "
      "|\n|---|---|---|---|---|---|---|\n");
  for (const auto& [parts, cells] : {std::pair(4, 10), {8, 6}, {16, 4}}) {
    const Pulled seen = pull(beam, parts, cells, {0.0, 0.0, 600.0}, 500);
    std::printf("| %d | %.2f, %.2f, %.2f | %.2f %% | %.0e | %d | %.1e | %.1f |\n", parts, seen.tip.x(), seen.tip.y(),
                seen.tip.z(), 100.0 * (seen.tip - published).norm() / (published - place_of(beam, 1.0).p).norm(),
                seen.speed, seen.ends.failed, seen.ends.residual, seen.seconds);
    std::fflush(stdout);
  }
}

/// Where the end of an elastica of unit length goes whose end is pulled across by F L²/(E I): θ'' = −load cos θ, θ(0) =
/// 0, θ'(1) = 0. By shooting.
Vec3 elastica(double load) {
  Vec3 end;
  const auto bend_left = [&](double curvature) {
    constexpr int kSteps = 4000;
    constexpr double h = 1.0 / kSteps;
    double theta = 0.0, rate = curvature;
    end.setZero();
    for (int i = 0; i < kSteps; ++i) {  // leapfrog
      rate -= 0.5 * h * load * std::cos(theta);
      end += h * Vec3(std::cos(theta + 0.5 * h * rate), 0.0, std::sin(theta + 0.5 * h * rate));
      theta += h * rate;
      rate -= 0.5 * h * load * std::cos(theta);
    }
    return rate;
  };
  double low = 0.0, high = load;
  for (int i = 0; i < 50; ++i) (bend_left(0.5 * (low + high)) < 0.0 ? low : high) = 0.5 * (low + high);
  return end;
}

/// The beam of Princeton (Dowell and Traybar, 1975), pulled along its thin side.
void princeton() {
  const Beam beam{.length = 0.508,
                  .width = 12.377e-3,
                  .height = 3.2024e-3,
                  .material = {.youngs_modulus = 71.7e9, .poisson_ratio = 0.31, .density = 2700.0},
                  .damping = 0.02,
                  .step = 2e-3};
  const double EI = beam.material.youngs_modulus * beam.width * std::pow(beam.height, 3) / 12.0;
  std::printf(
      "| Princeton beam, parts | N | end moves across, m | elastica | off | speed left | steps not solved | largest "
      "residual | "
      "seconds |\n|---|---|---|---|---|---|---|---|---|\n");
  for (const auto& [parts, cells] : {std::pair(4, 10), {8, 6}, {16, 4}})
    for (const double force : {4.448, 8.896, 13.345}) {
      const Vec3 law = beam.length * elastica(force * beam.length * beam.length / EI);
      const Pulled seen = pull(beam, parts, cells, {0.0, 0.0, force}, 400);
      std::printf("| %d | %.3f | %.5f | %.5f | %.2f %% | %.0e | %d | %.1e | %.1f |\n", parts, force, seen.tip.z(),
                  law.z(), 100.0 * (seen.tip - law).norm() / law.z(), seen.speed, seen.ends.failed, seen.ends.residual,
                  seen.seconds);
      std::fflush(stdout);
    }
}

/// A deflection beside what the second route gives, over a run.
struct Beside {
  double most = 0.0, expected = 0.0, off = 0.0;
  void add(double seen, double other) {
    most = std::max(most, std::abs(seen)), expected = std::max(expected, std::abs(other));
    off = std::max(off, std::abs(seen - other));
  }
};

JointSpec hinge_about_z() {
  JointSpec spec{.type = JointType::kRevolute};
  spec.frame.axes.col(0) = Vec3::UnitZ(), spec.frame.axes.col(1) = Vec3::UnitX(),
  spec.frame.axes.col(2) = Vec3::UnitY();
  return spec;
}

/// The spin-up of Simo and Vu-Quoc (1986): a motor turns the beam's hinge up to 6 rad/s in 15 s. It stays behind, and
/// in the end is longer by tan(k)/k − 1 of its length, k² = ρ ω² L²/E, where they print 5.14e-4 m.
/// A step is to take less than half a period of the parts' first mode: beyond that modes go along with what holds them
/// at rest (docs/derivations/constraints.md), and the beam swings no more.
void spin() {
  constexpr double kSpeed = 6.0, kTime = 15.0, kUntil = 20.0, kRound = 2.0 * std::numbers::pi / kTime, kFine = 5e-4;
  constexpr int kSegments = 24;
  const auto angle = [&](double t) {
    return t < kTime ? kSpeed / kTime * (0.5 * t * t + (std::cos(kRound * t) - 1.0) / (kRound * kRound))
                     : kSpeed * (t - 0.5 * kTime);
  };
  std::printf(
      "| beam spun up, parts | step, s | most that its end is behind, m | second route | off at any time | longer in "
      "the end, m | law | steps not solved | largest residual | seconds "
      "|\n|---|---|---|---|---|---|---|---|---|---|\n");
  for (const auto& [parts, cells, step] : {std::tuple(4, 10, 0.02), {4, 10, 0.005}, {8, 6, 0.002}}) {
    const Beam beam{.length = 10.0,
                    .width = std::sqrt(0.006),
                    .height = std::sqrt(0.006),
                    .material = {.youngs_modulus = 2.8e7 / 0.006, .poisson_ratio = 0.0, .density = 200.0},
                    .step = step};
    const double k = kSpeed * beam.length * std::sqrt(beam.material.density / beam.material.youngs_modulus);
    NoContacts none;
    World world({.step = beam.step, .gravity = Vec3::Zero()});
    world.set_contact_source(&none, exactly());
    double seconds = -thread_seconds();
    const Laid laid = lay(world, beam, parts, cells, {}, hinge_about_z());
    std::vector<JointId> joints;
    world.list(joints);
    SegmentedRod rod(kSegments, beam.length, 1.2, 1.4e4);
    rod.clamped = true;
    Beside behind;
    Ends ends;
    double longer = 0.0;
    int counted = 0;
    const int finer = static_cast<int>(std::lround(step / kFine));
    for (int i = 0; i < static_cast<int>(std::lround(kUntil / step)); ++i) {
      const double t = i * step, next = t + step;
      world.set_joint_actuation(joints[0], 0,
                                {.motor_velocity = (angle(next) - angle(t)) / step, .motor_max_force = 1e6});
      ends.step(world);
      seconds += thread_seconds();
      for (int s = 0; s < finer; ++s)
        rod.step(t + s * kFine, kFine, [&](double at) { return SegmentedRod::Led{.direction = angle(at)}; });
      const Quaternion back = quaternion_from_rotation_vector(-angle(next) * Vec3::UnitZ());
      const Vec3 tip = back * middle_of(world, laid.bodies.back(), laid.end);
      behind.add(tip.y(), (back * rod.to(kSegments)).y());
      if (next > kTime) longer += tip.x() - beam.length, ++counted;
      seconds -= thread_seconds();
    }
    std::printf("| %d | %g | %.4f | %.4f | %.4f | %.3e | %.3e | %d | %.1e | %.1f |\n", parts, step, behind.most,
                behind.expected, behind.off, longer / counted, beam.length * (std::tan(k) / k - 1.0), ends.failed,
                ends.residual, seconds + thread_seconds());
    std::fflush(stdout);
  }
}

/// The slider–crank that Chu and Pan (1975) and others after them take: a crank of 0.1524 m led at 124.8 rad/s, a rod
/// of steel twice as long and 6.35 mm thick, straight at first, and a slider half as heavy as the rod.
struct SliderCrank {
  static constexpr double kCrank = 0.1524, kRod = 0.3048, kSpeed = 124.8, kThick = 6.35e-3, kE = 2.0684e11,
                          kDensity = 7890.0, kArea = 0.25 * std::numbers::pi * kThick * kThick,
                          kMass = kDensity * kArea, kSliderMass = 0.5 * kMass * kRod;

  /// @param step s
  SliderCrank(int parts, int cells, double step) : world({.step = step, .gravity = Vec3::Zero()}) {
    world.set_contact_source(&none, exactly());
    const BodyId crank = world.add_body(rigid(0.1), {.pose = {{}, {0.5 * kCrank, 0.0, 0.0}},
                                                     .velocity = {0.0, 0.5 * kCrank * kSpeed, 0.0},
                                                     .angular_velocity = {0.0, 0.0, kSpeed}});
    const JointId motor = world.add_joint(BodyId{}, crank, hinge_about_z());
    world.set_joint_actuation(motor, 0, {.motor_velocity = kSpeed, .motor_max_force = 1e6});
    // A square of the round one's mass, stiffness and radius of inertia.
    const double side = 0.5 * std::sqrt(3.0) * kThick, same = kArea / (side * side);
    const Beam beam{.length = kRod,
                    .width = side,
                    .height = side,
                    .material = {.youngs_modulus = kE * same, .poisson_ratio = 0.0, .density = kDensity * same},
                    .from = {kCrank, 0.0, 0.0}};
    rod = lay(world, beam, parts, cells, crank, hinge_about_z(),
              {{0.0, kCrank * kSpeed, 0.0}, {0.0, 0.0, -kCrank / kRod * kSpeed}});
    const Vec3 end(kCrank + kRod, 0.0, 0.0);
    const BodyId slider = world.add_body(rigid(kSliderMass), {.pose = {{}, end}});
    world.add_joint(BodyId{}, slider, {.type = JointType::kPrismatic, .frame = {.origin = end}});
    world.add_joint(rod.bodies.back(), slider, {.type = JointType::kBall, .frame = {.origin = end}}, {rod.end});
  }
  static std::shared_ptr<const ModalModel> rigid(double mass) {
    ModalModelData d = sample_model_data({.modes = 0});
    d.mass = mass, d.inertia = 1e-3 * mass * Mat3::Identity();
    return std::make_shared<const ModalModel>(std::move(d));
  }
  static SegmentedRod by_segments(int count) {
    SegmentedRod other(count, kRod, kMass, kE * std::numbers::pi * std::pow(kThick, 4) / 64.0);
    other.masses[count - 1] += kSliderMass;
    other.on_axis = true;
    other.rate.setConstant(-kCrank / kRod * kSpeed);
    return other;
  }
  static SegmentedRod::Led led(double t) {
    return {.acceleration = -kCrank * kSpeed * kSpeed * Eigen::Vector2d(std::cos(kSpeed * t), std::sin(kSpeed * t))};
  }
  static double aside(const Vec3& middle, const Vec3& end) {  // from the rod's start
    return Vec3::UnitZ().cross(end.normalized()).dot(middle);
  }
  /// How far the rod's middle is beside the line between its ends.
  double deflection() const {
    const Vec3 from = middle_of(world, rod.bodies[0], rod.begin);
    return aside(middle_of(world, rod.bodies[rod.bodies.size() / 2], rod.begin) - from,
                 middle_of(world, rod.bodies.back(), rod.end) - from);
  }

  NoContacts none;
  World world;
  Laid rod;
};

void crank() {
  using S = SliderCrank;
  constexpr int kSegments = 24;
  std::printf(
      "| slider-crank, parts of its rod | steps a turn | most that the rod's middle is aside / rod | second route | "
      "off "
      "at any time | steps not solved | largest residual | seconds |\n|---|---|---|---|---|---|---|---|\n");
  for (const auto& [parts, cells, steps] : {std::tuple(2, 10, 250), {2, 10, 1000}, {4, 6, 4000}}) {
    const double length = 2.0 * std::numbers::pi / S::kSpeed / steps;
    const int finer = 8000 / steps;
    double seconds = -thread_seconds();
    SliderCrank machine(parts, cells, length);
    SegmentedRod rod = S::by_segments(kSegments);
    Beside aside;
    Ends ends;
    for (int i = 0; i < 2 * steps; ++i) {
      ends.step(machine.world);
      const double seen = machine.deflection();
      seconds += thread_seconds();
      for (int s = 0; s < finer; ++s) rod.step((i * finer + s) * (length / finer), length / finer, S::led);
      aside.add(seen, S::aside(rod.to(kSegments / 2), rod.to(kSegments)));
      seconds -= thread_seconds();
    }
    std::printf("| %d | %d | %.5f | %.5f | %.5f | %d | %.1e | %.1f |\n", parts, steps, aside.most / S::kRod,
                aside.expected / S::kRod, aside.off / S::kRod, ends.failed, ends.residual, seconds + thread_seconds());
    std::fflush(stdout);
  }
}

}  // namespace
}  // namespace limber::testing

int main(int count, char** arguments) {
  using namespace limber::testing;
  return print_parts("joint_laws",
                     {{"tops", tops},
                      {"long", many_steps},
                      {"bend", bend},
                      {"princeton", princeton},
                      {"spin", spin},
                      {"crank", crank}},
                     count > 1 ? arguments[1] : "");
}
