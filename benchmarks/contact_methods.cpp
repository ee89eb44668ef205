// The four contact methods in the same scenes, from World: what each lets overlap, how still it comes to rest, how much
// energy it adds, what it costs, and how its linear programs compare with the complementary answer. Overlap is that at
// the steps' ends: of vertices with the ground and with the boxes of other bodies, counted without the finder; and by
// the finder's contacts between bodies, all of them, edges that cross included. Prints Markdown.
// Figures: docs/reports/contact.md.
#include <Eigen/Geometry>
#include <algorithm>
#include <cstdio>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "bar_model.h"
#include "cpu_time.h"
#include "grounded_world.h"
#include "overlap.h"
#include "sample_models.h"

namespace limber::testing {
namespace {

constexpr double kStep = 1.0 / 60.0;
constexpr int kSteps = 300;

struct Scene {
  const char* name;
  double size;  // m
  void (*fill)(World& world, std::vector<BodyId>& bodies);
};

std::shared_ptr<const ModalModel> box(int modes) {
  const double hz = 30.0;
  return sample_model({.modes = modes, .lowest_hz = hz, .decay = 0.03 * 2.0 * std::numbers::pi * hz});
}

void fill_bar(World& world, std::vector<BodyId>& bodies) {
  ModalModelData bar = bar_data(20, false);
  for (std::size_t i = 0; i < bar.decays.size(); ++i) bar.decays[i] = 0.03 * std::sqrt(bar.eigenvalues[0]);
  for (double& lambda : bar.eigenvalues) lambda *= 1e4;
  const Quaternion upright = quaternion_from_rotation_vector({0.0, -0.5 * std::numbers::pi + 0.1, 0.0});
  bodies.push_back(
      world.add_body(std::make_shared<const ModalModel>(std::move(bar)), {.pose = {upright, {0, 0, 0.8}}}));
}
void fill_box(World& world, std::vector<BodyId>& bodies) {
  bodies.push_back(world.add_body(box(12), {.pose = {quaternion_from_rotation_vector({0.3, 0.2, 0.1}), {0, 0, 0.6}}}));
}
void fill_stack(World& world, std::vector<BodyId>& bodies) {
  const auto model = box(0);
  for (int i = 0; i < 3; ++i)
    bodies.push_back(world.add_body(
        model, {.pose = {quaternion_from_rotation_vector({0.0, 0.0, 0.05 * i}),
                         {0.02 * (i % 2), 0.015 * i, depth_below_origin(*model) + 1e-5 + 0.20001 * i}}}));
}
/// Bodies start farther apart than their diagonals: what overlaps at first is no method's doing.
void fill_pile(World& world, std::vector<BodyId>& bodies) {
  constexpr double kApart = 0.76;
  const auto rigid = box(0), soft = box(8);
  for (int i = 0; i < 8; ++i)
    bodies.push_back(
        world.add_body(i % 2 == 0 ? rigid : soft, {.pose = {quaternion_from_rotation_vector({0.3 * i, 0.2, 0.5 * i}),
                                                            {0.1 * (i % 3), 0.07 * (i % 2), 0.5 + kApart * i}}}));
}

constexpr Scene kScenes[] = {{"falling bar", 1.0, fill_bar},
                             {"falling box", 0.6, fill_box},
                             {"stack of three", 0.6, fill_stack},
                             {"pile of eight", 0.6, fill_pile}};

struct Rule {
  const char* name;
  ContactRule rule;
};
constexpr Rule kRules[] = {
    {"penalty", {.method = ContactMethod::kPenalty}},
    {"velocity program, as it is", {.method = ContactMethod::kVelocityProgram, .guard = ProgramGuard::kNone}},
    {"velocity program, clamped", {.method = ContactMethod::kVelocityProgram, .guard = ProgramGuard::kClamp}},
    {"gap program, as it is", {.method = ContactMethod::kGapProgram, .guard = ProgramGuard::kNone}},
    {"gap program, clamped", {.method = ContactMethod::kGapProgram, .guard = ProgramGuard::kClamp}},
    {"complementary, heuristic friction", {.friction = FrictionModel::kHeuristic}},
    {"complementary, heuristic and no slip", {.friction = FrictionModel::kHeuristicNoSlip}},
    {"complementary, cone", {}},
};

/// How deep vertices lie within the boxes of other bodies (their rest shape), by the nearest face, m.
double deepest_vertex(const World& world, const std::vector<BodyId>& bodies) {
  double deepest = 0.0;
  for (const BodyId a : bodies) {
    std::vector<float> x(3 * static_cast<std::size_t>(world.model(a).render().vertices()));
    world.reconstruct(a, x, {});
    for (const BodyId b : bodies) {
      if (a == b) continue;
      Eigen::AlignedBox3d box;
      for (const auto& rest : world.model(b).collision().rest) box.extend(Eigen::Vector3d(rest.cast<double>()));
      const RigidTransform X_BW = world.body(b).pose.inverse();
      for (std::size_t v = 0; v < x.size(); v += 3) {
        const Vec3 p = X_BW * Vec3(x[v], x[v + 1], x[v + 2]);
        deepest = std::max(deepest, std::min((p - box.min()).minCoeff(), (box.max() - p).minCoeff()));
      }
    }
  }
  return deepest;
}

void run(const Scene& scene, const Rule& rule) {
  GroundedWorld grounded({.recovery_speed = 0.0, .rule = rule.rule}, {.step = kStep});
  World& world = grounded.world;
  std::vector<BodyId> bodies;
  scene.fill(world, bodies);
  Overlap overlap(world, bodies, grounded.ground);
  double ground = 0.0, between = 0.0, by_contacts = 0.0;
  double mass = 0.0, start = 0.0, before = 0.0, rise = 0.0, seconds = 0.0, fastest = 0.0;
  for (const BodyId id : bodies) mass += world.model(id).data().mass;
  start = before = total_energy(world, bodies);
  const double scale = std::max(mass * kGravity * scene.size, start);
  ProgramReport programs;
  int unsolved = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double begin = thread_seconds();
    world.step();
    seconds += thread_seconds() - begin;
    const ConstraintReport report = world.constraint_report();
    programs.add(report.programs);
    unsolved += report.solved ? 0 : 1;
    const double now = total_energy(world, bodies);
    rise = std::max(rise, (now - before) / scale);
    before = now;
    between = std::max(between, deepest_vertex(world, bodies));
    by_contacts = std::max(by_contacts, overlap.deepest().between);
    for (const BodyId id : bodies) {
      ground = std::max(ground, -lowest(world, id));
      if (i >= kSteps - 30) fastest = std::max(fastest, world.body(id).velocity.norm());
    }
  }
  std::printf("| %s | %s | %.1e | %.1e | %.1e | %.1e | %.1e | %.0f | %d | %ld | %ld | %ld | %ld | %.1e |\n", scene.name,
              rule.name, ground / scene.size, between / scene.size, by_contacts / scene.size, fastest, rise,
              1e6 * seconds / kSteps, unsolved, programs.guard.solves, programs.different, programs.guard.clamped,
              programs.relaxed, programs.guard.energy_refused / scale);
}

}  // namespace
}  // namespace limber::testing

int main() {
  using namespace limber::testing;
  std::printf(
      "| scene | method | deepest in the ground / size | vertex in another body / size | contact between bodies / size "
      "| fastest in the last half second, m/s "
      "| largest rise of energy in a step / "
      "scale | µs a step | steps "
      "not settled of 300 | programs | other energy | adding energy | relaxed | energy refused / scale |\n");
  std::printf("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (const Scene& scene : kScenes)
    for (const Rule& rule : kRules) run(scene, rule);
  return 0;
}
