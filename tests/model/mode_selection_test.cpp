#include "limber/model/mode_selection.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <limits>
#include <numbers>

#include "constants.h"
#include "limber/core/error.h"

namespace limber {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

using testing::kFewRoundings;

constexpr double kUnseeable = 1e30;  // m: no motion reaches it, so that every mode is dropped and its displacement told

double lambda_of(double hz) { return std::pow(2.0 * std::numbers::pi * hz, 2); }

/// A point mass on a spring: w = 1/√m, λ = k/m, so that w·w/λ = 1/k.
ModeStrength spring(double mass, double stiffness, double damping_ratio = 0.0) {
  const double lambda = stiffness / mass, w = 1.0 / std::sqrt(mass);
  return {.eigenvalue = lambda, .decay = damping_ratio * std::sqrt(lambda), .max_observable = w, .max_loadable = w};
}

/// The displacement that the selection reckons with, m.
double displacement_of(const ModeStrength& mode, double force, LoadKind load) {
  const auto s = select_modes({{mode}}, {.max_force = force, .min_displacement = kUnseeable, .load = load});
  return s.dropped.at(0).value;
}

std::vector<ModeStrength> modes_at(const std::vector<double>& hz) {
  std::vector<ModeStrength> modes;
  for (const double f : hz)
    modes.push_back({.eigenvalue = lambda_of(f), .decay = 0.0, .max_observable = 1.0, .max_loadable = 1.0});
  return modes;
}

TEST(ModeSelection, StaticForceShowsForceOverStiffness) {
  EXPECT_NEAR(displacement_of(spring(3.0, 500.0), 10.0, LoadKind::kStatic), 10.0 / 500.0, kFewRoundings);
}

TEST(ModeSelection, SuddenForceShowsTheOvershootOfAnUndampedSpring) {
  // x(t) = F/k (1 − cos ωt): followed over one period, its largest value is what the rule says.
  const double k = 500.0, f = 10.0;
  double largest = 0.0;
  for (int i = 0; i <= 1000; ++i)
    largest = std::max(largest, f / k * (1.0 - std::cos(2.0 * std::numbers::pi * i / 1000)));
  EXPECT_NEAR(displacement_of(spring(3.0, k), f, LoadKind::kSudden), largest, kFewRoundings);
}

TEST(ModeSelection, ResonantForceShowsThePeakOfTheFrequencyResponse) {
  for (const double zeta : {0.001, 0.05, 0.5, 0.7, 0.7072, 1.0, 5.0}) {
    const ModeStrength mode = spring(1.0, 400.0, zeta);
    double peak = 0.0;  // of |1/(λ − ω² + 2iξω)|, by a fine search from rest to beyond resonance
    for (double ratio = 0.0; ratio < 1.5; ratio += 1e-5) {
      const double omega = 20.0 * ratio;
      peak = std::max(peak, 1.0 / std::abs(std::complex(400.0 - omega * omega, 2.0 * mode.decay * omega)));
    }
    const double kSearch = 1e-4;  // relative: half a step of the search beside a peak of width ζ
    EXPECT_NEAR(displacement_of(mode, 1.0, LoadKind::kResonant), peak, kSearch * peak) << "damping ratio " << zeta;
  }
}

TEST(ModeSelection, UndampedResonanceIsAlwaysSeenUnlessNoForceReachesIt) {
  ModeStrength mode = spring(1.0, 400.0);
  const SceneLimits limits{.max_force = 1.0, .min_displacement = kUnseeable, .load = LoadKind::kResonant};
  EXPECT_THAT(select_modes({{mode}}, limits).kept, ElementsAre(0));
  mode.max_loadable = 0.0;
  EXPECT_THAT(select_modes({{mode}}, limits).kept, IsEmpty());
}

TEST(ModeSelection, DropsWhatCannotBeSeenWhereverItStands) {
  // [H03] 3.2: 60,000 N and 0.1 mm.
  const SceneLimits limits{.max_force = 60000.0, .min_displacement = 1e-4, .load = LoadKind::kStatic};
  std::vector<ModeStrength> modes = modes_at({100.0, 200.0, 300.0});
  modes[1].max_loadable = 1e-6;
  const double just_seen = limits.min_displacement * modes[2].eigenvalue / limits.max_force;
  modes[2].max_observable = just_seen * (1.0 + 1e-12);
  ModeSelection s = select_modes(modes, limits);
  EXPECT_THAT(s.kept, ElementsAre(0, 2));
  ASSERT_EQ(s.dropped.size(), 1u);
  EXPECT_EQ(s.dropped[0].mode, 1);
  EXPECT_EQ(s.dropped[0].reason, DropReason::kTooSmall);
  EXPECT_NEAR(s.dropped[0].value, 60000.0 * 1e-6 / lambda_of(200.0), kFewRoundings * s.dropped[0].value);
  EXPECT_EQ(s.dropped[0].limit, 1e-4);

  modes[2].max_observable = just_seen * (1.0 - 1e-12);
  EXPECT_THAT(select_modes(modes, limits).kept, ElementsAre(0));
}

TEST(ModeSelection, FrameRateLooksAtTheDampedFrequency) {
  std::vector<ModeStrength> modes = modes_at({29.0, 31.0, 40.0, 50.0});
  modes[2].decay = 0.8 * std::sqrt(modes[2].eigenvalue);  // swings at 40·0.6 = 24 Hz
  modes[3].decay = 3.0 * std::sqrt(modes[3].eigenvalue);  // does not swing
  const ModeSelection s = select_modes(modes, {.frame_rate = 60.0});
  EXPECT_THAT(s.kept, ElementsAre(0, 2, 3));
  ASSERT_EQ(s.dropped.size(), 1u);
  EXPECT_EQ(s.dropped[0].reason, DropReason::kTooFast);
  EXPECT_NEAR(s.dropped[0].value, 31.0, 31.0 * kFewRoundings);
  EXPECT_EQ(s.dropped[0].limit, 30.0);
}

TEST(ModeSelection, MaxModesKeepsTheLowestThatCanBeSeen) {
  std::vector<ModeStrength> modes = modes_at({10.0, 20.0, 30.0, 40.0});
  modes[0].max_observable = 0.0;
  const ModeSelection s = select_modes(modes, {.max_modes = 2, .max_force = 1.0, .min_displacement = 1e-12});
  EXPECT_THAT(s.kept, ElementsAre(1, 2));
  ASSERT_EQ(s.dropped.size(), 2u);
  EXPECT_EQ(s.dropped[1].mode, 3);
  EXPECT_EQ(s.dropped[1].reason, DropReason::kBeyondMaxModes);
  EXPECT_EQ(s.dropped[1].value, 3.0);
  EXPECT_EQ(s.dropped[1].limit, 2.0);
}

TEST(ModeSelection, ALimitThatIsNotGivenDropsNothing) {
  const auto modes = modes_at({1.0, 1e3, 1e6, 1e9});
  EXPECT_THAT(select_modes(modes, {}).dropped, IsEmpty());
  EXPECT_THAT(select_modes(modes, {.max_force = 1e-9}).dropped, IsEmpty());
  EXPECT_THAT(select_modes(modes, {.min_displacement = 1.0}).dropped, IsEmpty());
}

TEST(ModeSelection, KeepAllSwitchesOffForceAndFrameRateOnly) {
  const auto modes = modes_at({1e3, 1e4, 1e5});
  const SceneLimits limits{
      .max_modes = 2, .max_force = 1e-9, .min_displacement = 1.0, .frame_rate = 60.0, .keep_all = true};
  EXPECT_THAT(select_modes(modes, limits).kept, ElementsAre(0, 1));
}

TEST(ModeSelection, MechanismsStayAndDoNotCount) {
  const SceneLimits limits{.max_modes = 1, .max_force = 1e-9, .min_displacement = 1.0};
  EXPECT_THAT(select_modes(modes_at({0.0, 0.0, 10.0}), limits).kept, ElementsAre(0, 1));
  EXPECT_THAT(select_modes(modes_at({0.0, 0.0, 10.0, 20.0}), {.max_modes = 1}).kept, ElementsAre(0, 1, 2));
}

TEST(ModeSelection, ClustersOfEqualEigenvaluesAreNeverCut) {
  const double pair = 20.0 * (1.0 + 1e-8), near = 30.0 * (1.0 + 1e-5);
  const auto modes = modes_at({10.0, 20.0, pair, 30.0, near});
  EXPECT_THAT(select_modes(modes, {.max_modes = 2}).kept, ElementsAre(0));           // 20 Hz goes whole …
  EXPECT_THAT(select_modes(modes, {.max_modes = 3}).kept, ElementsAre(0, 1, 2));     // … or stays whole
  EXPECT_THAT(select_modes(modes, {.max_modes = 4}).kept, ElementsAre(0, 1, 2, 3));  // 30 Hz are two: 2e-5 apart in λ
  EXPECT_THAT(select_modes(modes_at({20.0, pair, 30.0}), {.max_modes = 1}).kept,
              ElementsAre(0, 1));  // nothing else is kept
}

TEST(ModeSelection, NoHigherModeSlipsInBehindAClusterThatWent) {
  const ModeSelection s = select_modes(modes_at({10.0, 20.0, 20.0, 30.0}), {.max_modes = 2});
  EXPECT_THAT(s.kept, ElementsAre(0));
  ASSERT_EQ(s.dropped.size(), 3u);
  for (const DroppedMode& d : s.dropped) {
    EXPECT_EQ(d.reason, DropReason::kBeyondMaxModes);
    EXPECT_GT(d.value, d.limit);
  }
}

TEST(ModeSelection, AClusterIsSeenIfOneOfItsModesIs) {
  std::vector<ModeStrength> modes = modes_at({20.0, 20.0});
  modes[0].max_observable = 0.0;
  const SceneLimits limits{.max_force = 1.0, .min_displacement = 0.5 / lambda_of(20.0), .load = LoadKind::kStatic};
  EXPECT_THAT(select_modes(modes, limits).kept, ElementsAre(0, 1));
  modes[1].max_observable = 0.4;
  EXPECT_THAT(select_modes(modes, limits).kept, IsEmpty());
}

TEST(ModeSelection, EveryModeIsKeptOrDroppedOnce) {
  std::vector<double> hz;
  for (int i = 0; i < 40; ++i) hz.push_back(5.0 * (1 + i / 2));  // twenty pairs
  auto modes = modes_at(hz);
  for (std::size_t i = 0; i < modes.size(); ++i) modes[i].max_observable = i % 5 == 0 ? 0.0 : 1.0;
  const ModeSelection s =
      select_modes(modes, {.max_modes = 7, .max_force = 1.0, .min_displacement = 1e-5, .frame_rate = 120.0});
  std::vector<int> times(modes.size(), 0);
  for (const Index i : s.kept) ++times.at(static_cast<std::size_t>(i));
  for (const DroppedMode& d : s.dropped) ++times.at(static_cast<std::size_t>(d.mode));
  EXPECT_THAT(times, ::testing::Each(1));
  EXPECT_LE(s.kept.size(), 7u);
}

TEST(ModeSelection, WrongArgumentsAreNamed) {
  const auto said = [](std::vector<ModeStrength> modes, const SceneLimits& limits) -> std::string {
    try {
      select_modes(modes, limits);
    } catch (const InvalidArgument& e) {
      return e.what();
    }
    return "accepted";
  };
  EXPECT_THAT(said({}, {.max_modes = 0}), HasSubstr("max_modes is 0, expected 1 or more"));
  EXPECT_THAT(said({}, {.max_force = -1.0}), HasSubstr("max_force is -1 N"));
  EXPECT_THAT(said({}, {.min_displacement = std::nan("")}), HasSubstr("min_displacement is nan m"));
  EXPECT_THAT(said({}, {.frame_rate = -60.0}), HasSubstr("frame_rate is -60 Hz"));
  EXPECT_THAT(said(modes_at({2.0, 1.0}), {}), HasSubstr("mode 1: eigenvalue is below"));
  auto modes = modes_at({1.0});
  modes[0].decay = -1.0;
  EXPECT_THAT(said(modes, {}), HasSubstr("mode 0: decay is -1"));
}

TEST(ModeSelection, ReasonsHaveTheirWords) {
  EXPECT_EQ(to_string(DropReason::kTooSmall), "below_min_displacement");
  EXPECT_EQ(to_string(DropReason::kTooFast), "above_half_frame_rate");
  EXPECT_EQ(to_string(DropReason::kBeyondMaxModes), "beyond_max_modes");
}

}  // namespace
}  // namespace limber
