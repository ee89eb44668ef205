#include "machine_limits.h"

#include <memory>
#include <new>

#include "cpu_time.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "machine_limits.cpp"
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)  // no arrays of those vectors
#include <hwy/foreach_target.h>
// foreach_target first
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace limber::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::ScalableTag<float>;
constexpr std::size_t kChains = 12;  // independent: more than latency × units, fewer than registers

// Operations done by `rounds` rounds; *result keeps the compiler from leaving them out.
HWY_ATTR double MultiplyAdd(std::size_t rounds, float* result) {
  const Floats d;
  const auto a = hn::Set(d, 0.999f), b = hn::Set(d, 0.001f);
  hn::Vec<Floats> chain[kChains];
  for (auto& c : chain) c = hn::Set(d, 1.0f);
  for (std::size_t r = 0; r < rounds; ++r)
    for (auto& c : chain) c = hn::MulAdd(c, a, b);
  auto sum = hn::Zero(d);
  for (const auto& c : chain) sum = hn::Add(sum, c);
  *result = hn::GetLane(sum);
  return 2.0 * kChains * static_cast<double>(hn::Lanes(d) * rounds);
}

HWY_ATTR float Sum(const float* HWY_RESTRICT data, std::size_t count) {
  const Floats d;
  hn::Vec<Floats> chain[8];
  for (auto& c : chain) c = hn::Zero(d);
  const std::size_t step = 8 * hn::Lanes(d);
  for (std::size_t i = 0; i + step <= count; i += step)
    for (std::size_t j = 0; j < 8; ++j) chain[j] = hn::Add(chain[j], hn::Load(d, data + i + j * hn::Lanes(d)));
  for (std::size_t j = 1; j < 8; ++j) chain[0] = hn::Add(chain[0], chain[j]);
  return hn::GetLane(chain[0]);
}

}  // namespace limber::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace limber {
namespace {

HWY_EXPORT(MultiplyAdd);
HWY_EXPORT(Sum);

constexpr double kMeasuringTime = 0.1;  // s

struct Release {
  void operator()(float* p) const { ::operator delete[](p, std::align_val_t{64}); }
};

volatile float sink = 0.0f;

}  // namespace

double peak_float_operations_per_second() {
  static const double peak = [] {
    constexpr std::size_t kRounds = 200'000;
    LeastTime time;
    double operations = 0.0;
    float result = 0.0f;
    for (const double start = thread_seconds(); thread_seconds() - start < kMeasuringTime;) {
      time.measure([&] { operations = HWY_DYNAMIC_DISPATCH(MultiplyAdd)(kRounds, &result); });
      sink = result;
    }
    return operations / time.seconds();
  }();
  return peak;
}

double read_bytes_per_second(std::size_t bytes) {
  const std::size_t count = std::max<std::size_t>(1024, bytes / sizeof(float) / 1024 * 1024);
  const std::size_t repeats = 1 + (std::size_t{1} << 24) / (count * sizeof(float));  // a pass reads 16 MiB or more
  const std::unique_ptr<float[], Release> data(
      static_cast<float*>(::operator new[](count * sizeof(float), std::align_val_t{64})));
  std::fill_n(data.get(), count, 1.0f);
  LeastTime time;
  int passes = 0;
  for (const double start = thread_seconds(); passes < 4 || thread_seconds() - start < kMeasuringTime; ++passes)
    time.measure([&] {
      for (std::size_t r = 0; r < repeats; ++r) sink = HWY_DYNAMIC_DISPATCH(Sum)(data.get(), count);
    });
  return static_cast<double>(count * sizeof(float) * repeats) / time.seconds();
}

}  // namespace limber
#endif  // HWY_ONCE
