// A pile of bodies that is dropped into a pit: what a step costs on the way, and how still it lies. Prints Markdown,
// one row a second. Nine in ten bodies are rigid primitives (bricks, balls, capsules); every tenth flexes. Times of
// steps are the thread's own; depth is that of the contacts found at the steps' starts, in units of a body's size; the
// rise of energy in a step in units of Σ m g size.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string_view>
#include <vector>

#include "cpu_time.h"
#include "limber/collision/manifold_finder.h"
#include "pile.h"

namespace {

using namespace limber;

constexpr int kStepsOfSecond = 60;
constexpr const char* kUsage =
    "contact_pile [--solver game|exact] [--finder exact|manifolds] [--substeps n] [bodies] [seconds] [modes, -1: all "
    "rigid] [boxes | rolling "
    "friction]\n";

struct Arguments {
  ContactOptions options;
  int count = 100, seconds = 8, modes = 6;
  bool rolls = true, manifolds = false;
};

bool read_arguments(int argc, char** argv, Arguments& arguments) {
  int place = 0;
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    if (word == "--solver" || word == "--substeps" || word == "--finder") {
      if (++i == argc) return false;
      const std::string_view value = argv[i];
      if (word == "--finder" && (value == "exact" || value == "manifolds"))
        arguments.manifolds = value == "manifolds";
      else if (word == "--substeps")
        arguments.options.small_steps.substeps = std::atoi(argv[i]);
      else if (word == "--solver" && (value == "game" || value == "exact"))
        arguments.options.solver = value == "game" ? ContactSolver::kGame : ContactSolver::kExact;
      else
        return false;
      continue;
    }
    switch (place++) {
      case 0:
        arguments.count = std::atoi(argv[i]);
        break;
      case 1:
        arguments.seconds = std::atoi(argv[i]);
        break;
      case 2:
        arguments.modes = std::atoi(argv[i]);
        break;
      case 3:
        arguments.rolls = word != "boxes";
        if (arguments.rolls) arguments.options.rolling_friction = std::atof(argv[i]);
        break;
      default:
        return false;
    }
  }
  return arguments.count >= 1 && arguments.seconds >= 1 && arguments.modes >= -1 &&
         arguments.options.rolling_friction >= 0.0 && arguments.options.small_steps.substeps >= 1;
}

/// The time that a part of the steps does not exceed.
double quantile(std::vector<double> times, double part) {
  std::sort(times.begin(), times.end());
  return times[static_cast<std::size_t>(part * static_cast<double>(times.size() - 1) + 0.5)];
}

double energy_scale(const testing::Pile& pile) {
  double mass = 0.0;
  for (const BodyId id : pile.bodies) mass += pile.world.model(id).data().mass;
  return mass * testing::kGravity * testing::kPileSize;
}

void run_second(testing::Pile& pile, int second, std::vector<double>& all) {
  std::vector<Vec3> before;
  for (const BodyId id : pile.bodies) before.push_back(pile.world.body(id).pose.p);
  std::vector<double> times;
  StageTimes stages;
  pile.world.set_stage_times(&stages);
  double deepest = 0.0, moved = 0.0, rise = 0.0, residual = 0.0;
  double energy = testing::total_energy(pile.world, pile.bodies);
  int unsolved = 0;
  for (int i = 0; i < kStepsOfSecond; ++i) {
    const double begin = thread_seconds();
    pile.step_once();
    times.push_back(1e3 * (thread_seconds() - begin));
    deepest = std::max(deepest, -pile.deepest);
    const ConstraintReport report = pile.world.constraint_report();
    unsolved += report.solved ? 0 : 1;
    residual = std::max(residual, report.residual);
    const double now = testing::total_energy(pile.world, pile.bodies);
    rise = std::max(rise, now - energy);
    energy = now;
  }
  for (std::size_t i = 0; i < before.size(); ++i)
    moved = std::max(moved, (pile.world.body(pile.bodies[i]).pose.p - before[i]).norm());
  const auto seconds_of = [&](Stage stage) { return stages[stage].seconds; };
  std::printf("| %d | %.2f | %.2f | %.2f | %.0f %% | %.0f %% | %d | %d | %.1e | %.1e | %.1e | %.1e |\n", second,
              quantile(times, 0.5), quantile(times, 0.99), quantile(times, 1.0),
              100.0 * (seconds_of(Stage::kBroadPhase) + seconds_of(Stage::kNarrowPhase)) / stages.seconds(),
              100.0 * seconds_of(Stage::kSolve) / stages.seconds(), pile.contacts, unsolved, residual,
              deepest / testing::kPileSize, moved / testing::kPileSize, rise / energy_scale(pile));
  all.insert(all.end(), times.begin(), times.end());
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  if (!read_arguments(argc, argv, arguments)) {
    std::fprintf(stderr, "%s", kUsage);
    return 2;
  }
  testing::Pile pile(arguments.count, arguments.modes, arguments.rolls, arguments.options);
  ManifoldFinder manifolds;
  if (arguments.manifolds) pile.world.set_contact_source(&manifolds, arguments.options);
  const bool game = arguments.options.solver == ContactSolver::kGame;
  std::printf("%d bodies, %d of them flexible (%d modes); %s", arguments.count,
              arguments.modes < 0 ? 0 : arguments.count / 10, std::max(arguments.modes, 0), game ? "game" : "exact");
  if (game) std::printf(", %d substeps", arguments.options.small_steps.substeps);
  std::printf(
      "\n\n| second | ms a step, p50 | p99 | worst | finder | solver | contacts | steps not solved | residual | "
      "deepest "
      "/ size | farthest moved / size | largest rise of energy / scale |\n|---|---|---|---|---|---|---|---|---|---|---|"
      "---|\n");
  std::vector<double> all;
  for (int second = 1; second <= arguments.seconds; ++second) run_second(pile, second, all);
  std::printf("\nall %zu steps: p50 %.2f, p99 %.2f, worst %.2f ms\n", all.size(), quantile(all, 0.5),
              quantile(all, 0.99), quantile(all, 1.0));
  return 0;
}
