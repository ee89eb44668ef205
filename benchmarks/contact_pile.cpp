// A pile of bodies that is dropped into a pit: what a step costs on the way, and how still it lies. Prints Markdown,
// one row a second, with medians over falls whose starts differ by a millimetre. Nine in ten bodies are rigid
// primitives (bricks, balls, capsules); every tenth flexes. Times of steps are the thread's own; depth is that of the
// contacts found at the steps' starts, in units of a body's size; the rise of energy in a step in units of Σ m g size.
#include <algorithm>
#include <cmath>
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
    "contact_pile [--solver game|exact] [--finder exact|manifolds] [--substeps n] [--slop share] [--falls n] "
    "[--rehearse] [bodies] [seconds] [modes, -1: all rigid] [boxes | rolling friction]\n";

struct Arguments {
  ContactOptions options;
  int count = 100, seconds = 8, modes = 6, falls = 1;
  bool rolls = true, manifolds = false, rehearse = false;
};

bool read_arguments(int argc, char** argv, Arguments& arguments) {
  int place = 0;
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    if (word == "--rehearse") {
      arguments.rehearse = true;
      continue;
    }
    if (word.starts_with("--")) {
      if (++i == argc) return false;
      const std::string_view value = argv[i];
      if (word == "--finder" && (value == "exact" || value == "manifolds"))
        arguments.manifolds = value == "manifolds";
      else if (word == "--substeps")
        arguments.options.small_steps.substeps = std::atoi(argv[i]);
      else if (word == "--slop")
        arguments.options.small_steps.slop = std::atof(argv[i]);
      else if (word == "--falls")
        arguments.falls = std::atoi(argv[i]);
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
  return arguments.count >= 1 && arguments.seconds >= 1 && arguments.modes >= -1 && arguments.falls >= 1 &&
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

/// A second of one fall, in the order of the table's columns.
struct Second {
  std::vector<double> times{};  // of its steps, ms
  double finder = 0.0, solver = 0.0, contacts = 0.0, unsolved = 0.0, residual = 0.0;
  double deepest = 0.0, moved = 0.0, rise = 0.0;
};

Second run_second(testing::Pile& pile) {
  Second out;
  std::vector<Vec3> before;
  for (const BodyId id : pile.bodies) before.push_back(pile.world.body(id).pose.p);
  StageTimes stages;
  pile.world.set_stage_times(&stages);
  double energy = testing::total_energy(pile.world, pile.bodies);
  for (int i = 0; i < kStepsOfSecond; ++i) {
    const double begin = thread_seconds();
    pile.step_once();
    out.times.push_back(1e3 * (thread_seconds() - begin));
    out.deepest = std::max(out.deepest, -pile.deepest / testing::kPileSize);
    const ConstraintReport report = pile.world.constraint_report();
    out.unsolved += report.solved ? 0.0 : 1.0;
    out.residual = std::max(out.residual, report.residual);
    const double now = testing::total_energy(pile.world, pile.bodies);
    out.rise = std::max(out.rise, (now - energy) / energy_scale(pile));
    energy = now;
  }
  for (std::size_t i = 0; i < before.size(); ++i)
    out.moved = std::max(out.moved, (pile.world.body(pile.bodies[i]).pose.p - before[i]).norm() / testing::kPileSize);
  const auto share_of = [&](Stage stage) { return 100.0 * stages[stage].seconds / stages.seconds(); };
  out.finder = share_of(Stage::kBroadPhase) + share_of(Stage::kNarrowPhase);
  out.solver = share_of(Stage::kSolve);
  out.contacts = pile.contacts;
  return out;
}

/// Takes the steps of a fall and goes back to its start: the lists that grow on the way keep their memory.
void rehearse(testing::Pile& pile, int seconds) {
  std::vector<std::byte> state;
  pile.world.save_state(state);
  for (int i = 0; i < kStepsOfSecond * seconds; ++i) pile.step_once();
  pile.world.restore_state(state);
}

/// @param number of the fall: each body starts up to a millimetre from where it does in the first
std::vector<Second> fall(const Arguments& arguments, int number) {
  testing::Pile pile(arguments.count, arguments.modes, arguments.rolls, arguments.options);
  ManifoldFinder manifolds;
  if (arguments.manifolds) pile.world.set_contact_source(&manifolds, arguments.options);
  for (std::size_t i = 0; i < pile.bodies.size() && number > 0; ++i) {
    RigidTransform pose = pile.world.body(pile.bodies[i]).pose;
    const double phase = 1.7 * static_cast<double>(i) + 2.3 * number;
    pose.p += 1e-3 * Vec3(std::sin(phase), std::cos(1.3 * phase), std::sin(0.7 * phase));
    pile.world.set_pose(pile.bodies[i], pose);
  }
  if (arguments.rehearse) rehearse(pile, arguments.seconds);
  std::vector<Second> seconds;
  for (int second = 0; second < arguments.seconds; ++second) seconds.push_back(run_second(pile));
  return seconds;
}

void print_second(const std::vector<std::vector<Second>>& falls, std::size_t second, std::vector<double>& all) {
  std::vector<double> times;
  for (const std::vector<Second>& of : falls)
    times.insert(times.end(), of[second].times.begin(), of[second].times.end());
  const auto median = [&](double Second::*field) {
    std::vector<double> values;
    for (const std::vector<Second>& of : falls) values.push_back(of[second].*field);
    return quantile(values, 0.5);
  };
  std::printf("| %zu | %.2f | %.2f | %.2f | %.0f %% | %.0f %% | %.0f | %.0f | %.1e | %.1e | %.1e | %.1e |\n",
              second + 1, quantile(times, 0.5), quantile(times, 0.99), quantile(times, 1.0), median(&Second::finder),
              median(&Second::solver), median(&Second::contacts), median(&Second::unsolved), median(&Second::residual),
              median(&Second::deepest), median(&Second::moved), median(&Second::rise));
  all.insert(all.end(), times.begin(), times.end());
}

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  if (!read_arguments(argc, argv, arguments)) {
    std::fprintf(stderr, "%s", kUsage);
    return 2;
  }
  const bool game = arguments.options.solver == ContactSolver::kGame;
  std::printf("%d bodies, %d of them flexible (%d modes); %s", arguments.count,
              arguments.modes < 0 ? 0 : arguments.count / 10, std::max(arguments.modes, 0), game ? "game" : "exact");
  if (game) std::printf(", %d substeps", arguments.options.small_steps.substeps);
  std::printf(
      "\n\n| second | ms a step, p50 | p99 | worst | finder | solver | contacts | steps not solved | residual | "
      "deepest "
      "/ size | farthest moved / size | largest rise of energy / scale |\n|---|---|---|---|---|---|---|---|---|---|---|"
      "---|\n");
  std::vector<std::vector<Second>> falls;
  for (int number = 0; number < arguments.falls; ++number) falls.push_back(fall(arguments, number));
  std::vector<double> all;
  for (int second = 0; second < arguments.seconds; ++second) print_second(falls, static_cast<std::size_t>(second), all);
  std::printf("\nall %zu steps: p50 %.2f, p99 %.2f, worst %.2f ms\n", all.size(), quantile(all, 0.5),
              quantile(all, 0.99), quantile(all, 1.0));
  return 0;
}
