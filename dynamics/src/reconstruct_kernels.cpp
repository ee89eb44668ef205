#include "reconstruct_kernels.h"

#include <algorithm>
#include <cstdint>
#include <limits>

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
namespace limber::internal::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, kTileVertices>;
using Vector = hn::Vec<Floats>;
constexpr std::size_t kLanes = hn::MaxLanes(Floats());

// Instances at a time: three accumulators each must fit the registers beside three shape vectors and an amplitude.
constexpr std::size_t kGroup = HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_SSE4 || HWY_TARGET == HWY_SSSE3 ? 4 : 8;

// The stream's distance ahead that reached the memory's read rate for one body.
constexpr std::size_t kPrefetchBytes = 2048;

struct Points {
  Vector x, y, z;
};

// Source of the shapes: single precision, or half, which is widened as it is read.
struct FloatShapes {
  using Number = float;
  static HWY_INLINE const Number* Start(const TileRange& range) { return range.basis; }
  static HWY_INLINE HWY_ATTR Vector Load(const Number* p) { return hn::Load(Floats(), p); }
};
struct HalfShapes {
  using Number = std::uint16_t;
  static HWY_INLINE const Number* Start(const TileRange& range) { return range.half_basis; }
  static HWY_INLINE HWY_ATTR Vector Load(const Number* p) {
    const hn::Rebind<hwy::float16_t, Floats> halves;
    const hn::Rebind<std::uint16_t, Floats> words;
    return hn::PromoteTo(Floats(), hn::BitCast(halves, hn::LoadU(words, p)));
  }
};

// kLanes points from `vertex` on, of an array over the surface's vertices; past the last one nothing is read.
HWY_INLINE HWY_ATTR Points LoadPoints(const TileRange& range, const float* of, std::size_t vertex) {
  const Floats d;
  Points p;
  if (HWY_LIKELY(vertex + kLanes <= range.vertices)) {
    hn::LoadInterleaved3(d, of + 3 * vertex, p.x, p.y, p.z);
  } else {
    HWY_ALIGN float buffer[3 * kLanes] = {};
    std::copy_n(of + 3 * vertex, 3 * (range.vertices - vertex), buffer);
    hn::LoadInterleaved3(d, buffer, p.x, p.y, p.z);
  }
  return p;
}

// a × b + c.
HWY_INLINE HWY_ATTR Points CrossAdd(const Points& a, const Points& b, const Points& c) {
  return {hn::MulAdd(a.y, b.z, hn::NegMulAdd(a.z, b.y, c.x)), hn::MulAdd(a.z, b.x, hn::NegMulAdd(a.x, b.z, c.y)),
          hn::MulAdd(a.x, b.y, hn::NegMulAdd(a.y, b.x, c.z))};
}

HWY_INLINE HWY_ATTR Points Added(const Points& a, const Points& b) {
  return {hn::Add(a.x, b.x), hn::Add(a.y, b.y), hn::Add(a.z, b.z)};
}

// Places that handles give vertices that the modes move by u: their numbers are blended first, then applied.
HWY_INLINE HWY_ATTR Points Skinned(const TileRange& range, const InstanceOutput& out, std::size_t vertex,
                                   const Points& rest, const Points& u) {
  const Floats d;
  const std::size_t tile = vertex / kTileVertices, lane = vertex % kTileVertices;
  // Two halves, as compilers unroll loops of up to sixteen rounds, and only then keep sums in registers.
  constexpr std::size_t kHalf = kHandleNumbers / 2;
  Vector turn[kHalf], moves[kHalf];
  for (std::size_t i = 0; i < kHalf; ++i) turn[i] = moves[i] = hn::Zero(d);
  const TileInfluences& in = range.influences;
  for (std::uint32_t e = in.starts[tile]; e < in.starts[tile + 1]; ++e) {
    const Vector weight = hn::Load(d, in.weights + e * kTileVertices + lane);
    const float* handle = out.handles + kHandleNumbers * in.handle[e];
    for (std::size_t i = 0; i < kHalf; ++i) turn[i] = hn::MulAdd(weight, hn::Set(d, handle[i]), turn[i]);
    for (std::size_t i = 0; i < kHalf; ++i) moves[i] = hn::MulAdd(weight, hn::Set(d, handle[kHalf + i]), moves[i]);
  }
  const Points shift{moves[0], moves[1], moves[2]}, angle{moves[3], moves[4], moves[5]},
      drift{moves[6], moves[7], moves[8]};
  const Points shown = CrossAdd(angle, rest, drift);  // what the handles show of u
  const Points y{hn::Add(rest.x, hn::Sub(u.x, shown.x)), hn::Add(rest.y, hn::Sub(u.y, shown.y)),
                 hn::Add(rest.z, hn::Sub(u.z, shown.z))};
  const auto row = [&](const Vector* r, Vector t)
                       HWY_ATTR { return hn::MulAdd(r[0], y.x, hn::MulAdd(r[1], y.y, hn::MulAdd(r[2], y.z, t))); };
  return Added(y, {row(turn, shift.x), row(turn + 3, shift.y), row(turn + 6, shift.z)});
}

