// Time of sound: modes that ring, per second of samples, and a blow. See README.md.
#include <benchmark/benchmark.h>

#include <cmath>
#include <vector>

#include "cpu_time.h"
#include "limber/sound/synthesizer.h"

namespace limber {
namespace {

/// `count` modes of 40 Hz to 18 kHz of one vertex, that ring on.
std::shared_ptr<const ModalSound> sound(Index count) {
  SoundModes modes{.eigenvalues = {}, .decays = {}, .shapes = {}, .vertices = 1};
  for (Index k = 0; k < count; ++k) {
    const double omega = 6.2832 * 40.0 * std::pow(450.0, static_cast<double>(k) / count);
    modes.eigenvalues.push_back(omega * omega), modes.decays.push_back(1e-6);
    modes.shapes.insert(modes.shapes.end(), {1.0f, 0.0f, 0.0f});
  }
  return std::make_shared<ModalSound>(modes, std::vector<double>(static_cast<std::size_t>(count), 1.0), 48e3);
}

/// range(0) modes in each of range(1) bodies, in blocks of 128 samples.
void ring(benchmark::State& state) {
  const auto modes = static_cast<Index>(state.range(0)), bodies = static_cast<Index>(state.range(1));
  Synthesizer synthesizer({.max_modes = 1 << 20});
  const auto shared = sound(modes);
  for (Index b = 0; b < bodies; ++b) {
    synthesizer.add_body(shared);
    synthesizer.strike({.body = b, .impulse = {1, 0, 0}, .contact_time = 1e-4});
  }
  std::vector<float> block(2 * 128);
  LeastTime time;
  for (auto _ : state)
    time.measure([&] {
      for (int i = 0; i < 25; ++i) synthesizer.render(block);
    });
  if (synthesizer.ringing_modes() < modes * bodies) state.SkipWithError("modes fell silent");
  const double audio = 25 * 128 / 48e3;
  state.counters["percent_of_core"] = 100.0 * time.seconds() / audio;
  state.counters["ns_per_mode_and_sample"] = 1e9 * time.seconds() / (25.0 * 128.0 * modes * bodies);
}

/// A blow on range(0) modes: what the block in which it begins and ends takes more.
void strike(benchmark::State& state) {
  const auto modes = static_cast<Index>(state.range(0));
  Synthesizer synthesizer;
  synthesizer.add_body(sound(modes));
  std::vector<float> block(2 * 64);
  LeastTime with, without;
  for (auto _ : state) {
    synthesizer.strike({.impulse = {1, 0, 0}, .contact_time = 1e-4});
    with.measure([&] { synthesizer.render(block); });
    without.measure([&] { synthesizer.render(block); });
  }
  state.counters["us"] = 1e6 * (with.seconds() - without.seconds());
}

BENCHMARK(ring)->ArgNames({"modes", "bodies"})->Args({1000, 1})->Args({100, 10})->Args({20, 50});
BENCHMARK(strike)->ArgName("modes")->Arg(20)->Arg(1000);

}  // namespace
}  // namespace limber
