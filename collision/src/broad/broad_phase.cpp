#include "limber/collision/broad_phase.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <string>

#include "broad/box_tree.h"
#include "broad/sweep_kernels.h"
#include "limber/core/error.h"
#include "tuning.h"

namespace limber {

using internal::BoxTree;
using internal::kSweepHits;
using internal::kSweepPadding;
using internal::sweep_rows_on;
using internal::SweepBoxes;
using internal::SweepCursor;
using internal::SweepHit;

namespace {

constexpr double kLargestSide = 1e37;  ///< boxes that reach farther count as endless: single precision ends soon after

enum class Bounds : std::uint8_t { kNone, kBox, kHalfSpace };

struct Body {
  HalfSpace half_space{};
  std::vector<Index> excluded{};  ///< ascending
  Index leaf = -1;                ///< in the tree of those that sleep
  Bounds bounds = Bounds::kNone;
  bool present = false, asleep = false;
  bool bounded = false;          ///< its box is finite
  bool in_awake_list = false;    ///< has an entry in `awake`, which may be out of date
  bool in_endless_list = false;  ///< the same for `endless`
};

struct Filter {
  std::uint32_t layers = 0, mask = 0;
  bool exclusions = false;  ///< whether the body's list has any
};

/// What one chunk of rows finds, in arrays of its own so that chunks may run at once.
struct Chunk {
  std::vector<std::uint64_t> pairs;
  std::vector<Index> stack;
};

std::uint64_t pair_key(Index a, Index b) {
  if (a > b) std::swap(a, b);
  return static_cast<std::uint64_t>(a) << 32 | static_cast<std::uint32_t>(b);
}

/// A float at most x, for |x| ≤ kLargestSide: single precision must not lose an overlap. The conversion errs by half an
/// ulp and two are taken off: without a branch, which would be taken every other time.
float rounded_down(double x) {
  const auto f = static_cast<float>(x);
  return f - (std::abs(f) * std::numeric_limits<float>::epsilon() + std::numeric_limits<float>::min());
}
float rounded_up(double x) { return -rounded_down(-x); }

/// Unsigned numbers in the order of the floats.
std::uint32_t ordered_bits(float f) {
  const auto bits = std::bit_cast<std::uint32_t>(f);
  return bits & 0x80000000u ? ~bits : bits | 0x80000000u;
}

bool near(const Aabb& a, const Aabb& b, double margin) {
  return (a.low.array() <= b.high.array() + margin).all() && (b.low.array() <= a.high.array() + margin).all();
}

/// Whether some point of the box is at most `margin` above the plane. Written so that infinite sides give no NaN.
bool near(const HalfSpace& h, const Aabb& box, double margin) {
  double lowest = 0.0;
  for (int i = 0; i < 3; ++i)
    if (h.normal[i] != 0.0) lowest += h.normal[i] * (h.normal[i] > 0.0 ? box.low[i] : box.high[i]);
  return lowest <= h.offset + margin;
}

/// Sorts what is nearly sorted in the time of its disorder, and anything else in n log n.
void sort_nearly_sorted(std::vector<std::uint64_t>& keys) {
  std::size_t moves_left = internal::collision_tuning().broad.moves_before_sort * keys.size();
  for (std::size_t i = 1; i < keys.size(); ++i) {
    const std::uint64_t key = keys[i];
    std::size_t j = i;
    for (; j > 0 && keys[j - 1] > key; --j) keys[j] = keys[j - 1];
    keys[j] = key;
    if (i - j > moves_left) return std::sort(keys.begin(), keys.end());
    moves_left -= i - j;
  }
}

}  // namespace

struct BroadPhase::Impl {
  std::vector<Body> bodies;
  // By body index too, and apart from the rest, as a query reads those of all that are awake.
  std::vector<Aabb> boxes;
  std::vector<Filter> filters;
  BoxTree sleeping;
  std::vector<std::uint64_t> awake;  ///< ordered_bits(low along `axis`) << 32 | body
  std::vector<Index> endless;        ///< half-spaces and boxes without end, awake or not
  int axis = 0;