// Rest positions, moved by the modes' sum u, by what an instance adds to it, and by its handles.
HWY_INLINE HWY_ATTR Points Displaced(const TileRange& range, const InstanceOutput& out, std::size_t vertex,
                                     const Points& rest, Points u) {
  if (HWY_UNLIKELY(out.displacement != nullptr)) {
    const Points more = LoadPoints(range, out.displacement, vertex);
    u = Added(u, more);
  }
  if (HWY_UNLIKELY(out.handles != nullptr)) return Skinned(range, out, vertex, rest, u);
  return Added(rest, u);
}

// Stores kLanes points as x y z x y z … in three vectors. Component c of point e belongs to lane (3e + c) mod kLanes of
// one of them, and as kLanes is no multiple of 3, the points of one component all belong to different lanes: so one
// permutation per component, and selections by lane. (Highway's own takes three times as many shuffles at 512 bits.)
class Interleave {
 public:
  HWY_INLINE HWY_ATTR Interleave() : order_{Order(0), Order(1), Order(2)}, first_(Lanes(0)), second_(Lanes(1)) {}

  HWY_INLINE HWY_ATTR void Store(const Points& p, float* to) const {
    const Floats d;
    const Vector part[3] = {hn::TableLookupLanes(p.x, order_[0]), hn::TableLookupLanes(p.y, order_[1]),
                            hn::TableLookupLanes(p.z, order_[2])};
    for (std::size_t v = 0; v < 3; ++v) {
      const std::size_t c = v * kLanes;  // lane i holds component (c + i) mod 3
      hn::StoreU(hn::IfThenElse(first_, part[c % 3], hn::IfThenElse(second_, part[(c + 1) % 3], part[(c + 2) % 3])), d,
                 to + v * kLanes);
    }
  }

 private:
  using Indices = decltype(hn::SetTableIndices(Floats(), static_cast<const std::int32_t*>(nullptr)));
  using LaneMask = hn::Mask<Floats>;

  static HWY_INLINE HWY_ATTR Indices Order(std::size_t component) {
    HWY_ALIGN std::int32_t point_of_lane[kLanes];
    for (std::size_t e = 0; e < kLanes; ++e) point_of_lane[(3 * e + component) % kLanes] = static_cast<std::int32_t>(e);
    return hn::SetTableIndices(Floats(), point_of_lane);
  }
  // The lanes whose number is `remainder` modulo 3.
  static HWY_INLINE HWY_ATTR LaneMask Lanes(std::size_t remainder) {
    const Floats d;
    HWY_ALIGN float is[kLanes];
    for (std::size_t i = 0; i < kLanes; ++i) is[i] = i % 3 == remainder ? 1.0f : 0.0f;
    return hn::Gt(hn::Load(d, is), hn::Zero(d));
  }

  Indices order_[3];
  LaneMask first_, second_;
};

