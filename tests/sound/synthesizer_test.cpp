#include "limber/sound/synthesizer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "counted_new.h"
#include "instruction_sets.h"
#include "limber/core/error.h"

namespace limber {
namespace {

constexpr double kRate = 48e3;
constexpr double kTwoPi = 2.0 * std::numbers::pi;
constexpr double kSingle = 2e-7;  // samples are single precision

/// Modes of one vertex that move along x with the shape 1.
SoundModes modes_of(const std::vector<double>& hz, const std::vector<double>& decay) {
  SoundModes modes{.eigenvalues = {}, .decays = decay, .shapes = {}, .vertices = 1};
  for (std::size_t k = 0; k < hz.size(); ++k) {
    modes.eigenvalues.push_back(kTwoPi * hz[k] * kTwoPi * hz[k] + decay[k] * decay[k]);
    modes.shapes.insert(modes.shapes.end(), {1.0f, 0.0f, 0.0f});
  }
  return modes;
}

std::shared_ptr<const ModalSound> sound_of(const SoundModes& modes) {
  return std::make_shared<ModalSound>(modes, std::vector<double>(modes.eigenvalues.size(), 1.0), kRate);
}

/// `count` modes of 60 Hz to 15 kHz.
SoundModes many_modes(int count) {
  std::vector<double> hz, decay;
  for (int k = 0; k < count; ++k) {
    hz.push_back(60.0 * std::pow(250.0, static_cast<double>(k) / count));
    decay.push_back(2.0 + hz.back() / 300.0);
  }
  return modes_of(hz, decay);
}

std::vector<float> render(Synthesizer& synthesizer, std::size_t samples, std::size_t block = 128) {
  std::vector<float> out(samples);
  for (std::size_t at = 0; at < samples; at += block)
    synthesizer.render(std::span(out).subspan(at, std::min(block, samples - at)));
  return out;
}

SynthesizerOptions mono() { return {.channels = 1, .floor = 1e-7}; }

double largest_step(std::span<const float> samples) {
  double step = 0.0, before = 0.0;
  for (const float x : samples) step = std::max(step, std::abs(x - before)), before = x;
  return step;
}

/// q̇ at t of a mode that a raised cosine of impulse 1 strikes from t = 0 on: Simpson's rule on Duhamel's integral.
double struck_rate(double hz, double decay, double tau, double t) {
  const double omega = kTwoPi * hz, end = std::min(t, tau);
  if (!(end > 0.0)) return 0.0;
  constexpr int kParts = 4000;
  double sum = 0.0;
  for (int i = 0; i <= kParts; ++i) {
    const double u = end * i / kParts, left = t - u;
    const double force = (1.0 - std::cos(kTwoPi * u / tau)) / tau;
    const double rate = std::exp(-decay * left) * (std::cos(omega * left) - decay / omega * std::sin(omega * left));
    sum += (i == 0 || i == kParts ? 1.0 : i % 2 == 1 ? 4.0 : 2.0) * force * rate;
  }
  return sum * end / kParts / 3.0;
}

TEST(Synthesizer, AStruckModeFollowsDuhamelsIntegralWhileItIsTouchedAndLater) {
  struct Case {
    double hz, decay, tau, delay;
  };
  for (const Case& c : {Case{440.0, 3.0, 2e-3, 0.0}, Case{440.0, 3.0, 2e-3, 0.00123456}, Case{9000.0, 40.0, 5e-6, 1e-4},
                        Case{18000.0, 200.0, 1.7e-4, 3.3e-5}, Case{500.0, 5.0, 1.0 / 500.0, 1e-5}}) {
    Synthesizer synthesizer(mono());
    synthesizer.add_body(sound_of(modes_of({c.hz}, {c.decay})));
    ASSERT_TRUE(synthesizer.strike({.impulse = {1, 0, 0}, .contact_time = c.tau, .delay = c.delay}));
    const auto out = render(synthesizer, 24000);
    const double loudest = *std::ranges::max_element(out);
    for (const std::size_t n : {0u, 1u, 5u, 40u, 100u, 1000u, 23999u})
      EXPECT_NEAR(out[n], struck_rate(c.hz, c.decay, c.tau, static_cast<double>(n) / kRate - c.delay), 1e-6 * loudest)
          << c.hz << " Hz, sample " << n;
  }
}

TEST(Synthesizer, BlowsAddUp) {
  const SoundModes modes = many_modes(40);
  std::vector<float> sum(4800, 0.0f);
  const Blow first{.impulse = {1, 0, 0}, .contact_time = 1e-3, .delay = 0.001},
      second{.impulse = {-0.3, 0, 0}, .contact_time = 3e-3, .delay = 0.0015};
  for (const Blow& s : {first, second}) {
    Synthesizer alone(mono());
    alone.add_body(sound_of(modes));
    alone.strike(s);
    const auto out = render(alone, sum.size());
    for (std::size_t n = 0; n < sum.size(); ++n) sum[n] += out[n];
  }
  Synthesizer both(mono());
  both.add_body(sound_of(modes));
  both.strike(first), both.strike(second);
  const auto out = render(both, sum.size());
  for (std::size_t n = 0; n < sum.size(); ++n) ASSERT_NEAR(out[n], sum[n], 40 * 3 * kSingle);
}

/// Two bodies, blows between samples, a change of gains, and a budget that one of them goes beyond.
std::vector<float> a_busy_second(std::size_t block) {
  Synthesizer synthesizer({.channels = 2, .max_modes = 120, .floor = 1e-5});
  const auto sound = sound_of(many_modes(83));
  synthesizer.add_body(sound), synthesizer.add_body(sound);
  std::vector<float> out;
  for (int part = 0; part < 4; ++part) {
    const double tau = 1e-3 / (part + 1);
    synthesizer.strike({.body = part % 2, .impulse = {1.0 + part, 0, 0}, .contact_time = tau, .delay = 0.01234});
    synthesizer.strike({.body = 1, .impulse = {0.5, 0, 0}, .contact_time = 3 * tau, .delay = 0.0123 * part});
    const std::array<double, 2> gains{1.0, 0.3 * part};
    synthesizer.set_gains(part % 2, gains);
    std::vector<float> piece(2 * 12000);
    for (std::size_t at = 0; at < piece.size(); at += 2 * block)
      synthesizer.render(std::span(piece).subspan(at, std::min(2 * block, piece.size() - at)));
    out.insert(out.end(), piece.begin(), piece.end());
  }
  return out;
}

TEST(Synthesizer, SamplesAreTheSameBitsForAnyBlockSize) {
  const auto expected = a_busy_second(128);
  EXPECT_GT(largest_step(expected), 0.0);
  for (const std::size_t block : {1u, 7u, 64u, 1000u, 12000u})
    EXPECT_TRUE(a_busy_second(block) == expected) << "blocks of " << block;
}

TEST(Synthesizer, SamplesAreTheSameBitsOnInstructionSetsWithFusedMultiplyAdd) {
  std::vector<float> expected;
  for_each_instruction_set([&](std::int64_t target) {
    if (!has_fused_multiply_add(target)) return;
    const auto out = a_busy_second(128);
    if (expected.empty()) expected = out;
    EXPECT_TRUE(out == expected);
  });
}

TEST(Synthesizer, ABlowBeginsWithoutAClick) {
  const SoundModes modes = many_modes(100);
  constexpr double tau = 1e-3;
  Synthesizer synthesizer(mono());
  synthesizer.add_body(sound_of(modes));
  synthesizer.strike({.impulse = {1, 0, 0}, .contact_time = tau, .delay = 0.01});
  const auto out = render(synthesizer, 48000);
  // |q̈| ≤ max force + √λ · max √λ|q|, and a unit impulse gives a mode no more than the rate 1.
  double bound = 0.0;
  for (const double lambda : modes.eigenvalues) bound += (2.0 / tau + std::sqrt(lambda)) / kRate;
  EXPECT_LT(largest_step(out), bound);
  // The first samples rise as t³: the force sets in as t².
  const std::size_t first = 480;
  EXPECT_LT(std::abs(out[first + 1]), 100 * 2.0 * std::pow(kTwoPi / tau, 2) / tau / 6.0 * std::pow(1.0 / kRate, 3));
}

TEST(Synthesizer, ABodyFallsSilentWhereItIsInaudibleWithAStepBelowTheFloor) {
  constexpr double hz = 700.0, decay = 20.0, floor = 1e-3;
  Synthesizer synthesizer({.channels = 1, .floor = floor});
  synthesizer.add_body(sound_of(modes_of({hz}, {decay})));
  synthesizer.strike({.impulse = {1, 0, 0}, .contact_time = 1e-4});
  const auto out = render(synthesizer, 48000);
  EXPECT_TRUE(synthesizer.silent());
  const auto last = std::find_if(out.rbegin(), out.rend(), [](float x) { return x != 0.0f; });
  EXPECT_LE(std::abs(*last), floor);
  const double ended = static_cast<double>(out.rend() - last) / kRate;
  constexpr double kWindow = 64.0 / kRate;
  EXPECT_NEAR(ended, std::log(1.0 / floor) / decay, 2 * kWindow);
}

TEST(Synthesizer, TheQuietestBodyGivesWayWithoutAClick) {
  const auto sound = sound_of(many_modes(64));
  SynthesizerOptions options = mono();
  const auto play = [&](Index max_modes) {
    options.max_modes = max_modes;
    Synthesizer synthesizer(options);
    for (int body = 0; body < 3; ++body) synthesizer.add_body(sound);
    synthesizer.strike({.body = 0, .impulse = {1.0, 0, 0}, .contact_time = 2e-3});
    synthesizer.strike({.body = 1, .impulse = {0.2, 0, 0}, .contact_time = 2e-3});
    synthesizer.strike({.body = 2, .impulse = {1.0, 0, 0}, .contact_time = 2e-3, .delay = 0.05});
    const auto out = render(synthesizer, 9600);
    EXPECT_LE(synthesizer.ringing_modes(), max_modes);
    EXPECT_LE(synthesizer.level(1), synthesizer.level(0));
    return std::pair(out, synthesizer.level(1));
  };
  const auto [all, heard] = play(192);
  const auto [two, stolen] = play(128);
  EXPECT_GT(heard, 0.0);
  EXPECT_EQ(stolen, 0.0);
  // What is taken away is what body 1 gave, no faster than it may swing or fade.
  std::vector<float> taken(all.size());
  std::ranges::transform(all, two, taken.begin(), std::minus<>());
  const double fade = 1.0 / (options.fade * kRate);
  double bound = 0.0;
  for (const double lambda : many_modes(64).eigenvalues) bound += 0.2 * (std::sqrt(lambda) / kRate + fade);
  EXPECT_LT(largest_step(taken), bound);
  EXPECT_GT(*std::ranges::max_element(taken), 0.0f);
}

TEST(Synthesizer, ModesAboveHalfTheSampleRateAreLeftOut) {
  EXPECT_EQ(sound_of(modes_of({1000.0, 23999.0, 24001.0}, {1.0, 1.0, 1.0}))->modes(), 2);
}

TEST(Synthesizer, BlowsAndSamplesAllocateNothing) {
  Synthesizer synthesizer;
  synthesizer.add_body(sound_of(many_modes(50)));
  std::vector<float> out(2 * 4800);
  const std::array<double, 2> gains{0.3, 0.7};
  const long before = testing::allocations();
  for (int i = 0; i < 10; ++i) synthesizer.strike({.impulse = {1, 0, 0}, .delay = 0.003 * i});
  synthesizer.set_gains(0, gains);
  synthesizer.render(out);
  EXPECT_EQ(testing::allocations(), before);
  EXPECT_NE(out[2000], 0.0f);
}

TEST(Synthesizer, TellsThatABlowFoundNoRoom) {
  SynthesizerOptions options = mono();
  options.max_strikes = 2;
  Synthesizer synthesizer(options);
  synthesizer.add_body(sound_of(many_modes(8)));
  const Blow blow{.impulse = {1, 0, 0}, .contact_time = 1e-3};
  EXPECT_TRUE(synthesizer.strike(blow));
  EXPECT_TRUE(synthesizer.strike(blow));
  EXPECT_FALSE(synthesizer.strike(blow));
  render(synthesizer, 100);
  EXPECT_TRUE(synthesizer.strike(blow));
}

TEST(Synthesizer, RefusesWhatIsOutOfRange) {
  Synthesizer synthesizer;
  EXPECT_THROW(synthesizer.add_body(nullptr), InvalidArgument);
  EXPECT_THROW(synthesizer.strike({}), InvalidArgument);
  synthesizer.add_body(sound_of(many_modes(8)));
  EXPECT_THROW(synthesizer.strike({.at = {.vertices = {0, 1, 0}}}), InvalidArgument);
  EXPECT_THROW(synthesizer.strike({.impulse = {NAN, 0, 0}}), InvalidArgument);
  EXPECT_THROW(synthesizer.strike({.contact_time = 0.0}), InvalidArgument);
  EXPECT_THROW(synthesizer.strike({.delay = -1.0}), InvalidArgument);
  EXPECT_THROW(synthesizer.set_gains(0, std::vector<double>{1.0}), InvalidArgument);
  std::vector<float> odd(3);
  EXPECT_THROW(synthesizer.render(odd), InvalidArgument);
  EXPECT_THROW(Synthesizer({.sample_rate = 1.0}), InvalidArgument);
}

TEST(Synthesizer, RefusesModesThatNeverCeaseOrDoNotSwing) {
  SoundModes modes = modes_of({100.0}, {1.0});
  modes.decays = {0.0};
  EXPECT_THROW(sound_of(modes), InvalidArgument);
  modes.decays = {1.01 * std::sqrt(modes.eigenvalues[0])};
  EXPECT_THROW(sound_of(modes), InvalidArgument);
}

}  // namespace
}  // namespace limber
