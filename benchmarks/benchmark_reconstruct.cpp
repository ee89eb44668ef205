// Time of making deformed vertices: one body, many instances of one body, normals. See README.md.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "cpu_time.h"
#include "limber/dynamics/half_basis.h"
#include "limber/dynamics/reconstruct.h"
#include "machine_limits.h"

namespace limber {
namespace {

constexpr Index kVertices = 2600;
constexpr std::size_t kColdBytes = std::size_t{96} << 20;     // of bases, thrice the last-level cache
constexpr std::size_t kMemoryBytes = std::size_t{256} << 20;  // for the memory's own rate

std::size_t basis_bytes(Index modes) {
  return static_cast<std::size_t>((kVertices + ModalBasis::kTile - 1) / ModalBasis::kTile) * modes * 3 *
         ModalBasis::kTile * sizeof(float);
}

/// A wavy sheet of 52 × 50 vertices, modes of rising wave number.
ModalSurface sheet(Index modes) {
  constexpr Index kColumns = 52, kRows = kVertices / kColumns;
  ModalSurface surface{.rest = {}, .triangles = {}, .basis = ModalBasis(kVertices, modes)};
  for (Index v = 0; v < kVertices; ++v) {
    const float x = static_cast<float>(v % kColumns) / kColumns, y = static_cast<float>(v / kColumns) / kRows;
    surface.rest.emplace_back(x, y, 0.1f * std::sin(9.0f * x));
    for (Index m = 0; m < modes; ++m) {
      const float wave = static_cast<float>(1 + m);
      surface.basis.set(v, m, {0.1f * std::sin(wave * y), 0.1f * std::cos(wave * x), std::sin(wave * (x + y))});
    }
    if (v % kColumns + 1 < kColumns && v + kColumns < kVertices) {
      surface.triangles.push_back({v, v + 1, v + kColumns});
      surface.triangles.push_back({v + 1, v + kColumns + 1, v + kColumns});
    }
  }
  return surface;
}

/// Instances of one surface, each with amplitudes and vertices of its own.
struct Instances {
  std::vector<double> amplitudes;
  std::vector<float> positions;
  std::vector<ReconstructionTarget> targets;