// R p + t → positions of kLanes vertices from `vertex` on; past the surface's last vertex nothing is written.
HWY_INLINE HWY_ATTR void StoreTransformed(const TileRange& range, const InstanceOutput& out, std::size_t vertex,
                                          const Points& p, const Interleave& interleave) {
  const Floats d;
  const auto row = [&](const float* r, float t) HWY_ATTR {
    return hn::MulAdd(hn::Set(d, r[0]), p.x,
                      hn::MulAdd(hn::Set(d, r[1]), p.y, hn::MulAdd(hn::Set(d, r[2]), p.z, hn::Set(d, t))));
  };
  const Points q{row(out.rotation, out.translation[0]), row(out.rotation + 3, out.translation[1]),
                 row(out.rotation + 6, out.translation[2])};
  float* positions = out.positions + 3 * vertex;
  if (HWY_LIKELY(vertex + kLanes <= range.vertices)) {
    interleave.Store(q, positions);
  } else {
    HWY_ALIGN float buffer[3 * kLanes];
    interleave.Store(q, buffer);
    std::copy_n(buffer, 3 * (range.vertices - vertex), positions);
  }
}

// kLanes vertices of N instances. The displacement is summed from zero and the rest position added last: the sum then
// rounds relative to the displacement, which is the smaller.
template <class Shapes, std::size_t N>
HWY_INLINE HWY_ATTR void ManyInstances(const TileRange& range, std::size_t tile, std::size_t lane, std::size_t first) {
  const Floats d;
  Vector u[3 * N];
  for (std::size_t i = 0; i < 3 * N; ++i) u[i] = hn::Zero(d);
  const auto* shape = Shapes::Start(range) + tile * range.stored_modes * 3 * kTileVertices + lane;
  const float* amplitude = range.amplitudes + first;
  for (std::size_t m = 0; m < range.modes; ++m, shape += 3 * kTileVertices, amplitude += range.instances) {
    const Vector x = Shapes::Load(shape), y = Shapes::Load(shape + kTileVertices),
                 z = Shapes::Load(shape + 2 * kTileVertices);
    for (std::size_t i = 0; i < N; ++i) {
      const Vector a = hn::Set(d, amplitude[i]);
      u[3 * i] = hn::MulAdd(x, a, u[3 * i]);
      u[3 * i + 1] = hn::MulAdd(y, a, u[3 * i + 1]);
      u[3 * i + 2] = hn::MulAdd(z, a, u[3 * i + 2]);
    }
  }
  const std::size_t vertex = tile * kTileVertices + lane;
  const Points rest = LoadPoints(range, range.rest, vertex);
  const Interleave interleave;
  for (std::size_t i = 0; i < N; ++i) {
    const InstanceOutput& out = range.outputs[first + i];
    StoreTransformed(range, out, vertex, Displaced(range, out, vertex, rest, {u[3 * i], u[3 * i + 1], u[3 * i + 2]}),
                     interleave);
  }
}

// A whole tile of one instance: bound by the stream of shapes, which is prefetched.
template <class Shapes>
HWY_INLINE HWY_ATTR void OneInstance(const TileRange& range, std::size_t tile, std::size_t instance) {
  const Floats d;
  constexpr std::size_t kParts = kTileVertices / kLanes;
  Vector u[3 * kParts];
  for (std::size_t i = 0; i < 3 * kParts; ++i) u[i] = hn::Zero(d);
  constexpr std::size_t kAhead = kPrefetchBytes / sizeof(typename Shapes::Number);
  constexpr std::size_t kLine = 64 / sizeof(typename Shapes::Number);
  const auto* shape = Shapes::Start(range) + tile * range.stored_modes * 3 * kTileVertices;
  const float* amplitude = range.amplitudes + instance;
  for (std::size_t m = 0; m < range.modes; ++m, shape += 3 * kTileVertices, amplitude += range.instances) {
    for (std::size_t line = 0; line < 3 * kTileVertices; line += kLine) hwy::Prefetch(shape + kAhead + line);
    const Vector a = hn::Set(d, *amplitude);
    for (std::size_t i = 0; i < 3 * kParts; ++i) u[i] = hn::MulAdd(Shapes::Load(shape + i * kLanes), a, u[i]);
  }
  const Interleave interleave;
  for (std::size_t part = 0; part < kParts; ++part) {
    const std::size_t vertex = tile * kTileVertices + part * kLanes;
    if (vertex >= range.vertices) break;
    const InstanceOutput& out = range.outputs[instance];
    StoreTransformed(range, out, vertex,
                     Displaced(range, out, vertex, LoadPoints(range, range.rest, vertex),
                               {u[part], u[kParts + part], u[2 * kParts + part]}),
                     interleave);
  }
}

