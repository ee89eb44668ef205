#include "scene_cost.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "counted_new.h"
#include "cpu_time.h"
#include "limber/collision/contact_finder.h"
#include "limber/collision/manifold_finder.h"
#include "limber/scene/scene_player.h"
#include "touched_pages.h"

namespace limber::tools {
namespace {

double wall_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// Arrays for all that is drawn.
struct DrawnBodies {
  std::vector<float> positions, normals;
  std::vector<DrawTarget> bare, lit;

  explicit DrawnBodies(const ScenePlayer& player) {
    std::size_t floats = 0;
    for (const BodyId id : player.bodies()) floats += floats_of(player, id);
    positions.resize(floats), normals.resize(floats);
    std::size_t first = 0;
    for (const BodyId id : player.bodies()) {
      const std::size_t count = floats_of(player, id);
      bare.push_back({.id = id, .positions = std::span(positions).subspan(first, count)});
      lit.push_back(bare.back());
      lit.back().normals = std::span(normals).subspan(first, count);
      first += count;
    }
  }
  static std::size_t floats_of(const ScenePlayer& player, BodyId id) {
    return 3 * static_cast<std::size_t>(player.world().model(id).render().vertices());
  }
};

Scene with(const ContactChoice& choice, Scene scene) {
  if (!scene.contacts.options) return scene;
  if (choice.solver) scene.contacts.solver = *choice.solver;
  if (choice.substeps > 0) scene.contacts.small_steps.substeps = choice.substeps;
  scene.contacts.options->solver = scene.contacts.solver;
  scene.contacts.options->small_steps = scene.contacts.small_steps;
  return scene;
}

class Measurement {
 public:
  Measurement(const TimedScene& timed, const CostOptions& options)
      : timed_(timed),
        options_(options),
        finder_(options.contact.make_finder()),
        scene_(with(options.contact, timed.scene)),
        player_(scene_, timed.models, scene_.steps, options.jobs ? *options.jobs : serial_jobs()),
        drawn_(player_) {
    if (finder_ && scene_.contacts.options) player_.world().set_contact_source(finder_.get(), *scene_.contacts.options);
    cost_.scene = timed.name;
    cost_.size.bodies = player_.bodies().size();
    cost_.size.vertices = static_cast<Index>(drawn_.positions.size() / 3);
    for (const BodyId id : player_.bodies())
      cost_.size.modes = std::max(cost_.size.modes, player_.world().model(id).modes());
    cost_.size.step = timed.scene.step;
    const auto left = static_cast<int>(timed.scene.steps) - timed.settling;
    cost_.size.steps = options.steps > 0 ? std::min(options.steps, left) : left;
  }

  SceneCost run() {
    for (auto* seconds : {&cost_.step_seconds, &cost_.position_seconds, &cost_.draw_seconds})
      seconds->reserve(static_cast<std::size_t>(cost_.size.steps));
    for (int n = 0; n < timed_.settling; ++n) player_.step();
    if (options_.rehearse) rehearse();
    long before = 0;
    for (int n = 0; n < cost_.size.steps; ++n) {
      if (n == cost_.size.steps / 2) before = testing::allocations();
      take_step();
      if (options_.draw) draw();
    }
    cost_.allocations =
        static_cast<double>(testing::allocations() - before) / (cost_.size.steps - cost_.size.steps / 2);
    const double steps = cost_.size.steps;
    cost_.work.contacts = static_cast<double>(cost_.stages[Stage::kNarrowPhase].units) / steps;
    cost_.work.rows = static_cast<double>(cost_.stages[Stage::kSolve].units) / steps;
    cost_.work.iterations /= steps, cost_.work.newton_steps /= steps;
    for (const BodyId id : player_.bodies()) cost_.work.asleep += player_.world().is_asleep(id) ? 1 : 0;
    count_bytes();
    return std::move(cost_);
  }

 private:
  double now() const { return options_.jobs ? wall_seconds() : thread_seconds(); }

  template <class Work>
  void time(std::vector<double>& seconds, const Work& work) {
    const double began = now();
    work();
    seconds.push_back(now() - began);
  }

  void rehearse() {
    std::vector<std::byte> state;
    player_.save_state(state);
    for (int n = 0; n < cost_.size.steps; ++n) player_.step();
    player_.restore_state(state);
  }

  void take_step() {
    World& world = player_.world();
    player_.begin_step();
    world.set_stage_times(&cost_.stages);
    time(cost_.step_seconds, [&] { world.step(); });
    world.set_stage_times(nullptr);
    player_.end_step();
    const ConstraintReport report = world.constraint_report();
    cost_.work.iterations += report.iterations;
    cost_.work.newton_steps += report.newton_steps;
    cost_.work.unsettled += report.statuses.worst() == IslandStatus::kFailed ? 1 : 0;
  }

  void draw() {
    World& world = player_.world();
    time(cost_.position_seconds, [&] { world.reconstruct(drawn_.bare); });
    world.set_stage_times(&cost_.stages);
    time(cost_.draw_seconds, [&] { world.reconstruct(drawn_.lit); });
    world.set_stage_times(nullptr);
  }

  void count_bytes() {
    player_.begin_step();
    cost_.step_bytes = touched_bytes([&] { player_.world().step(); });
    player_.end_step();
    if (options_.draw) cost_.draw_bytes = touched_bytes([&] { player_.world().reconstruct(drawn_.lit); });
  }

  const TimedScene& timed_;
  const CostOptions& options_;
  const std::unique_ptr<ContactSource> finder_;  // null: the scene's
  const Scene scene_;
  ScenePlayer player_;
  DrawnBodies drawn_;
  SceneCost cost_;
};

}  // namespace

std::unique_ptr<ContactSource> ContactChoice::make_finder() const {
  switch (finder) {
    case Finder::kOfTheScene:
      break;
    case Finder::kContactFinder:
      return std::make_unique<ContactFinder>();
    case Finder::kManifolds:
      return std::make_unique<ManifoldFinder>();
  }
  return nullptr;
}

SceneCost measure(const TimedScene& timed, const CostOptions& options) { return Measurement(timed, options).run(); }

double cost_ratio(const TimedScene& first, const TimedScene& second, int steps) {
  ScenePlayer a(first.scene, first.models, first.scene.steps), b(second.scene, second.models, second.scene.steps);
  for (int n = 0; n < first.settling; ++n) a.step();
  for (int n = 0; n < second.settling; ++n) b.step();
  std::vector<double> of_a, of_b;
  const auto take = [](ScenePlayer& player, std::vector<double>& seconds) {
    player.begin_step();
    const double began = thread_seconds();
    player.world().step();
    seconds.push_back(thread_seconds() - began);
    player.end_step();
  };
  for (int n = 0; n < steps; ++n) take(a, of_a), take(b, of_b);
  return quantile(of_a, 0.5) / quantile(of_b, 0.5);
}

double quantile(std::vector<double> values, double q) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(std::lround(q * static_cast<double>(values.size() - 1)))];
}

}  // namespace limber::tools
