// No energy from nowhere: a part of the grid of stability_scenes.h, by World::energy and by the nodes of the meshes.
// All of it: `limber-benchmark stability --grid energy`.
#include <gtest/gtest.h>

#include <utility>

#include "asked.h"
#include "stability_scenes.h"

namespace limber::testing {
namespace {

// Prime to the grid's sides, so that all their values come up.
constexpr int kEvery = kSanitized ? 47 : 13, kEveryPile = kSanitized ? 397 : 131;
constexpr double kRise = 1e-6;  // of the energy's scale, in a step
constexpr int kSteps = 30;

/// By World::energy, which the energy guard minds: no step ends with more than it began with, and no moment has more
/// than the first. By the nodes, which nothing minds: their kinetic energy is World's but for the change of inertia
/// (spin_bound), so no moment has more than the first but for that. A step can: modes above the step's Nyquist rate
/// have static answers, whose strain World::energy counts beside that of what vibrates and without their product
/// (body_energy.h).
void expect_no_energy_from_nowhere(const StabilityResult& r, double node_rise) {
  EXPECT_TRUE(r.finite);
  EXPECT_LE(r.worst_rise, kRise);
  EXPECT_LE(r.total_rise, kRise);
  EXPECT_LE(r.spin_excess, kRise);
  EXPECT_LE(r.node_total_rise, kRise + 2.0 * r.spin_bound);
  EXPECT_LE(r.node_worst_rise, node_rise + 2.0 * r.spin_bound);
}

class EnergyOfBars : public ::testing::TestWithParam<StabilityScene> {};

TEST_P(EnergyOfBars, NeverRisesWhateverTheStiffnessStepDampingModesAndWeights) {
  const bool pile = GetParam() == StabilityScene::kPile;  // takes twenty times as long as the others
  const auto every = static_cast<std::size_t>(asked("LIMBER_EVERY", pile ? kEveryPile : kEvery));
  // Stiff bars in a pile, one ten thousand times as heavy as the other: 7.8e-4 is measured. A regression guard.
  const double node_rise = pile ? 1e-3 : kRise;
  const std::vector<StabilityCase> grid = energy_grid();
  int cases = 0, sharp = 0;
  for (std::size_t i = 0; i < grid.size(); i += every) {
    if (grid[i].scene != GetParam()) continue;
    SCOPED_TRACE(text(grid[i]));
    const StabilityResult r = run(grid[i], kSteps);
    expect_no_energy_from_nowhere(r, node_rise);
    // The strain of the mesh is the elastic energy, where contacts do not ask modes above the Nyquist rate for answers.
    if (GetParam() == StabilityScene::kHandle || GetParam() == StabilityScene::kChain) {
      EXPECT_LE(r.strain_difference, kRise);
    }
    ++cases;
    sharp += r.spin_bound < 0.01 ? 1 : 0;
  }
  EXPECT_GE(cases, 2);
  EXPECT_GE(2 * sharp, cases) << "too many bars bend and spin so much that their nodes tell nothing";
}

INSTANTIATE_TEST_SUITE_P(Scenes, EnergyOfBars,
                         ::testing::Values(StabilityScene::kGround, StabilityScene::kPile, StabilityScene::kHandle,
                                           StabilityScene::kChain),
                         [](const auto& scene) { return std::string(name(scene.param)); });

// What blew up once: rubber of 100 Pa at a tenth of a second, with weights of 1 : 10,000, where Newton's method does
// not settle. The impulses it ends with are refused then.
TEST(EnergyOfBars, OfImpulsesThatDidNotComeTogetherIsRefused) {
  const StabilityResult r = run({.scene = StabilityScene::kChain,
                                 .youngs_modulus = 100.0,
                                 .poisson_ratio = 0.499,
                                 .step = 0.1,
                                 .damping_ratio = 2.0,
                                 .mass_ratio = 1e4},
                                20);
  expect_no_energy_from_nowhere(r, kRise);
}

// Steps of a ninth of the swing's period: where it turns round it would end higher than its energy allows, with no
// motion left there to take. It begins such a step more slowly, and stays where it is held.
TEST(EnergyOfBars, AHeldOneIsNeverLetGoWhereItTurnsRound) {
  for (const int modes : {0, 8}) {
    const StabilityResult r = run(
        {.scene = StabilityScene::kHandle, .youngs_modulus = 1e8, .poisson_ratio = 0.499, .step = 0.1, .modes = modes},
        200);
    EXPECT_EQ(r.unsettled, 0) << modes;
    expect_no_energy_from_nowhere(r, kRise);
  }
}

/// Three bars that hang on each other, the last one so many times as heavy: its swing whips the other two.
StabilityCase heavy_end(double times, int modes) {
  return {.scene = StabilityScene::kChain, .modes = modes, .mass_ratio = times};
}

// And bars so soft that they hang down by their own lengths. Every step settles.
TEST(EnergyOfBars, AChainWithAHeavyEndOrOfRubberAsSoftAsFoamSettles) {
  const StabilityCase chain{.scene = StabilityScene::kChain};
  std::vector<StabilityCase> cases{heavy_end(1e4, 0), heavy_end(1e4, chain.modes), heavy_end(1e6, chain.modes), chain,
                                   chain};
  cases[3].youngs_modulus = 100.0;
  cases[4].step = 1.0;
  for (const StabilityCase& at : cases) {
    const StabilityResult r = run(at, 120);
    EXPECT_EQ(r.unsettled, 0) << at.mass_ratio << ' ' << at.youngs_modulus << ' ' << at.step;
    EXPECT_LE(r.worst_rise, 1e-12);
    EXPECT_LE(r.total_rise, kRise);
  }
}

// In a tenth of a second the light bars turn round more than once. Steps that do not settle are refused and told, and
// no energy comes of them.
TEST(EnergyOfBars, AHeavyEndThatWhipsInLongStepsGainsNothing) {
  for (int i = 0; i < 5; ++i) {
    StabilityCase at = heavy_end(1e4 * (1.0 + 0.08 * i), 0);
    at.step = 0.1;
    const StabilityResult r = run(at, 120);
    EXPECT_LE(r.worst_rise, 1e-12);
    EXPECT_LE(r.total_rise, kRise);
  }
}

}  // namespace
}  // namespace limber::testing
