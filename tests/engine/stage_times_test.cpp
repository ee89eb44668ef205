#include "limber/core/stage_times.h"

#include <gtest/gtest.h>

#include <chrono>

#include "asked.h"
#include "counted_new.h"
#include "limber/engine/world.h"
#include "pile.h"

namespace limber {
namespace {

/// However coarse the clock is, time passes until this returns.
void wait_for_the_clock() {
  const auto began = std::chrono::steady_clock::now();
  while (std::chrono::steady_clock::now() == began) {
  }
}

TEST(StageClock, SplitsALapInTheProportionsOfOthers) {
  StageTimes times, theirs;
  StageClock clock(&times);
  theirs[Stage::kRows] = {3.0, 7};
  theirs[Stage::kSolve] = {1.0, 5};
  wait_for_the_clock();
  clock.lap(theirs, Stage::kCommit);
  EXPECT_GT(times[Stage::kSolve].seconds, 0.0);
  EXPECT_DOUBLE_EQ(times[Stage::kRows].seconds, 3.0 * times[Stage::kSolve].seconds);
  EXPECT_EQ(times[Stage::kRows].units, 7);
  EXPECT_EQ(times[Stage::kCommit].seconds, 0.0);
  wait_for_the_clock();
  clock.lap(StageTimes{}, Stage::kCommit);
  EXPECT_GT(times[Stage::kCommit].seconds, 0.0);
}

TEST(StageClock, WithoutTimesItDoesNothing) {
  StageClock clock;
  clock.lap(Stage::kRows, 3);
  EXPECT_FALSE(clock.runs());
}

/// A pile of 30 bodies over steps in which they come to touch.
struct TimedPile {
  testing::Pile pile;
  StageTimes times;

  explicit TimedPile(const ContactOptions& options = {}) : pile(30, 4, true, options) {
    for (int n = 0; n < 40; ++n) pile.step_once();
  }
};

TEST(WorldStages, CountWhatAStepDoes) {
  TimedPile timed(testing::exactly());
  World& world = timed.pile.world;
  world.set_stage_times(&timed.times);
  timed.pile.step_once();
  const ConstraintReport report = world.constraint_report();
  const StageTimes& t = timed.times;
  EXPECT_EQ(t[Stage::kBookkeeping].units, 1);
  EXPECT_EQ(t[Stage::kLookAhead].units, 30);
  EXPECT_GT(t[Stage::kNarrowPhase].units, 0);
  EXPECT_LE(t[Stage::kNarrowPhase].units, timed.pile.contacts);
  EXPECT_GE(t[Stage::kBroadPhase].units, report.islands);
  EXPECT_GE(t[Stage::kRows].units, report.rows);
  EXPECT_LE(t[Stage::kRows].units, 3 * timed.pile.contacts);
  EXPECT_EQ(t[Stage::kSolve].units, report.rows);
  EXPECT_EQ(t[Stage::kCommit].units, report.bodies);
  EXPECT_EQ(t[Stage::kAdvance].units + t[Stage::kCommit].units, 30);
  EXPECT_GT(report.rows, 0);
}

TEST(WorldStages, SumToNoMoreThanTheStep) {
  TimedPile timed(testing::exactly());
  World& world = timed.pile.world;
  world.set_stage_times(&timed.times);
  const auto began = std::chrono::steady_clock::now();
  for (int n = 0; n < testing::all_or_tenth(20); ++n) timed.pile.step_once();
  const double passed = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  EXPECT_LE(timed.times.seconds(), passed);
  for (const Stage stage : {Stage::kLookAhead, Stage::kBroadPhase, Stage::kNarrowPhase, Stage::kRows, Stage::kSolve,
                            Stage::kCommit, Stage::kBookkeeping})
    EXPECT_GT(timed.times[stage].seconds, 0.0) << to_string(stage);
}

TEST(WorldStages, ChangeNothingAndAllocateNothing) {
  TimedPile timed, plain;
  timed.pile.world.set_stage_times(&timed.times);
  for (int n = 0; n < 120; ++n) timed.pile.step_once(), plain.pile.step_once();
  EXPECT_EQ(timed.pile.world.state_hash(), plain.pile.world.state_hash());
  World still;
  still.add_body(testing::sample_model({}), {});
  still.set_stage_times(&timed.times);
  still.step();
  const long before = testing::allocations();
  for (int n = 0; n < 50; ++n) still.step();
  EXPECT_EQ(testing::allocations() - before, 0);
}

TEST(WorldStages, AreNotAddedToOnceSetBack) {
  TimedPile timed;
  timed.pile.world.set_stage_times(&timed.times);
  timed.pile.step_once();
  timed.pile.world.set_stage_times(nullptr);
  const double before = timed.times.seconds();
  timed.pile.step_once();
  EXPECT_EQ(timed.times.seconds(), before);
}

TEST(WorldStages, DrawingCountsVerticesOfEveryInstance) {
  World world;
  StageTimes times;
  world.set_stage_times(&times);
  const BodyId a = world.add_body(testing::sample_model({}), {}), b = world.add_body(testing::sample_model({}), {});
  std::vector<float> positions(2 * 24);
  const std::array targets{DrawTarget{a, std::span(positions).first(24)}, DrawTarget{b, std::span(positions).last(24)}};
  world.reconstruct(targets);
  EXPECT_EQ(times[Stage::kReconstruct].units, 16);
  EXPECT_GT(times[Stage::kReconstruct].seconds, 0.0);
}

}  // namespace
}  // namespace limber
