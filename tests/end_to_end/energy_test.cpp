// No energy from nowhere: a part of the grid of energy_scenes.h. All of it, and piles, are benchmarks/energy_grid's.
#include <gtest/gtest.h>

#include <sstream>
#include <utility>

#include "energy_scenes.h"

namespace limber::testing {
namespace {

#if defined(__SANITIZE_ADDRESS__)
constexpr std::size_t kEvery = 47;
#else
constexpr std::size_t kEvery = 13;
#endif                          // prime to the grid's sides, so that all their values come up
constexpr double kRise = 1e-6;  // of the energy's scale, in a step
constexpr int kSteps = 30;

std::string text(const EnergyCase& at) {
  std::ostringstream out;
  out << name(at.scene) << ", E " << at.youngs_modulus << " Pa, nu " << at.poisson_ratio << ", step " << at.step
      << " s, damping " << at.damping_ratio << ", " << at.modes << " modes, mass ratio " << at.mass_ratio;
  return out.str();
}

class EnergyOfBars : public ::testing::TestWithParam<EnergyScene> {};

TEST_P(EnergyOfBars, NeverRisesWhateverTheStiffnessStepDampingModesAndWeights) {
  const std::vector<EnergyCase> grid = energy_grid();
  int cases = 0;
  for (std::size_t i = 0; i < grid.size(); i += kEvery) {
    if (grid[i].scene != GetParam()) continue;
    const EnergyResult r = run(grid[i], kSteps);
    EXPECT_TRUE(r.finite) << text(grid[i]);
    EXPECT_LE(r.worst_rise, kRise) << text(grid[i]);
    ++cases;
  }
  EXPECT_GT(cases, 5);
}

INSTANTIATE_TEST_SUITE_P(Scenes, EnergyOfBars,
                         ::testing::Values(EnergyScene::kGround, EnergyScene::kHandle, EnergyScene::kChain),
                         [](const auto& scene) { return std::string(name(scene.param)); });

// What blew up once: rubber of 100 Pa at a tenth of a second, with weights of 1 : 10,000, where Newton's method does
// not settle. The impulses it ends with are refused then.
TEST(EnergyOfBars, OfImpulsesThatDidNotComeTogetherIsRefused) {
  const EnergyResult r = run({.scene = EnergyScene::kChain,
                              .youngs_modulus = 100.0,
                              .poisson_ratio = 0.499,
                              .step = 0.1,
                              .damping_ratio = 2.0,
                              .mass_ratio = 1e4},
                             20);
  EXPECT_TRUE(r.finite);
  EXPECT_LE(r.worst_rise, kRise);
}

// Steps of a ninth of the swing's period: where it turns round it would end higher than its energy allows, with no
// motion left there to take. It begins such a step more slowly, and stays where it is held.
TEST(EnergyOfBars, AHeldOneIsNeverLetGoWhereItTurnsRound) {
  for (const int modes : {0, 8}) {
    const EnergyResult r =
        run({.scene = EnergyScene::kHandle, .youngs_modulus = 1e8, .poisson_ratio = 0.499, .step = 0.1, .modes = modes},
            200);
    EXPECT_EQ(r.unsettled, 0) << modes;
    EXPECT_LE(r.worst_rise, kRise) << modes;
  }
}

// Three rigid bars, the last one ten thousand times as heavy: its swing whips the other two, which at a tenth of a
// second even parts of a 64th of the step do not follow everywhere.
TEST(EnergyOfBars, AChainWithAHeavyEndSettles) {
  for (const auto& [step, unsettled] : {std::pair(1.0 / 60.0, 0), std::pair(0.1, 5)}) {
    const EnergyResult r = run({.scene = EnergyScene::kChain, .step = step, .modes = 0, .mass_ratio = 1e4}, 120);
    EXPECT_LE(r.unsettled, unsettled) << step;
    EXPECT_LE(r.worst_rise, kRise) << step;
  }
}

}  // namespace
}  // namespace limber::testing
