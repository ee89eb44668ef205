// Time of the oscillators: a step of many modes by the propagator table, and making a propagator. See README.md.
#include <benchmark/benchmark.h>

#include <cmath>
#include <vector>

#include "cpu_time.h"
#include "limber/dynamics/oscillator.h"
#include "machine_limits.h"

namespace limber {
namespace {

/// `modes` modes of 1 Hz to 30 kHz and 1 % damping.
struct Spectrum {
  std::vector<double> lambda, decay;

  explicit Spectrum(Index modes) {
    for (Index i = 0; i < modes; ++i) {
      const double omega = 6.283 * std::pow(30e3, static_cast<double>(i) / modes);
      lambda.push_back(omega * omega), decay.push_back(0.01 * omega);
    }
  }
};

/// Rows of `padded` doubles per instance, 64-byte aligned.
class Rows {
 public:
  Rows(Index padded, Index instances)
      : blocks_(static_cast<std::size_t>(padded / kBlock) * instances), padded_(padded) {}
  double* of(Index instance) { return blocks_[static_cast<std::size_t>(instance) * (padded_ / kBlock)].value; }

 private:
  static constexpr Index kBlock = PropagatorTable::kPad;
  struct alignas(64) Block {
    double value[kBlock] = {};
  };
  std::vector<Block> blocks_;
  Index padded_;
};

/// range(0) modes, range(1) instances that share the table; forced or free.
void table(benchmark::State& state, bool forced) {
  const Index modes = static_cast<Index>(state.range(0)), instances = static_cast<Index>(state.range(1));
  const Spectrum spectrum(modes);
  const PropagatorTable propagators(spectrum.lambda, spectrum.decay, 1.0 / 60.0);
  const Index padded = propagators.padded();
  Rows z(padded, instances), zdot(padded, instances), g(padded, instances);
  for (Index b = 0; b < instances; ++b)
    for (Index i = 0; i < modes; ++i) z.of(b)[i] = 1.0, g.of(b)[i] = forced ? 1e-3 : 0.0;
  const int repeats = 1 + 320'000 / (modes * instances);  // a pass of 100 µs or more
  LeastTime time;
  for (auto _ : state)
    time.measure([&] {
      for (int r = 0; r < repeats; ++r)
        for (Index b = 0; b < instances; ++b)
          if (forced)
            propagators.advance(z.of(b), zdot.of(b), g.of(b));
          else
            propagators.advance_free(z.of(b), zdot.of(b));
    });
  const double seconds = time.seconds() / (static_cast<double>(modes) * instances * repeats);
  // Bytes that a step must read: the coefficients (once for all instances at best, here from the nearest cache) and the
  // state.
  const double rows = forced ? 3.0 : 2.0, coefficients = forced ? 5.0 : 4.0;
  const double bytes = 8.0 * (rows + coefficients);
  const auto working_set = static_cast<std::size_t>(8.0 * modes * (rows * instances + coefficients));
  state.counters["ns"] = 1e9 * seconds;
  state.counters["of_read"] = bytes / read_bytes_per_second(working_set) / seconds;
}
void advance_forced(benchmark::State& state) { table(state, true); }
void advance_free(benchmark::State& state) { table(state, false); }

/// One propagator, the regime by the damping ratio range(0)/100.
void make_propagator(benchmark::State& state) {
  const double ratio = static_cast<double>(state.range(0)) / 100.0;
  constexpr int kCount = 4000;
  LeastTime time;
  for (auto _ : state)
    time.measure([&] {
      for (int i = 0; i < kCount; ++i) {
        const double omega = 1.0 + i;
        benchmark::DoNotOptimize(propagator({.lambda = omega * omega, .decay = ratio * omega}, 1.0 / 60.0));
      }
    });
  state.counters["ns"] = 1e9 * time.seconds() / kCount;
}

BENCHMARK(advance_forced)
    ->ArgNames({"modes", "instances"})
    ->Args({32, 1})
    ->Args({32, 100})
    ->Args({32, 1000})
    ->Args({1000, 1});
BENCHMARK(advance_free)
    ->ArgNames({"modes", "instances"})
    ->Args({32, 1})
    ->Args({32, 100})
    ->Args({32, 1000})
    ->Args({1000, 1});
BENCHMARK(make_propagator)->ArgName("damping_percent")->Arg(1)->Arg(100)->Arg(101)->Arg(1000);

}  // namespace
}  // namespace limber
