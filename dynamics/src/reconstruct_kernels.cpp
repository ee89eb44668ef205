#include "reconstruct_kernels.h"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "reconstruct_kernels.cpp"
// Accumulators are arrays of vectors, which vectors of a length unknown to the compiler cannot form: those machines run
// the fixed 128-bit code.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#include <hwy/foreach_target.h>
// foreach_target first
#include <hwy/cache_control.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace limber::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, kTileVertices>;
using Vector = hn::Vec<Floats>;
constexpr std::size_t kLanes = hn::MaxLanes(Floats());

// Instances at a time: three accumulators each must fit the registers beside three shape vectors and an amplitude.
constexpr std::size_t kGroup = HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_SSE4 || HWY_TARGET == HWY_SSSE3 ? 4 : 8;

// The stream's distance ahead that reached the memory's read rate for one body, in floats.
constexpr std::size_t kPrefetch = 2048 / sizeof(float);
constexpr std::size_t kLine = 64 / sizeof(float);

// p = R (rest + u) + t for kLanes vertices from `vertex` on; the surface's last vertices go through a buffer, so that
// nothing is written (or read) past the end.
HWY_INLINE HWY_ATTR void StoreTransformed(const TileRange& range, const InstanceOutput& out, std::size_t vertex,
                                          Vector ux, Vector uy, Vector uz) {
  const Floats d;
  const float* rest = range.rest + 3 * vertex;
  float* positions = out.positions + 3 * vertex;
  const bool partial = vertex + kLanes > range.vertices;
  HWY_ALIGN float buffer[3 * kLanes] = {};
  if (HWY_UNLIKELY(partial)) {
    std::copy_n(rest, 3 * (range.vertices - vertex), buffer);
    rest = buffer;
  }
  Vector x, y, z;
  hn::LoadInterleaved3(d, rest, x, y, z);
  x = hn::Add(x, ux), y = hn::Add(y, uy), z = hn::Add(z, uz);
  const auto row = [&](const float* r, float t) HWY_ATTR {
    return hn::MulAdd(hn::Set(d, r[0]), x,
                      hn::MulAdd(hn::Set(d, r[1]), y, hn::MulAdd(hn::Set(d, r[2]), z, hn::Set(d, t))));
  };
  const Vector px = row(out.rotation, out.translation[0]);
  const Vector py = row(out.rotation + 3, out.translation[1]);
  const Vector pz = row(out.rotation + 6, out.translation[2]);
  if (HWY_LIKELY(!partial)) {
    hn::StoreInterleaved3(px, py, pz, d, positions);
  } else {
    hn::StoreInterleaved3(px, py, pz, d, buffer);
    std::copy_n(buffer, 3 * (range.vertices - vertex), positions);
  }
}

// kLanes vertices of N instances. The displacement is summed from zero and the rest position added last: the sum then
// rounds relative to the displacement, which is the smaller.
template <std::size_t N>
HWY_INLINE HWY_ATTR void ManyInstances(const TileRange& range, std::size_t tile, std::size_t lane, std::size_t first) {
  const Floats d;
  Vector u[3 * N];
  for (std::size_t i = 0; i < 3 * N; ++i) u[i] = hn::Zero(d);
  const float* shape = range.basis + tile * range.modes * 3 * kTileVertices + lane;
  const float* amplitude = range.amplitudes + first;
  for (std::size_t m = 0; m < range.modes; ++m, shape += 3 * kTileVertices, amplitude += range.instances) {
    const Vector x = hn::Load(d, shape), y = hn::Load(d, shape + kTileVertices),
                 z = hn::Load(d, shape + 2 * kTileVertices);
    for (std::size_t i = 0; i < N; ++i) {
      const Vector a = hn::Set(d, amplitude[i]);
      u[3 * i] = hn::MulAdd(x, a, u[3 * i]);
      u[3 * i + 1] = hn::MulAdd(y, a, u[3 * i + 1]);
      u[3 * i + 2] = hn::MulAdd(z, a, u[3 * i + 2]);
    }
  }
  for (std::size_t i = 0; i < N; ++i)
    StoreTransformed(range, range.outputs[first + i], tile * kTileVertices + lane, u[3 * i], u[3 * i + 1],
                     u[3 * i + 2]);
}

// A whole tile of one instance: bound by the stream of shapes, which is prefetched.
HWY_INLINE HWY_ATTR void OneInstance(const TileRange& range, std::size_t tile, std::size_t instance) {
  const Floats d;
  constexpr std::size_t kParts = kTileVertices / kLanes;
  Vector u[3 * kParts];
  for (std::size_t i = 0; i < 3 * kParts; ++i) u[i] = hn::Zero(d);
  const float* shape = range.basis + tile * range.modes * 3 * kTileVertices;
  const float* amplitude = range.amplitudes + instance;
  for (std::size_t m = 0; m < range.modes; ++m, shape += 3 * kTileVertices, amplitude += range.instances) {
    for (std::size_t line = 0; line < 3 * kTileVertices; line += kLine) hwy::Prefetch(shape + kPrefetch + line);
    const Vector a = hn::Set(d, *amplitude);
    for (std::size_t i = 0; i < 3 * kParts; ++i) u[i] = hn::MulAdd(hn::Load(d, shape + i * kLanes), a, u[i]);
  }
  for (std::size_t part = 0; part < kParts; ++part) {
    const std::size_t vertex = tile * kTileVertices + part * kLanes;
    if (vertex < range.vertices)
      StoreTransformed(range, range.outputs[instance], vertex, u[part], u[kParts + part], u[2 * kParts + part]);
  }
}

template <std::size_t N>
HWY_INLINE HWY_ATTR void WholeTile(const TileRange& range, std::size_t tile, std::size_t first) {
  const std::size_t last_lane = std::min(kTileVertices, range.vertices - tile * kTileVertices);
  for (std::size_t lane = 0; lane < last_lane; lane += kLanes) ManyInstances<N>(range, tile, lane, first);
}

HWY_ATTR void ReconstructTiles(const TileRange& range) {
  for (std::size_t tile = range.first_tile; tile < range.last_tile; ++tile) {
    std::size_t i = 0;
    for (; i + kGroup <= range.instances; i += kGroup) WholeTile<kGroup>(range, tile, i);
    if (i + 4 <= range.instances) WholeTile<4>(range, tile, i), i += 4;
    if (i + 2 <= range.instances) WholeTile<2>(range, tile, i), i += 2;
    if (i < range.instances) OneInstance(range, tile, i);
  }
}

}  // namespace limber::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace limber {

HWY_EXPORT(ReconstructTiles);

void reconstruct_tiles(const TileRange& range) { HWY_DYNAMIC_DISPATCH(ReconstructTiles)(range); }

}  // namespace limber
#endif  // HWY_ONCE
