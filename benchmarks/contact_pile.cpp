// A pile of mixed bodies that is dropped into a pit: what a step costs on the way, and how still it lies. Prints
// Markdown, one row a second.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string_view>
#include <vector>

#include "cpu_time.h"
#include "pile.h"

namespace {

constexpr int kStepsOfSecond = 60;

void run_second(limber::testing::Pile& pile, int second) {
  using namespace limber;
  std::vector<Vec3> before;
  for (const BodyId id : pile.bodies) before.push_back(pile.world.body(id).pose.p);
  double total = 0.0, worst = 0.0, deepest = 0.0, shift = 0.0, rise = 0.0;
  double energy = testing::total_energy(pile.world, pile.bodies);
  int unsettled = 0;
  for (int i = 0; i < kStepsOfSecond; ++i) {
    const double begin = thread_seconds();
    pile.step_once();
    const double took = thread_seconds() - begin;
    total += took, worst = std::max(worst, took), deepest = std::max(deepest, -pile.deepest);
    unsettled += pile.world.constraint_report().solved ? 0 : 1;
    const double now = testing::total_energy(pile.world, pile.bodies);
    rise = std::max(rise, now - energy);
    energy = now;
  }
  for (std::size_t i = 0; i < before.size(); ++i)
    shift = std::max(shift, (pile.world.body(pile.bodies[i]).pose.p - before[i]).norm());
  std::printf("| %d | %.1f | %.1f | %d | %d | %.1e | %.1e | %.1e |\n", second, 1e3 * total / kStepsOfSecond,
              1e3 * worst, pile.contacts, unsettled, deepest / testing::kPileSize, shift, rise);
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
  std::printf(
      "| second | ms a step, mean | worst | contacts | steps not settled of 60 | deepest / size | farthest moved, m "
      "| largest rise of energy, J |\n");
  std::printf("|---|---|---|---|---|---|---|---|\n");
  for (int second = 1; second <= seconds; ++second) run_second(pile, second);
  return 0;
}
