// How two bodies with indentations and ears come to rest on each other: one lies on the ground, turned at random, the
// other one, turned at random, is dropped on it from half a metre. Prints Markdown: how deep they overlap at most and
// after four seconds, steps that do not settle, and what a step takes. Figures: docs/reports/contact.md.
//   bumpy_pairs ASSET.glb [PAIRS [HERTZ]]     20 pairs at 60 steps a second
//   bumpy_pairs ASSET.glb heap [BODIES]       a tower of 27, four in a layer, that falls in a heap: a line a second
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <memory>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "cpu_time.h"
#include "limber/collision/contact_finder.h"
#include "limber/engine/world.h"
#include "limber/model/asset.h"

namespace limber::testing {
namespace {

constexpr double kSeconds = 4.0, kHeight = 0.5;
constexpr Stage kShown[] = {Stage::kNarrowPhase, Stage::kRows, Stage::kSolve};

struct Outcome {
  double deepest = 0.0, at_end = 0.0;  // m, of overlap
  int unsettled = 0, steps = 0;
  std::vector<double> milliseconds;
};

Outcome drop(const std::shared_ptr<const ModalModel>& model, double step, std::mt19937& random) {
  std::uniform_real_distribution<double> about(-1.0, 1.0);
  const auto turn = [&] {
    return quaternion_from_rotation_vector({3 * about(random), 3 * about(random), 3 * about(random)});
  };
  const double size = model->collision_extent().radius;
  ContactFinder finder;
  World world({.step = step});
  world.set_contact_source(&finder, {.solver = ContactSolver::kExact, .friction = 0.5});
  world.add_static(std::make_shared<const Shape>(HalfSpace{}));
  const BodyId low = world.add_body(model, {.pose = {turn(), {0.0, 0.0, 1.5 * size}}});
  world.add_body(model,
                 {.pose = {turn(), {0.1 * size * about(random), 0.1 * size * about(random), 1.5 * size + kHeight}}});
  Outcome out;
  double overlap = 0.0;
  world.set_contact_veto([&](const ContactPoint& contact) {
    if (contact.a.body >= static_cast<Index>(low.index) && contact.b.body > static_cast<Index>(low.index))
      overlap = std::max(overlap, -contact.gap);
    return true;
  });
  for (; world.time() < kSeconds; ++out.steps) {
    overlap = 0.0;
    const double start = thread_seconds();
    world.step();
    out.milliseconds.push_back(1e3 * (thread_seconds() - start));
    out.deepest = std::max(out.deepest, overlap);
    out.unsettled += world.constraint_report().solved ? 0 : 1;
  }
  out.at_end = overlap;
  return out;
}

void heap(const std::shared_ptr<const ModalModel>& model, int bodies) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> about(-1.0, 1.0);
  const double size = model->collision_extent().radius;
  ContactFinder finder;
  World world({.step = 1.0 / 60.0});
  world.set_contact_source(&finder, {.solver = ContactSolver::kExact, .friction = 0.5});
  world.add_static(std::make_shared<const Shape>(HalfSpace{}));
  for (int i = 0; i < bodies; ++i)
    world.add_body(model,
                   {.pose = {quaternion_from_rotation_vector({3 * about(random), 3 * about(random), 3 * about(random)}),
                             {size * (i % 2 == 0 ? -1.0 : 1.0), size * (i / 2 % 2 == 0 ? -1.0 : 1.0),
                              (1.5 + 2.0 * static_cast<double>(i / 4)) * size}}});
  double overlap = 0.0;
  world.set_contact_veto([&](const ContactPoint& contact) {
    overlap = std::max(overlap, -contact.gap);
    return true;
  });
  std::printf("| second | unsettled | contacts pressing | deepest at its end, mm | ms: mean | worst |");
  for (const Stage stage : kShown) std::printf(" %s |", std::string(to_string(stage)).c_str());
  std::printf("\n|---|---|---|---|---|---|---|---|---|\n");
  for (int second = 0; second < 8; ++second) {
    StageTimes times;
    world.set_stage_times(&times);
    double sum = 0.0, worst = 0.0;
    int unsettled = 0;
    for (int i = 0; i < 60; ++i) {
      overlap = 0.0;
      const double start = thread_seconds();
      world.step();
      const double took = 1e3 * (thread_seconds() - start);
      sum += took, worst = std::max(worst, took);
      unsettled += world.constraint_report().solved ? 0 : 1;
    }
    std::printf("| %d | %d | %zu | %.2f | %.2f | %.1f |", second + 1, unsettled, world.contact_events().size(),
                1e3 * overlap, sum / 60.0, worst);
    for (const Stage stage : kShown) std::printf(" %.2f |", 1e3 / 60.0 * times[stage].seconds);
    std::printf("\n");
    std::fflush(stdout);
  }
}

}  // namespace
}  // namespace limber::testing

int main(int argc, char** argv) try {
  using namespace limber::testing;
  if (argc < 2) throw std::runtime_error("usage: bumpy_pairs ASSET.glb [PAIRS [HERTZ] | heap [BODIES]]");
  const auto model = limber::read_asset(argv[1]).bodies.at(0);
  if (argc > 2 && std::string_view(argv[2]) == "heap") {
    heap(model, argc > 3 ? std::atoi(argv[3]) : 27);
    return 0;
  }
  const int pairs = argc > 2 ? std::atoi(argv[2]) : 20;
  const double step = 1.0 / (argc > 3 ? std::atof(argv[3]) : 60.0);
  std::mt19937 random(1);
  std::vector<double> times, ends;
  int unsettled = 0, steps = 0;
  std::printf(
      "| pair | deepest, mm | at the end, mm | steps unsettled | step: median, ms | worst, ms "
      "|\n|---|---|---|---|---|---|\n");
  for (int i = 0; i < pairs; ++i) {
    Outcome o = drop(model, step, random);
    std::ranges::sort(o.milliseconds);
    std::printf("| %d | %.2f | %.2f | %d | %.2f | %.1f |\n", i, 1e3 * o.deepest, 1e3 * o.at_end, o.unsettled,
                o.milliseconds[o.milliseconds.size() / 2], o.milliseconds.back());
    std::fflush(stdout);
    times.insert(times.end(), o.milliseconds.begin(), o.milliseconds.end());
    ends.push_back(o.at_end);
    unsettled += o.unsettled, steps += o.steps;
  }
  std::ranges::sort(times), std::ranges::sort(ends);
  std::printf(
      "\nall: overlap at the end median %.2f mm, worst %.2f; %d of %d steps unsettled; step median %.2f ms, 99 %% "
      "%.1f, worst %.1f\n",
      1e3 * ends[ends.size() / 2], 1e3 * ends.back(), unsettled, steps, times[times.size() / 2],
      times[times.size() * 99 / 100], times.back());
} catch (const std::exception& error) {
  std::fprintf(stderr, "bumpy_pairs: %s\n", error.what());
  return 1;
}