template <class Shapes, std::size_t N>
HWY_INLINE HWY_ATTR void WholeTile(const TileRange& range, std::size_t tile, std::size_t first) {
  const std::size_t last_lane = std::min(kTileVertices, range.vertices - tile * kTileVertices);
  for (std::size_t lane = 0; lane < last_lane; lane += kLanes) ManyInstances<Shapes, N>(range, tile, lane, first);
}

template <class Shapes>
HWY_INLINE HWY_ATTR void AllTiles(const TileRange& range) {
  for (std::size_t tile = range.first_tile; tile < range.last_tile; ++tile) {
    std::size_t i = 0;
    for (; i + kGroup <= range.instances; i += kGroup) WholeTile<Shapes, kGroup>(range, tile, i);
    if (i + 4 <= range.instances) WholeTile<Shapes, 4>(range, tile, i), i += 4;
    if (i + 2 <= range.instances) WholeTile<Shapes, 2>(range, tile, i), i += 2;
    if (i < range.instances) OneInstance<Shapes>(range, tile, i);
  }
}

HWY_ATTR void ReconstructTiles(const TileRange& range) {
  if (range.half_basis != nullptr)
    AllTiles<HalfShapes>(range);
  else
    AllTiles<FloatShapes>(range);
}

HWY_ATTR void ToHalf(const float* from, std::uint16_t* to, float* back, std::size_t count) {
  const Floats d;
  const hn::Rebind<hwy::float16_t, Floats> halves;
  const hn::Rebind<std::uint16_t, Floats> words;
  for (std::size_t i = 0; i < count; i += kLanes) {
    const auto half = hn::DemoteTo(halves, hn::LoadU(d, from + i));
    hn::StoreU(hn::BitCast(words, half), words, to + i);
    hn::StoreU(hn::PromoteTo(d, half), d, back + i);
  }
}

HWY_INLINE HWY_ATTR void NormalizeLanes(const Interleave& interleave, float* vectors) {
  const Floats d;
  Points n;
  hn::LoadInterleaved3(d, vectors, n.x, n.y, n.z);
  const Vector squared = hn::MulAdd(n.x, n.x, hn::MulAdd(n.y, n.y, hn::Mul(n.z, n.z)));
  const auto some = hn::Ge(squared, hn::Set(d, std::numeric_limits<float>::min()));
  const Vector one = hn::Set(d, 1.0f);
  const Vector scale = hn::Div(one, hn::Sqrt(hn::IfThenElse(some, squared, one)));
  interleave.Store({hn::IfThenElseZero(some, hn::Mul(n.x, scale)), hn::IfThenElseZero(some, hn::Mul(n.y, scale)),
                    hn::IfThenElse(some, hn::Mul(n.z, scale), one)},
                   vectors);
}

HWY_ATTR void NormalizeVectors(float* vectors, std::size_t count) {
  const Interleave interleave;
  std::size_t i = 0;
  for (; i + kLanes <= count; i += kLanes) NormalizeLanes(interleave, vectors + 3 * i);
  if (i == count) return;
  HWY_ALIGN float buffer[3 * kLanes] = {};
  std::copy_n(vectors + 3 * i, 3 * (count - i), buffer);
  NormalizeLanes(interleave, buffer);
  std::copy_n(buffer, 3 * (count - i), vectors + 3 * i);
}

}  // namespace limber::internal::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace limber::internal {

HWY_EXPORT(ReconstructTiles);
HWY_EXPORT(NormalizeVectors);
HWY_EXPORT(ToHalf);

void reconstruct_tiles(const TileRange& range) { HWY_DYNAMIC_DISPATCH(ReconstructTiles)(range); }

void to_half(const float* from, std::uint16_t* to, float* back, std::size_t count) {
  HWY_DYNAMIC_DISPATCH(ToHalf)(from, to, back, count);
}

void normalize_vectors(float* vectors, std::size_t count) { HWY_DYNAMIC_DISPATCH(NormalizeVectors)(vectors, count); }

}  // namespace limber::internal
#endif  // HWY_ONCE
