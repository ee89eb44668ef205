// Contact methods side by side in the same scenes, from World: limber's own, [H03]'s rules, FCL's contacts, normals
// from tetrahedra. What each lets overlap, how still it comes to rest, the energy it adds, its time, and how the linear
// programs compare with the complementary answer. Depths are those at the steps' ends: of vertices in the ground and in
// the boxes of other bodies, counted without the finder; and by all contacts between bodies, crossing edges included.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <Eigen/Geometry>
#include <algorithm>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "bar_model.h"
#include "benchmarks.h"
#include "cpu_time.h"
#include "grounded_world.h"
#include "limber/hauser/hauser_method.h"
#include "limber/tet_overlap/tet_overlap_normals.h"
#if LIMBER_HAS_FCL
#include "limber/collision_fcl/fcl_contact_source.h"
#endif
#include "overlap.h"
#include "program.h"
#include "sample_models.h"

namespace limber::tools {
namespace {

using Json = nlohmann::ordered_json;
using namespace testing;

constexpr double kStep = 1.0 / 60.0;

struct MethodScene {
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

const std::vector<MethodScene>& scenes() {
  static const std::vector<MethodScene> all{{"falling bar", 1.0, fill_bar},
                                            {"falling box", 0.6, fill_box},
                                            {"stack of three", 0.6, fill_stack},
                                            {"pile of eight", 0.6, fill_pile}};
  return all;
}

enum class Finder { kLimber, kTets, kFcl };
struct Method {
  const char* name;
  ContactRule rule{};
  Finder finder = Finder::kLimber;
};
const std::vector<Method>& methods() {
  static const std::vector<Method> all {
    {"penalty", {.method = ContactMethod::kPenalty}},
        {"velocity program, as it is", {.method = ContactMethod::kVelocityProgram, .guard = ProgramGuard::kNone}},
        {"velocity program, guarded", {.method = ContactMethod::kVelocityProgram, .guard = ProgramGuard::kClamp}},
        {"gap program, as it is", {.method = ContactMethod::kGapProgram, .guard = ProgramGuard::kNone}},
        {"gap program, guarded", {.method = ContactMethod::kGapProgram, .guard = ProgramGuard::kClamp}},
        {"complementary, heuristic friction", {.friction = FrictionModel::kHeuristic}},
        {"complementary, heuristic, no slip after", {.friction = FrictionModel::kHeuristicNoSlip}},
#if LIMBER_HAS_FCL
        {"limber's own, contacts by FCL", {}, Finder::kFcl},
#endif
        {"limber's own, normals from tetrahedra", {}, Finder::kTets}, {"limber's own", {}},
  };
  return all;
}

std::unique_ptr<ContactSource> make_finder(Finder finder) {
#if LIMBER_HAS_FCL
  if (finder == Finder::kFcl) return std::make_unique<FclContactSource>();
#endif
  if (finder == Finder::kTets)
    return std::make_unique<ContactFinder>(NarrowPhaseOptions{.normals = tet_overlap_normals});
  return std::make_unique<ContactFinder>();
}

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

/// Lengths by the size of the scene, energies by its scale.
struct Row {
  double ground = 0.0, between = 0.0, by_contacts = 0.0, fastest = 0.0, rise = 0.0, seconds = 0.0;
  int unsolved = 0;
  ProgramReport programs{};
};

Row measure(const MethodScene& scene, const Method& method, int steps) {
  const HauserMethod rule(method.rule);
  const std::unique_ptr<ContactSource> finder = make_finder(method.finder);
  World world({.step = kStep});
  world.set_island_solver(rule.islands());
  world.set_contact_source(finder.get(), rule.contacts({.recovery_speed = 0.0}));
  const BodyId ground = world.add_static(std::make_shared<Shape>(HalfSpace{}));
  std::vector<BodyId> bodies;
  scene.fill(world, bodies);
  Overlap overlap(world, bodies, ground);
  double mass = 0.0, before = total_energy(world, bodies);
  for (const BodyId id : bodies) mass += world.model(id).data().mass;
  const double scale = std::max(mass * kGravity * scene.size, before);
  Row row;
  for (int i = 0; i < steps; ++i) {
    const double begin = thread_seconds();
    world.step();
    row.seconds += (thread_seconds() - begin) / steps;
    row.unsolved += world.constraint_report().solved ? 0 : 1;
    const double now = total_energy(world, bodies);
    row.rise = std::max(row.rise, (now - before) / scale);
    before = now;
    row.between = std::max(row.between, deepest_vertex(world, bodies) / scene.size);
    row.by_contacts = std::max(row.by_contacts, overlap.deepest().between / scene.size);
    for (const BodyId id : bodies) {
      row.ground = std::max(row.ground, -lowest(world, id) / scene.size);
      if (i >= steps - 30) row.fastest = std::max(row.fastest, world.body(id).velocity.norm());
    }
  }
  row.programs = rule.programs();
  row.programs.guard.energy_refused /= scale;
  return row;
}

struct MethodsArguments {
  std::vector<std::string> scenes;
  int steps = 300;
};

void benchmark_methods(Program& program, const MethodsArguments& a) {
  Json& report = program.report();
  report["benchmark"] = "methods";
  report["rows"] = Json::array();
  program.print(
      "| scene | method | deepest in the ground / size | vertex in another body / size | contact between bodies / size "
      "| fastest in the last half second, m/s | largest rise of energy in a step / scale | µs a step | steps unsettled "
      "| programs | other energy | adding energy | relaxed | energy refused / scale |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (const MethodScene& scene : scenes()) {
    if (!a.scenes.empty() && std::ranges::find(a.scenes, scene.name) == a.scenes.end()) continue;
    for (const Method& method : methods()) {
      const Row r = measure(scene, method, a.steps);
      program.print(
          fmt::format("| {} | {} | {:.1e} | {:.1e} | {:.1e} | {:.1e} | {:.1e} | {:.0f} | {} | {} | {} | {} "
                      "| {} | {:.1e} |\n",
                      scene.name, method.name, r.ground, r.between, r.by_contacts, r.fastest, r.rise, 1e6 * r.seconds,
                      r.unsolved, r.programs.guard.solves, r.programs.different, r.programs.guard.clamped,
                      r.programs.relaxed, r.programs.guard.energy_refused));
      report["rows"].push_back({{"scene", scene.name},
                                {"method", method.name},
                                {"deepest_in_ground", r.ground},
                                {"vertex_in_body", r.between},
                                {"contact_between", r.by_contacts},
                                {"fastest_at_end", r.fastest},
                                {"largest_rise", r.rise},
                                {"unsettled", r.unsolved},
                                {"programs", r.programs.guard.solves},
                                {"programs_relaxed", r.programs.relaxed}});
      report["seconds"].push_back(r.seconds);
    }
  }
}

}  // namespace

std::function<void(Program&)> add_methods(CLI::App& programs) {
  const auto arguments = std::make_shared<MethodsArguments>();
  CLI::App* app =
      programs.add_subcommand("methods", "contact methods of the papers beside limber's own, scene by scene");
  std::vector<std::string> names;
  for (const MethodScene& scene : scenes()) names.emplace_back(scene.name);
  app->add_option("--scene", arguments->scenes, "these alone; the pile takes minutes")
      ->type_name("NAME,...")
      ->delimiter(',')
      ->check(CLI::IsMember(names));
  app->add_option("--steps", arguments->steps, "of 1/60 s")
      ->type_name("N")
      ->check(CLI::Range(30, 100'000))
      ->capture_default_str();
  return [arguments, app](Program& program) {
    if (app->parsed()) benchmark_methods(program, *arguments);
  };
}

}  // namespace limber::tools
