// Baked bars driven to the ends of every axis (stability_scenes.h). All of it: `limber-benchmark stability`.
#include "asked.h"
#include "stability_scenes.h"

#include <gtest/gtest.h>

namespace limber::testing {
namespace {

constexpr int kExtremeSteps = kSanitized ? 10 : 60;

bool flies_or_falls(const StabilityCase& at) {
  return at.scene == StabilityScene::kFlight || at.scene == StabilityScene::kGround;
}

#if defined(__SANITIZE_ADDRESS__)
/// In other builds tools.stability_within_its_limits sees more than this.
TEST(Extremes, NothingIsEverNotFinite) {
  for (const StabilityCase& at : extreme_cases(1)) EXPECT_TRUE(run(at, kExtremeSteps).finite) << text(at);
}
#endif

/// One quantity at a time: whatever flies keeps its momentum and energy, whatever falls on the ground stays above it
/// and keeps its energy; every step settles. Not so where steps vary from one to the next: modes that pass the step's
/// Nyquist rate change what they answer by. Nor where an hour passes in one step above the ground: how such a bar comes
/// down hangs on the processor's last digits, and tools.stability_within_its_limits counts it.
TEST(Extremes, WhatFliesAndWhatFallsWithstandsEachOfThem) {
  int cases = 0;
  for (const StabilityCase& at : extreme_cases(0)) {
    const bool ground = at.scene == StabilityScene::kGround;
    if (!flies_or_falls(at) || (ground && (at.varying_step || at.pause >= 3600.0))) continue;
    const StabilityResult seen = run(at, 2 * kExtremeSteps);
    for (int i = 0; i < kStabilityFaults; ++i)
      EXPECT_EQ(faults(at, seen) >> i & 1u, 0u) << name(static_cast<StabilityFault>(i)) << ": " << text(at);
    ++cases;
  }
  EXPECT_GT(cases, 100);
}

/// The judge sees what is there: a bar that is let go of in the ground, and a run that did not settle.
TEST(Extremes, FaultsAreSeen) {
  const StabilityCase at{.scene = StabilityScene::kGround};
  StabilityResult seen{.steps = 100};
  EXPECT_EQ(faults(at, seen), 0u);
  seen.total_rise = 2e-6;
  seen.unsettled = 2;
  seen.rest_overlap = 0.1;
  EXPECT_EQ(faults(at, seen), 1u << static_cast<unsigned>(StabilityFault::kEnergy) |
                                  1u << static_cast<unsigned>(StabilityFault::kUnsettled) |
                                  1u << static_cast<unsigned>(StabilityFault::kOverlap));
}

TEST(Extremes, ACaseIsToldInItsSimplestForm) {
  const StabilityCase at{.scene = StabilityScene::kGround, .youngs_modulus = 1e8, .step = 0.1, .gravity = 1e3};
  const StabilityCase simple = simplified(at, [](const StabilityCase& c) { return c.step == 0.1; });
  EXPECT_EQ(text(simple), "ground, step 0.1");
}

}  // namespace
}  // namespace limber::testing
