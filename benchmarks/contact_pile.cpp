// A pile of mixed bodies that is dropped into a pit: what a step costs on the way, and how still it lies. Prints
// Markdown, one row a second. Nine in ten bodies are rigid primitives (bricks, balls, capsules); every tenth flexes.
// Times of steps: by the wall clock, which a frame waits for, and by the thread's own work. Depth is that of the
// contacts that act, thinned, at the steps' starts.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string_view>
#include <vector>

#include "cpu_time.h"
#include "pile.h"

namespace {

constexpr int kStepsOfSecond = 60;

/// Times of steps, s.
struct StepTimes {
  std::vector<double> wall, cpu;

  template <class Step>
  void measure(const Step& step) {
    const auto begin = std::chrono::steady_clock::now();
    const double work = limber::thread_seconds();
    step();
    cpu.push_back(limber::thread_seconds() - work);
    wall.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
  }
  /// The time that a part of the steps does not exceed.
  static double quantile(std::vector<double> times, double part) {
    std::sort(times.begin(), times.end());
    const auto last = static_cast<double>(times.size() - 1);
    return times[static_cast<std::size_t>(part * last + 0.5)];
  }
};

void run_second(limber::testing::Pile& pile, int second, StepTimes& all) {
  using namespace limber;
  std::vector<Vec3> before;
  for (const BodyId id : pile.bodies) before.push_back(pile.world.body(id).pose.p);
  StepTimes times;
  double deepest = 0.0, shift = 0.0, rise = 0.0;
  double energy = testing::total_energy(pile.world, pile.bodies);
  int unsettled = 0, off = 0;
  double residual = 0.0;
  for (int i = 0; i < kStepsOfSecond; ++i) {
    times.measure([&] { pile.step_once(); });
    deepest = std::max(deepest, -pile.deepest);
    unsettled += pile.world.constraint_report().solved ? 0 : 1;
    const double left = 1e-9 * pile.world.constraint_report().residual;
    off += left > 1e-6 ? 1 : 0;
    residual = std::max(residual, left);
    const double now = testing::total_energy(pile.world, pile.bodies);
    rise = std::max(rise, now - energy);
    energy = now;
  }
  for (std::size_t i = 0; i < before.size(); ++i)
    shift = std::max(shift, (pile.world.body(pile.bodies[i]).pose.p - before[i]).norm());
  const auto ms = [](const std::vector<double>& of, double part) { return 1e3 * StepTimes::quantile(of, part); };
  std::printf("| %d | %.1f | %.1f | %.1f | %.1f | %.1f | %d | %d | %d | %.1e | %.1e | %.1e | %.1e |\n", second,
              ms(times.wall, 0.5), ms(times.wall, 0.99), ms(times.wall, 1.0), ms(times.cpu, 0.5), ms(times.cpu, 1.0),
              pile.contacts, unsettled, off, residual, deepest / testing::kPileSize, shift, rise);
  all.wall.insert(all.wall.end(), times.wall.begin(), times.wall.end());
  all.cpu.insert(all.cpu.end(), times.cpu.begin(), times.cpu.end());
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  const int count = argc > 1 ? std::atoi(argv[1]) : 100, seconds = argc > 2 ? std::atoi(argv[2]) : 8,
            modes = argc > 3 ? std::atoi(argv[3]) : 6;
  const bool rolls = argc < 5 || std::string_view(argv[4]) != "boxes";
  const double rolling_friction = rolls && argc >= 5 ? std::atof(argv[4]) : 0.0;
  if (!(rolling_friction >= 0.0) || count < 1 || seconds < 1 || modes < -1) {
    std::fprintf(stderr, "contact_pile [bodies] [seconds] [modes, -1: all rigid] [boxes | rolling friction]\n");
    return 2;
  }
  limber::testing::Pile pile(count, modes, rolls, {.rolling_friction = rolling_friction});
  const int flexible = modes < 0 ? 0 : count / 10;
  std::printf("%d bodies, %d of them flexible (%d modes), the others rigid primitives\n\n", count, flexible,
              std::max(modes, 0));
  std::printf(
      "| second | ms a step by the clock, p50 | p99 | worst | by CPU time, p50 | worst | contacts | steps not settled "
      "of 60 | residual over 1,000 | the largest, × 1e-9 | deepest / size | farthest moved, m | "
      "largest rise of energy, J |\n");
  std::printf("|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  StepTimes all;
  for (int second = 1; second <= seconds; ++second) run_second(pile, second, all);
  const auto ms = [](const std::vector<double>& of, double part) { return 1e3 * StepTimes::quantile(of, part); };
  std::printf(
      "\nall %d steps: by the clock p50 %.1f, p99 %.1f, worst %.1f ms; by CPU time p50 %.1f, p99 %.1f, worst "
      "%.1f ms\n",
      kStepsOfSecond * seconds, ms(all.wall, 0.5), ms(all.wall, 0.99), ms(all.wall, 1.0), ms(all.cpu, 0.5),
      ms(all.cpu, 0.99), ms(all.cpu, 1.0));
  return 0;
}