  // Of the query under way.
  double margin = 0.0;
  std::vector<float> sides[6];  ///< low and high along the sweep's axis, then the two others
  std::vector<Chunk> chunks;
  std::vector<std::uint64_t> found, sorted;
  std::vector<std::uint32_t> first_of_body;

  Body& present(Index body, const char* function) {
    if (body < 0 || static_cast<std::size_t>(body) >= bodies.size() || !bodies[static_cast<std::size_t>(body)].present)
      throw InvalidArgument("BroadPhase::" + std::string(function) + ": index " + std::to_string(body) +
                            " holds no body, expected one that was added");
    return bodies[static_cast<std::size_t>(body)];
  }
  Body& at(Index body) { return bodies[static_cast<std::size_t>(body)]; }
  const Body& at(Index body) const { return bodies[static_cast<std::size_t>(body)]; }
  const Aabb& box(Index body) const { return boxes[static_cast<std::size_t>(body)]; }
  Index awake_body(std::size_t row) const { return static_cast<Index>(awake[row] & 0xffffffffu); }

  void place(Index index);
  void unplace(Body& body);
  bool may_meet(Index a, Index b) const;
  void drop_outdated_entries();
  void choose_axis();
  void sort_awake();
  void fill_sides();
  void find_in_chunk(Chunk& chunk, std::size_t first, std::size_t last) const;
  void sweep_rows(Chunk& chunk, std::size_t first, std::size_t last) const;
  void meet_sleeping(Chunk& chunk, std::size_t first, std::size_t last) const;
  void meet_endless(Chunk& chunk, std::size_t first, std::size_t last) const;
  void endless_meet_the_rest(Chunk& chunk) const;
  void sort_found();
};

/// Puts a body where its state says: the tree, the list of those that are swept, or that of those without end.
void BroadPhase::Impl::place(Index index) {
  Body& body = at(index);
  if (body.bounds == Bounds::kNone) return;
  if (!body.bounded) {
    if (!body.in_endless_list) endless.push_back(index);
    body.in_endless_list = true;
  } else if (body.asleep) {
    body.leaf = sleeping.insert(index, box(index));
  } else {
    if (!body.in_awake_list) awake.push_back(static_cast<std::uint32_t>(index));
    body.in_awake_list = true;
  }
}

void BroadPhase::Impl::unplace(Body& body) {
  if (body.leaf >= 0) sleeping.remove(body.leaf);
  body.leaf = -1;
}

bool BroadPhase::Impl::may_meet(Index a, Index b) const {
  const Filter &A = filters[static_cast<std::size_t>(a)], &B = filters[static_cast<std::size_t>(b)];
  if ((A.layers & B.mask) == 0 || (B.layers & A.mask) == 0) return false;
  if (!A.exclusions || !B.exclusions) return true;
  const std::vector<Index>& excluded = at(a).excluded;
  return !std::binary_search(excluded.begin(), excluded.end(), b);
}

/// Entries of bodies that fell asleep, were removed or changed their kind since the last query.
void BroadPhase::Impl::drop_outdated_entries() {
  std::erase_if(awake, [&](std::uint64_t entry) {
    Body& body = at(static_cast<Index>(entry & 0xffffffffu));
    body.in_awake_list = body.present && body.bounds == Bounds::kBox && body.bounded && !body.asleep;
    return !body.in_awake_list;
  });
  std::erase_if(endless, [&](Index index) {
    Body& body = at(index);
    body.in_endless_list = body.present && body.bounds != Bounds::kNone && !body.bounded;
    return !body.in_endless_list;
  });
}

/// Sweeps along the axis in which the bodies lie widest apart; changes it only for one that is clearly better, as the
/// list must then be sorted anew.
void BroadPhase::Impl::choose_axis() {
  if (awake.empty()) return;
  const Vec3 base = box(awake_body(0)).low;
  Vec3 sum = Vec3::Zero(), squares = Vec3::Zero();
  for (std::size_t row = 0; row < awake.size(); ++row) {
    const Vec3 x = box(awake_body(row)).low - base;
    sum += x;
    squares += x.cwiseProduct(x);
  }
  const Vec3 spread = squares - sum.cwiseProduct(sum) / static_cast<double>(awake.size());
  int widest = 0;
  spread.maxCoeff(&widest);
  if (spread[widest] > 2.0 * spread[axis]) axis = widest;
}

void BroadPhase::Impl::sort_awake() {
  for (std::uint64_t& entry : awake) {
    const std::uint64_t body = entry & 0xffffffffu;
    entry =
        static_cast<std::uint64_t>(ordered_bits(rounded_down(box(static_cast<Index>(body)).low[axis]))) << 32 | body;
  }
  sort_nearly_sorted(awake);
}

void BroadPhase::Impl::fill_sides() {
  for (auto& side : sides) side.resize(awake.size() + kSweepPadding);
  for (std::size_t i = 0; i < awake.size(); ++i) {
    const Aabb& body = box(awake_body(i));
    for (int d = 0; d < 3; ++d) {
      const int along = (axis + d) % 3;
      sides[2 * d][i] = rounded_down(body.low[along]);
      sides[2 * d + 1][i] = rounded_up(body.high[along] + margin);
    }
  }
  std::fill(sides[0].end() - kSweepPadding, sides[0].end(), std::numeric_limits<float>::infinity());
}

void BroadPhase::Impl::sweep_rows(Chunk& chunk, std::size_t first, std::size_t last) const {
  const SweepBoxes boxes_of_rows{{sides[0].data(), sides[2].data(), sides[4].data()},
                                 {sides[1].data(), sides[3].data(), sides[5].data()},
                                 awake.size()};
  SweepHit hits[kSweepHits];
  SweepCursor cursor{first, first + 1};
  while (cursor.row < last) {
    const std::size_t count = sweep_rows_on(boxes_of_rows, last, cursor, hits);
    for (std::size_t h = 0; h < count; ++h) {
      const Index a = awake_body(hits[h].row), b = awake_body(hits[h].column);
      if (near(box(a), box(b), margin) && may_meet(a, b)) chunk.pairs.push_back(pair_key(a, b));
    }
  }
}

void BroadPhase::Impl::meet_sleeping(Chunk& chunk, std::size_t first, std::size_t last) const {
  if (sleeping.empty()) return;
  for (std::size_t row = first; row < last; ++row) {
    const auto a = awake_body(row);
    sleeping.visit([&](const Aabb& node) { return near(box(a), node, margin); },
                   [&](Index b, const Aabb&) {
                     if (may_meet(a, b)) chunk.pairs.push_back(pair_key(a, b));
                   },
                   chunk.stack);
  }
}

void BroadPhase::Impl::meet_endless(Chunk& chunk, std::size_t first, std::size_t last) const {
  for (const Index e : endless) {
    const Body& body = at(e);
    for (std::size_t row = first; row < last; ++row) {
      const auto a = awake_body(row);
      const bool meet =
          body.bounds == Bounds::kHalfSpace ? near(body.half_space, box(a), margin) : near(box(e), box(a), margin);
      if (meet && may_meet(a, e)) chunk.pairs.push_back(pair_key(a, e));
    }
  }
}

/// Those without end among each other, and those of them that are awake with the bodies that sleep.
void BroadPhase::Impl::endless_meet_the_rest(Chunk& chunk) const {
  for (std::size_t i = 0; i < endless.size(); ++i) {
    const Index e = endless[i];
    const Body& body = at(e);
    const auto meets = [&](const Aabb& other) {
      return body.bounds == Bounds::kHalfSpace ? near(body.half_space, other, margin) : near(box(e), other, margin);
    };
    for (std::size_t j = 0; j < i; ++j) {
      const Body& other = at(endless[j]);
      if (body.asleep && other.asleep) continue;
      if (body.bounds == Bounds::kHalfSpace && other.bounds == Bounds::kHalfSpace) continue;
      const bool meet =
          other.bounds == Bounds::kHalfSpace ? near(other.half_space, box(e), margin) : meets(box(endless[j]));
      if (meet && may_meet(e, endless[j])) chunk.pairs.push_back(pair_key(e, endless[j]));
    }
    if (body.asleep) continue;
    sleeping.visit(
        meets,
        [&](Index b, const Aabb&) {
          if (may_meet(e, b)) chunk.pairs.push_back(pair_key(e, b));
        },
        chunk.stack);
  }
}

void BroadPhase::Impl::find_in_chunk(Chunk& chunk, std::size_t first, std::size_t last) const {
  sweep_rows(chunk, first, last);
  meet_sleeping(chunk, first, last);
  meet_endless(chunk, first, last);
}

/// By counting over the first body, unless there are so few pairs that running over all bodies would cost more.
void BroadPhase::Impl::sort_found() {
  if (8 * found.size() < bodies.size()) {
    sorted.assign(found.begin(), found.end());
    std::sort(sorted.begin(), sorted.end());
    return;
  }
  first_of_body.assign(bodies.size() + 1, 0);
  for (const std::uint64_t pair : found) ++first_of_body[(pair >> 32) + 1];
  for (std::size_t b = 1; b < first_of_body.size(); ++b) first_of_body[b] += first_of_body[b - 1];
  sorted.resize(found.size());
  for (const std::uint64_t pair : found) sorted[first_of_body[pair >> 32]++] = pair;
  std::size_t begin = 0;
  for (std::size_t end = 1; end <= sorted.size(); ++end)
    if (end == sorted.size() || sorted[end] >> 32 != sorted[begin] >> 32) {
      const auto from = sorted.begin() + static_cast<std::ptrdiff_t>(begin);
      if (end - begin > 1) std::sort(from, sorted.begin() + static_cast<std::ptrdiff_t>(end));
      begin = end;
    }
}

BroadPhase::BroadPhase() : impl_(std::make_unique<Impl>()) {}
BroadPhase::~BroadPhase() = default;
BroadPhase::BroadPhase(BroadPhase&&) noexcept = default;
BroadPhase& BroadPhase::operator=(BroadPhase&&) noexcept = default;

void BroadPhase::add(Index body, const CollisionFilter& filter) {
  if (body < 0) throw InvalidArgument("BroadPhase::add: index is " + std::to_string(body) + ", expected 0 or more");
  auto& bodies = impl_->bodies;
  if (static_cast<std::size_t>(body) >= bodies.size()) bodies.resize(static_cast<std::size_t>(body) + 1);
  impl_->boxes.resize(bodies.size());
  impl_->filters.resize(bodies.size());
  Body& fresh = impl_->at(body);
  if (fresh.present)
    throw InvalidArgument("BroadPhase::add: index " + std::to_string(body) + " holds a body, expected a free index");
  fresh.present = true;
  set_filter(body, filter);
}

void BroadPhase::remove(Index body) {
  Body& gone = impl_->present(body, "remove");
  impl_->unplace(gone);
  while (!gone.excluded.empty()) exclude_pair(body, gone.excluded.back(), false);
  const bool in_awake_list = gone.in_awake_list, in_endless_list = gone.in_endless_list;
  gone = {};
  gone.in_awake_list = in_awake_list;
  gone.in_endless_list = in_endless_list;
}

void BroadPhase::set_filter(Index body, const CollisionFilter& filter) {
  impl_->present(body, "set_filter");
  Filter& f = impl_->filters[static_cast<std::size_t>(body)];
  f.layers = filter.layers;
  f.mask = filter.mask;
}

void BroadPhase::exclude_pair(Index a, Index b, bool excluded) {
  if (a == b)
    throw InvalidArgument("BroadPhase::exclude_pair: both bodies are " + std::to_string(a) + ", expected two");
  impl_->present(a, "exclude_pair");
  impl_->present(b, "exclude_pair");
  for (const auto& [of, other] : {std::pair(a, b), std::pair(b, a)}) {
    auto& list = impl_->at(of).excluded;
    const auto where = std::lower_bound(list.begin(), list.end(), other);
    const bool listed = where != list.end() && *where == other;
    if (excluded && !listed) list.insert(where, other);
    if (!excluded && listed) list.erase(where);
    impl_->filters[static_cast<std::size_t>(of)].exclusions = !list.empty();
  }
}

void BroadPhase::set_box(Index body, const Aabb& box) {
  Body& moved = impl_->present(body, "set_box");
  if (!(box.low.array() <= box.high.array()).all())
    throw InvalidArgument("BroadPhase::set_box: box of body " + std::to_string(body) +
                          " is empty or no number, expected low <= high");
  impl_->boxes[static_cast<std::size_t>(body)] = box;
  const bool bounded = (box.low.array() >= -kLargestSide).all() && (box.high.array() <= kLargestSide).all();
  if (moved.in_awake_list && moved.bounds == Bounds::kBox && moved.bounded && bounded && !moved.asleep) return;
  impl_->unplace(moved);
  moved.bounds = Bounds::kBox;
  moved.bounded = bounded;
  impl_->place(body);
}

void BroadPhase::set_half_space(Index body, const HalfSpace& half_space) {
  Body& moved = impl_->present(body, "set_half_space");
  validate(Shape(half_space));
  impl_->unplace(moved);
  moved.half_space = half_space;
  moved.bounds = Bounds::kHalfSpace;
  moved.bounded = false;
  impl_->place(body);
}

void BroadPhase::set_asleep(Index body, bool asleep) {
  Body& changed = impl_->present(body, "set_asleep");
  if (changed.asleep == asleep) return;
  impl_->unplace(changed);
  changed.asleep = asleep;
  impl_->place(body);
}

void BroadPhase::find_pairs(double margin, std::vector<BodyPair>& pairs, Jobs& jobs) {
  if (!(margin >= 0.0 && std::isfinite(margin)))
    throw InvalidArgument("BroadPhase::find_pairs: margin is " + std::to_string(margin) +
                          ", expected a finite number of at least 0");
  Impl& m = *impl_;
  m.margin = margin;
  m.drop_outdated_entries();
  m.choose_axis();
  m.sort_awake();
  m.fill_sides();

  const std::size_t rows = internal::collision_tuning().broad.rows_per_chunk;
  const std::size_t chunks = (m.awake.size() + rows - 1) / rows;
  if (m.chunks.size() < chunks + 1) m.chunks.resize(chunks + 1);
  for (Chunk& chunk : m.chunks) chunk.pairs.clear();
  jobs.parallel_for(chunks, 1, [&m, rows](std::size_t begin, std::size_t end) {
    for (std::size_t c = begin; c < end; ++c)
      m.find_in_chunk(m.chunks[c], c * rows, std::min((c + 1) * rows, m.awake.size()));
  });
  m.endless_meet_the_rest(m.chunks[chunks]);

  m.found.clear();
  for (const Chunk& chunk : m.chunks) m.found.insert(m.found.end(), chunk.pairs.begin(), chunk.pairs.end());
  m.sort_found();
  pairs.clear();
  for (const std::uint64_t key : m.sorted)
    pairs.push_back({static_cast<Index>(key >> 32), static_cast<Index>(key & 0xffffffffu)});
}

}  // namespace limber
