// Joints at game quality (ContactSolver::kGame, 8 substeps, 60 steps a second): how long chains take, how far their
// joints open, and what the energy does. Prints Markdown.
// Usage: joint_chains [chains|ends|figures|grid]
// Times are without what the clock adds. Figures: docs/reports/benchmarks.md.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <tuple>
#include <vector>

#include "cpu_time.h"
#include "grounded_world.h"
#include "joint_parts.h"

namespace limber::testing {
namespace {

constexpr ContactOptions kGame{.solver = ContactSolver::kGame, .small_steps = {8}};

/// One that bends by as much under what is so many times heavier as it would under its own like.
std::shared_ptr<const ModalModel> link(int modes, double times) {
  const double stiffer = std::sqrt(times);
  return sample_model({.modes = modes, .lowest_hz = 30.0 * stiffer, .decay = 6.0 * stiffer});
}

std::shared_ptr<const ModalModel> heavy(double times) {
  ModalModelData d = sample_model_data({.modes = 0});
  d.mass *= times;
  d.inertia *= times;
  return std::make_shared<const ModalModel>(std::move(d));
}

struct Chain {
  std::vector<BodyId> bodies;
  std::vector<JointId> joints;
  double weight = 0.0;  // Σ m g, N
};

enum class Way { kLevel, kHung };

/// Links on ball joints from a hook, level or straight down; the last so many times as heavy.
Chain add_chain(World& world, int links, int modes, double times, Way way, double height) {
  const auto model = link(modes, times), last = times > 1.0 ? heavy(times) : model;
  const Vec3 along = way == Way::kLevel ? Vec3(Vec3::UnitX()) : Vec3(-Vec3::UnitZ());
  const Quaternion q =
      way == Way::kLevel ? Quaternion{} : quaternion_from_rotation_vector({0.0, 0.5 * std::numbers::pi, 0.0});
  Chain chain;
  BodyId before{};
  for (int i = 0; i < links; ++i) {
    const Vec3 start = Vec3(0.0, 0.0, height) + i * kSampleSize * along;
    const auto& of = i + 1 < links ? model : last;
    const BodyId next = world.add_body(of, {.pose = {q, start + 0.5 * kSampleSize * along}});
    chain.joints.push_back(world.add_joint(before, next, {.type = JointType::kBall, .frame = {.origin = start}},
                                           {.radius = 0.25}, {.radius = 0.25}));
    chain.bodies.push_back(next);
    chain.weight += of->data().mass * kGravity;
    before = next;
  }
  return chain;
}

struct Seen {
  std::vector<double> seconds;
  double apart = 0.0, rise = -1e30, energy = 0.0;  // energy: the last less the first
  double at(double part) const {
    std::vector<double> sorted = seconds;
    std::ranges::sort(sorted);
    return sorted[static_cast<std::size_t>(part * static_cast<double>(sorted.size() - 1))];
  }
};

Seen watch(World& world, const Chain& chain, int steps) {
  Seen seen;
  const double first = total_energy(world, chain.bodies);
  const double clock = clock_seconds();
  double before = first;
  for (int i = 0; i < steps; ++i) {
    const double start = thread_seconds();
    world.step();
    seen.seconds.push_back(thread_seconds() - start - clock);
    for (const JointId joint : chain.joints) seen.apart = std::max(seen.apart, world.joint(joint).distance_error);
    const double now = total_energy(world, chain.bodies);
    seen.rise = std::max(seen.rise, now - before);
    before = now;
  }
  seen.energy = before - first;
  return seen;
}

void chains() {
  std::printf(
      "| links | modes | us a link and step: p50 | p99 | opening / size | largest rise in a step / Σ m g size | energy "
      "after / Σ m g size |\n|---|---|---|---|---|---|---|\n");
  for (const int modes : {0, 10, 20}) {
    double least = 0.0, most = 0.0;
    for (const int links : {4, 10, 32, 100, 316, 1000}) {
      NoContacts none;
      World world;
      world.set_contact_source(&none, kGame);
      const Chain chain = add_chain(world, links, modes, 1.0, Way::kLevel, 0.0);
      const Seen seen = watch(world, chain, std::clamp(30'000 / links, 60, 600));
      const double n = links, scale = chain.weight * kSampleSize;
      (links == 4 ? least : most) = seen.at(0.5);
      std::printf("| %d | %d | %.2f | %.2f | %.1e | %.1e | %.1e |\n", links, modes, 1e6 * seen.at(0.5) / n,
                  1e6 * seen.at(0.99) / n, seen.apart / kSampleSize, seen.rise / scale, seen.energy / scale);
      std::fflush(stdout);
    }
    std::printf("\nSlope of time over links with %d modes, 4 to 1,000: %.2f\n\n", modes,
                std::log(most / least) / std::log(250.0));
  }
}

/// Ten links, the last so many times as heavy: hung at rest, let go level in the air, and let go level so low that it
/// comes to drag on the ground.
void ends() {
  std::printf(
      "| chain of ten | its end times as heavy | modes | us a step: p50 | opening / size | sag / length | largest rise "
      "/ "
      "Σ m g size | energy after |\n|---|---|---|---|---|---|---|---|\n");
  for (const double times : {1.0, 100.0, 1e4})
    for (const int modes : {0, 10})
      for (const auto& [name, way, height] : {std::tuple("hung", Way::kHung, 8.0),
                                              {"in the air", Way::kLevel, 8.0},
                                              {"on the ground", Way::kLevel, 3.0}}) {
        GroundedWorld scene(kGame);
        World& world = scene.world;
        const Chain chain = add_chain(world, 10, modes, times, way, height);
        const double at = world.body(chain.bodies.back()).pose.p.z();
        const Seen seen = watch(world, chain, 300);
        const double sag = at - world.body(chain.bodies.back()).pose.p.z(), scale = chain.weight * kSampleSize;
        std::printf("| %s | %g | %d | %.0f | %.1e | ", name, times, modes, 1e6 * seen.at(0.5),
                    seen.apart / kSampleSize);
        if (way == Way::kHung)
          std::printf("%.1e | ", sag / (10.0 * kSampleSize));
        else
          std::printf("| ");
        std::printf("%.1e | %.1e |\n", seen.rise / scale, seen.energy / scale);
        std::fflush(stdout);
      }
}

/// Ten boxes as a figure: hinges at knees and elbows, balls with cones at hips, shoulders and neck. It falls turned at
/// random.
struct Figure : Chain {
  Figure(World& world, const RigidTransform& place) {
    const BodyId trunk = add(world, place, {0.0, 0.0, 0.0}, {0.15, 0.1, 0.3});
    ball(world, place, trunk, add(world, place, {0.0, 0.0, 0.45}, {0.08, 0.08, 0.1}), {0.0, 0.0, 0.32}, Vec3::UnitZ());
    for (const double side : {-1.0, 1.0}) {
      const BodyId thigh = add(world, place, {0.1 * side, 0.0, -0.55}, {0.07, 0.07, 0.2}),
                   shin = add(world, place, {0.1 * side, 0.0, -1.0}, {0.05, 0.05, 0.2}),
                   upper = add(world, place, {0.35 * side, 0.0, 0.2}, {0.15, 0.05, 0.05}),
                   lower = add(world, place, {0.7 * side, 0.0, 0.2}, {0.15, 0.04, 0.04});
      ball(world, place, trunk, thigh, {0.1 * side, 0.0, -0.33}, -Vec3::UnitZ());
      hinge(world, place, thigh, shin, {0.1 * side, 0.0, -0.77}, Vec3::UnitX());
      ball(world, place, trunk, upper, {0.18 * side, 0.0, 0.2}, side * Vec3::UnitX());
      hinge(world, place, upper, lower, {0.52 * side, 0.0, 0.2}, Vec3::UnitZ());
    }
  }
  BodyId add(World& world, const RigidTransform& place, const Vec3& at, const Vec3& half_extent) {
    bodies.push_back(
        world.add_body(sample_model({.modes = 0, .half_extent = half_extent}), {.pose = {place.q, place * at}}));
    return bodies.back();
  }
  static JointSpec spec(const RigidTransform& place, JointType type, const Vec3& at, const Vec3& axis) {
    JointSpec joint{.type = type, .frame = {.origin = place * at}};
    const Vec3 x = axis.normalized(), y = x.unitOrthogonal();
    joint.frame.axes.col(0) = place.q * x, joint.frame.axes.col(1) = place.q * y,
    joint.frame.axes.col(2) = place.q * x.cross(y);
    return joint;
  }
  void ball(World& world, const RigidTransform& place, BodyId a, BodyId b, const Vec3& at, const Vec3& axis) {
    JointSpec joint = spec(place, JointType::kBall, at, axis);
    joint.limits.cone = kCone;
    cones.push_back(world.add_joint(a, b, joint));
    tips.push_back({a, b, world.body(a).pose.q.conjugate() * joint.frame.axes.col(0)});
    joints.push_back(cones.back());
  }
  void hinge(World& world, const RigidTransform& place, BodyId a, BodyId b, const Vec3& at, const Vec3& axis) {
    JointSpec joint = spec(place, JointType::kRevolute, at, axis);
    joint.limits.rotation = {-0.1, kBend};
    hinges.push_back(world.add_joint(a, b, joint));
    joints.push_back(hinges.back());
  }
  /// By how much a limit is passed, rad.
  double passed(const World& world) const {
    double most = 0.0;
    for (const JointId joint : hinges) {
      const double angle = world.joint(joint).position[0];
      most = std::max({most, angle - kBend, -0.1 - angle});
    }
    for (const auto& [a, b, axis] : tips) {
      const Vec3 of_a = world.body(a).pose.q * axis, of_b = world.body(b).pose.q * axis;
      most = std::max(most, std::atan2(of_a.cross(of_b).norm(), of_a.dot(of_b)) - kCone);
    }
    return most;
  }
  static constexpr double kCone = 0.8, kBend = 2.0;  // rad
  std::vector<JointId> cones, hinges;
  std::vector<std::tuple<BodyId, BodyId, Vec3>> tips;
};

/// What was seen of figures over all their steps.
struct Falls {
  Seen seen;
  std::vector<double> passed;  // degrees
  int failed = 0;
  void watch(World& world, const std::vector<Figure>& figures, int steps) {
    for (int i = 0; i < steps; ++i) {
      const double start = thread_seconds();
      world.step();
      seen.seconds.push_back((thread_seconds() - start) / static_cast<double>(figures.size()));
      double most = 0.0;
      for (const Figure& figure : figures) {
        most = std::max(most, figure.passed(world));
        for (const JointId joint : figure.joints) seen.apart = std::max(seen.apart, world.joint(joint).distance_error);
      }
      passed.push_back(most * 180.0 / std::numbers::pi);
      failed += world.constraint_report().solved ? 0 : 1;
    }
  }
  void print(const char* name) {
    std::ranges::sort(passed);
    std::printf("| %s | %.3f | %.3f | %.2f | %.2f | %.1e | %d of %zu |\n", name, 1e3 * seen.at(0.5),
                1e3 * seen.at(0.99), passed[passed.size() * 99 / 100], passed.back(), seen.apart, failed,
                passed.size());
  }
};

void figures() {
  std::printf(
      "| figures | ms a step and figure: p50 | p99 | limits passed, degrees: p99 of steps | most | opening, m | steps "
      "not solved |\n|---|---|---|---|---|---|---|\n");
  std::mt19937 numbers(1);
  std::normal_distribution<double> normal;
  const auto any = [&] { return normalized({normal(numbers), normal(numbers), normal(numbers), normal(numbers)}); };
  Falls alone, together;
  for (int fall = 0; fall < 100; ++fall) {
    GroundedWorld scene(kGame);
    alone.watch(scene.world, {Figure(scene.world, {any(), {0.0, 0.0, 2.0}})}, 180);
  }
  alone.print("100, one by one");
  GroundedWorld scene(kGame);
  std::vector<Figure> heap;
  for (int i = 0; i < 20; ++i) heap.emplace_back(scene.world, RigidTransform{any(), {0.0, 0.0, 2.0 + 2.5 * i}});
  together.watch(scene.world, heap, 360);
  together.print("20, on each other");
}

/// Balls on a square grid, joined to their neighbours and hung by one edge's corners.
void grid() {
  std::printf("| balls | joints | ms a step: p50 | p99 | opening / size | moved, m |\n|---|---|---|---|---|---|\n");
  for (const int n : {10, 30, 100}) {
    NoContacts none;
    World world;
    world.set_contact_source(&none, kGame);
    const auto model = sample_model({.modes = 0, .half_extent = {0.4, 0.4, 0.4}});
    Chain chain;
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) {
        const Vec3 p(1.0 * i, 0.0, -1.0 * j);
        chain.bodies.push_back(world.add_body(model, {.pose = {{}, p}}));
        const auto at = [&](int k, int l) { return chain.bodies[static_cast<std::size_t>(n * k + l)]; };
        const auto join = [&](BodyId a, const Vec3& origin) {
          chain.joints.push_back(
              world.add_joint(a, chain.bodies.back(), {.type = JointType::kBall, .frame = {.origin = origin}}));
        };
        if (j == 0 && (i == 0 || i == n - 1 || i % 10 == 0)) join(BodyId{}, p);
        if (i > 0) join(at(i - 1, j), p - Vec3(0.5, 0.0, 0.0));
        if (j > 0) join(at(i, j - 1), p + Vec3(0.0, 0.0, 0.5));
      }
    const double before = world.body(chain.bodies.back()).pose.p.z();
    const Seen seen = watch(world, chain, n < 100 ? 120 : 12);
    std::printf("| %d | %zu | %.2f | %.2f | %.1e | %.1e |\n", n * n, chain.joints.size(), 1e3 * seen.at(0.5),
                1e3 * seen.at(0.99), seen.apart, before - world.body(chain.bodies.back()).pose.p.z());
    std::fflush(stdout);
  }
}

}  // namespace
}  // namespace limber::testing

int main(int count, char** arguments) {
  using namespace limber::testing;
  return print_parts("joint_chains", {{"chains", chains}, {"ends", ends}, {"figures", figures}, {"grid", grid}},
                     count > 1 ? arguments[1] : "");
}