  Instances(Index modes, Index count)
      : amplitudes(static_cast<std::size_t>(modes) * count), positions(std::size_t{3} * kVertices * count) {
    for (std::size_t i = 0; i < amplitudes.size(); ++i) amplitudes[i] = 0.01 * std::sin(static_cast<double>(i));
    for (Index b = 0; b < count; ++b)
      targets.push_back({.X_OB = {quaternion_from_rotation_vector({0.1 * b, 0.2, 0.3}), {1.0 * b, 0.0, 0.0}},
                         .amplitudes = amplitudes.data() + std::size_t{1} * modes * b,
                         .positions = positions.data() + std::size_t{3} * kVertices * b});
  }
};

/// range(0) modes; bound by reading the basis, from the cache that holds it or from memory.
void one_body(benchmark::State& state, bool cold) {
  const Index modes = static_cast<Index>(state.range(0));
  const std::size_t copies = cold ? 1 + kColdBytes / basis_bytes(modes) : 1;
  std::vector<ModalSurface> surfaces;
  for (std::size_t i = 0; i < copies; ++i) surfaces.push_back(sheet(modes));
  Instances instances(modes, 1);
  LeastTime time;
  const std::size_t per_pass = std::max<std::size_t>(copies / 4, 10);
  std::size_t next = 0;
  for (auto _ : state)
    time.measure([&] {
      for (std::size_t i = 0; i < per_pass; ++i, ++next) reconstruct(surfaces[next % copies], instances.targets);
    });
  const double seconds = time.seconds() / static_cast<double>(per_pass);
  const double limit = read_bytes_per_second(cold ? kMemoryBytes : basis_bytes(modes));
  state.counters["ns"] = 1e9 * seconds / kVertices;
  state.counters["GB_per_s"] = 1e-9 * static_cast<double>(basis_bytes(modes)) / seconds;
  state.counters["of_read"] = static_cast<double>(basis_bytes(modes)) / limit / seconds;
}
/// The same cold, from bases in half precision, beside single precision in the same run.
void one_body_half(benchmark::State& state) {
  const Index modes = static_cast<Index>(state.range(0));
  const std::size_t copies = 1 + kColdBytes / basis_bytes(modes);
  std::vector<ModalSurface> surfaces;
  std::vector<HalfBasis> halves;
  for (std::size_t i = 0; i < copies; ++i) surfaces.push_back(sheet(modes)), halves.emplace_back(surfaces[i].basis);
  Instances instances(modes, 1);
  LeastTime in_half, in_single;
  const std::size_t per_pass = std::max<std::size_t>(copies / 4, 10);
  std::size_t next = 0, first = 0;
  for (auto _ : state) {
    in_half.measure([&] {
      for (std::size_t i = 0; i < per_pass; ++i, ++next)
        reconstruct(surfaces[next % copies], halves[next % copies], instances.targets);
    });
    in_single.measure([&] {
      for (std::size_t i = 0; i < per_pass; ++i, ++first) reconstruct(surfaces[first % copies], instances.targets);
    });
  }
  state.counters["ns"] = 1e9 * in_half.seconds() / static_cast<double>(per_pass) / kVertices;
  state.counters["of_single"] = in_half.seconds() / in_single.seconds();
}
void one_body_hot(benchmark::State& state) { one_body(state, false); }
void one_body_cold(benchmark::State& state) { one_body(state, true); }

/// range(0) modes, range(1) instances; bound by the multiply-adds of U z, which alone are counted.
void many_instances(benchmark::State& state) {
  const Index modes = static_cast<Index>(state.range(0)), count = static_cast<Index>(state.range(1));
  const ModalSurface surface = sheet(modes);
  Instances instances(modes, count);
  const int repeats = 1 + 64 / count;
  LeastTime time;
  for (auto _ : state)
    time.measure([&] {
      for (int r = 0; r < repeats; ++r) reconstruct(surface, instances.targets);
    });
  const double seconds = time.seconds() / repeats, vertices = static_cast<double>(kVertices) * count;
  const double operations = 6.0 * modes * vertices;
  state.counters["ns"] = 1e9 * seconds / vertices;
  state.counters["ms"] = 1e3 * seconds;
  state.counters["of_peak"] = operations / peak_float_operations_per_second() / seconds;
}

/// Handles in stripes along x that turn as the modes say; each vertex hangs on the two or three that are near.
ModalSkin striped_skin(const ModalSurface& surface, Index handles) {
  const auto n = static_cast<std::size_t>(handles), k = static_cast<std::size_t>(surface.basis.modes());
  ModalSkin skin;
  skin.handles = handles, skin.modes = surface.basis.modes();
  for (Index h = 0; h < handles; ++h) skin.rest.emplace_back((h + 0.5) / handles, 0.5, 0.0);
  skin.rotations.assign(3 * n * k, 0.1f);
  skin.arms.assign(3 * n * n, 0.01f);
  skin.shifts.assign(3 * n * n * k, 0.001f);
  std::vector<double> weights(n);
  for (const Vec3f& r : surface.rest) {
    for (std::size_t h = 0; h < n; ++h)
      weights[h] = std::max(0.0, 1.5 - handles * std::abs(static_cast<double>(r.x()) - skin.rest[h].x()));
    skin.render.push_back(skin_influences(weights));
  }
  return skin;
}

/// range(0) modes, range(1) handles: a body with a skin, and how many times that is one without.
void skinned(benchmark::State& state) {
  const ModalSurface surface = sheet(static_cast<Index>(state.range(0)));
  const ModalSkin skin = striped_skin(surface, static_cast<Index>(state.range(1)));
  const SkinTiles influences(skin.render);
  Instances plain(surface.basis.modes(), 1), bent(surface.basis.modes(), 1);
  SkinPose pose(skin);
  pose.set(bent.amplitudes);
  bent.targets[0].skin = &pose;
  LeastTime linear, skinned, handles, derivative;
  constexpr int kRepeats = 20;
  const auto measure = [](LeastTime& time, const auto& work) {
    time.measure([&] {
      for (int r = 0; r < kRepeats; ++r) work();
    });
  };
  for (auto _ : state) {
    measure(linear, [&] { reconstruct(surface, plain.targets); });
    measure(skinned, [&] { reconstruct(surface, influences, bent.targets); });
    measure(handles, [&] { pose.set(bent.amplitudes); });
    measure(derivative, [&] { pose.differentiate(); });
  }
  state.counters["ns"] = 1e9 * skinned.seconds() / (kRepeats * kVertices);
  state.counters["of_linear"] = skinned.seconds() / linear.seconds();
  state.counters["handles_us"] = 1e6 * handles.seconds() / kRepeats;
  state.counters["derivative_us"] = 1e6 * derivative.seconds() / kRepeats;
}

void normals(benchmark::State& state) {
  const ModalSurface surface = sheet(8);
  Instances instances(8, 1);
  reconstruct(surface, instances.targets);
  std::vector<float> result(instances.positions.size());
  LeastTime time;
  constexpr int kRepeats = 10;
  for (auto _ : state)
    time.measure([&] {
      for (int r = 0; r < kRepeats; ++r) vertex_normals(surface.triangles, instances.positions, result);
    });
  state.counters["ns"] = 1e9 * time.seconds() / (kRepeats * kVertices);
}

BENCHMARK(one_body_hot)->ArgName("modes")->Arg(8)->Arg(20)->Arg(32)->Arg(64);
BENCHMARK(one_body_cold)->ArgName("modes")->Arg(8)->Arg(20)->Arg(32)->Arg(64);
BENCHMARK(one_body_half)->ArgName("modes")->Arg(8)->Arg(20)->Arg(32)->Arg(64);
BENCHMARK(many_instances)->ArgNames({"modes", "instances"})->ArgsProduct({{8, 20, 32, 64}, {8, 64, 1000}});
BENCHMARK(skinned)->ArgNames({"modes", "handles"})->ArgsProduct({{8, 20, 40}, {12, 24}});
BENCHMARK(normals);

}  // namespace
}  // namespace limber
