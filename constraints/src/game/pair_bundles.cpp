#include "pair_bundles.h"

#include <algorithm>
#include <tuple>

namespace limber::internal {
namespace {

constexpr std::size_t kChunk = 4;  // contacts: those of a manifold

std::int32_t blocks_of(const GameBodies& bodies, std::int32_t frame) {
  return frame < 0 ? 0 : bodies.body(frame).blocks - 1;
}

bool of_one_pair(const PreparedContact& x, const PreparedContact& y) {
  return x.a.body == y.a.body && x.b.body == y.b.body;
}

}  // namespace

void PairBundles::arrange(const GameBodies& bodies, std::span<const PreparedContact> contacts) {
  standing_ = static_cast<std::int32_t>(bodies.bodies().size());
  zeros_ = static_cast<std::int32_t>(bodies.motion().size()) - 1;
  chunks_.clear();
  places_.assign(contacts.size(), {});
  next_level_.assign(bodies.bodies().size(), 0);
  for (std::size_t begin = 0, end = 0; begin < contacts.size(); begin = end) {
    const PreparedContact& first = contacts[begin];
    while (end < contacts.size() && of_one_pair(first, contacts[end])) ++end;
    add_chunks(bodies, contacts.subspan(begin, end - begin), begin);
  }
  order_by_level();
  pack(bodies);
}

void PairBundles::add_chunks(const GameBodies& bodies, std::span<const PreparedContact> pair, std::size_t first) {
  const bool self = pair.front().a.body == pair.front().b.body;
  const std::int32_t moving[2] = {bodies.of(pair.front().a.body), self ? -1 : bodies.of(pair.front().b.body)};
  for (std::size_t i = 0; i < pair.size(); i += kChunk) {
    Chunk chunk{.first = static_cast<std::int32_t>(first + i),
                .count = static_cast<std::int32_t>(std::min(kChunk, pair.size() - i)),
                .body = {moving[0], moving[1]},
                .blocks = {blocks_of(bodies, moving[0]), blocks_of(bodies, moving[1])},
                .self = self};
    for (const std::int32_t body : moving)
      if (body >= 0) chunk.level = std::max(chunk.level, next_level_[static_cast<std::size_t>(body)]);
    for (const std::int32_t body : moving)
      if (body >= 0) next_level_[static_cast<std::size_t>(body)] = chunk.level + 1;
    chunks_.push_back(chunk);
  }
}

void PairBundles::order_by_level() {
  begins_.clear();
  for (const Chunk& chunk : chunks_) {
    const auto level = static_cast<std::size_t>(chunk.level);
    if (begins_.size() < level + 2) begins_.resize(level + 2, 0);
    ++begins_[level + 1];
  }
  for (std::size_t i = 1; i < begins_.size(); ++i) begins_[i] += begins_[i - 1];
  ordered_.resize(chunks_.size());
  std::vector<std::int32_t>& next = next_level_;
  next.assign(begins_.begin(), begins_.end());
  for (const Chunk& chunk : chunks_)
    ordered_[static_cast<std::size_t>(next[static_cast<std::size_t>(chunk.level)]++)] = chunk;
  // Chunks with as many modes and contacts share bundles.
  for (std::size_t level = 0; level + 1 < begins_.size(); ++level)
    std::sort(ordered_.begin() + begins_[level], ordered_.begin() + begins_[level + 1],
              [](const Chunk& x, const Chunk& y) {
                return std::tuple(x.width(), x.count, x.first) < std::tuple(y.width(), y.count, y.first);
              });
}

void PairBundles::pack(const GameBodies& bodies) {
  bundles_.clear();
  lanes_.clear();
  levels_.assign(1, 0);
  std::int32_t size = 0, rows = 0, width = 0;
  for (std::size_t level = 0; level + 1 < begins_.size(); ++level) {
    for (std::int32_t begin = begins_[level]; begin < begins_[level + 1]; begin += kBundleLanes) {
      PairBundle& bundle = bundles_.emplace_back();
      bundle.first = size, bundle.rows = rows;
      const std::int32_t end = std::min(begins_[level + 1], begin + static_cast<std::int32_t>(kBundleLanes));
      for (std::size_t lane = 0; lane < kBundleLanes; ++lane) {
        const std::int32_t at = begin + static_cast<std::int32_t>(lane);
        fill_lane(bodies, at < end ? ordered_[static_cast<std::size_t>(at)] : Chunk{}, bundle, lane);
      }
      size += bundle.count;
      rows += 3 * bundle.count * (bundle.modes[0] + bundle.modes[1]);
      width = std::max(width, bundle.modes[0] + bundle.modes[1]);
    }
    levels_.push_back(bundles_.size());
  }
  if (packed_.size() < static_cast<std::size_t>(size)) packed_.resize(static_cast<std::size_t>(size));
  if (rows_.size() < static_cast<std::size_t>(rows)) rows_.resize(static_cast<std::size_t>(rows));
  width_ = static_cast<std::size_t>(width);
  if (const std::size_t room = bundles_.size() * width_ + 1; room_.size() < room) room_.resize(room);
}

void PairBundles::empty(std::size_t at) {
  const PairBundle& bundle = bundles_[at];
  std::fill_n(packed_.begin() + bundle.first, bundle.count, BundleContact{});
}

void PairBundles::fill_lane(const GameBodies& bodies, const Chunk& chunk, PairBundle& bundle, std::size_t lane) {
  for (std::size_t s = 0; s < 2; ++s) {
    const std::int32_t at = chunk.body[s];
    bundle.frame[s][lane] = at >= 0 && !chunk.self ? at : standing_;
    bundle.motion[s][lane] = at >= 0 ? bodies.body(at).first : zeros_;
    bundle.blocks[s][lane] = chunk.blocks[s];
    bundle.modes[s] = std::max(bundle.modes[s], 8 * chunk.blocks[s]);
    if (at < 0 || chunk.self) continue;
    const GameBody& body = bodies.body(at);
    const double h = bodies.plan().length();
    if (body.led >= 0) bundle.carried = true;
    for (int i = 0; i < 3; ++i) {
      bundle.root[s][i].v[lane] = static_cast<float>(body.shift[i]);
      for (int j = 0; j < 3; ++j) bundle.scale[s][i][j].v[lane] = static_cast<float>(h * body.turn_scale(i, j));
    }
  }
  for (std::int32_t k = 0; k < chunk.count; ++k)
    places_[static_cast<std::size_t>(chunk.first + k)] = {bundle.first + k, static_cast<std::int32_t>(lane),
                                                          static_cast<std::int32_t>(bundles_.size() - 1)};
  bundle.count = std::max(bundle.count, chunk.count);
  lanes_.push_back({chunk.first, chunk.count, chunk.body[0] >= 0 ? chunk.body[0] : chunk.body[1]});
}

void PairBundles::put(std::size_t contact, const ContactRow& row) {
  const Place& place = places_[contact];
  const auto lane = static_cast<std::size_t>(place.lane);
  PairBundle& bundle = bundles_[static_cast<std::size_t>(place.bundle)];
  BundleContact& c = packed_[static_cast<std::size_t>(place.at)];
  const auto write = [&](const Vec3& v, Block8* to) {
    for (int i = 0; i < 3; ++i) to[i].v[lane] = static_cast<float>(v[i]);
  };
  for (int axis = 0; axis < 3; ++axis) write(row.axes.col(axis), c.axes[axis]);
  for (std::size_t s = 0; s < 2; ++s) write(row.side[s].arm, c.arm[s]), write(row.side[s].lever, c.lever[s]);
  write(row.force, c.force);
  c.rest.v[lane] = static_cast<float>(row.rest), c.friction.v[lane] = static_cast<float>(row.friction);
  c.slop.v[lane] = static_cast<float>(row.slop), c.compliance.v[lane] = static_cast<float>(row.compliance);
  for (std::size_t t = 0; t < 2; ++t) c.running[t].v[lane] = static_cast<float>(row.running[t]);
  if (!(row.rebound > 0.0f)) return;
  bundle.rebounds = true;
  c.rebound.v[lane] = row.rebound, c.fall.v[lane] = row.fall, c.stage.v[lane] = row.stage;
  c.energy.v[lane] = row.energy, c.release.v[lane] = row.release;
}

float PairBundles::residual() const {
  float largest = 0.0f;
  for (const PairBundle& bundle : bundles_) largest = std::max(largest, bundle.residual);
  return largest;
}

void PairBundles::resist_rolling(std::size_t contact, double radius, const Vec3& moment) {
  const auto lane = static_cast<std::size_t>(places_[contact].lane);
  PairBundle& bundle = bundles_[static_cast<std::size_t>(places_[contact].bundle)];
  float trace = 0.0f;
  for (const auto& scale : bundle.scale)
    for (const auto& row : scale)
      for (const Block8& number : row) trace += number.v[lane] * number.v[lane];
  if (!(trace > 0.0f)) return;
  bundle.rolls = true;
  bundle.inverse_turn.v[lane] = 1.0f / trace;  // at most that of the largest eigenvalue
  BundleContact& c = packed_[static_cast<std::size_t>(places_[contact].at)];
  c.radius.v[lane] = static_cast<float>(radius);
  for (int i = 0; i < 3; ++i) c.moment[i].v[lane] = static_cast<float>(moment[i]);
}

double PairBundles::read(std::size_t contact, Block8 BundleContact::*field) const {
  const Place& place = places_[contact];
  return static_cast<double>((packed_[static_cast<std::size_t>(place.at)].*field).v[place.lane]);
}

Vec3 PairBundles::read(std::size_t contact, Block8 (BundleContact::*field)[3]) const {
  const Place& place = places_[contact];
  const Block8* from = packed_[static_cast<std::size_t>(place.at)].*field;
  Vec3 out;
  for (int i = 0; i < 3; ++i) out[i] = static_cast<double>(from[i].v[place.lane]);
  return out;
}

}  // namespace limber::internal
