#include "pair_bundles.h"

#include <algorithm>

namespace limber::internal {
namespace {

constexpr std::size_t kChunk = 4;  // contacts: those of a manifold

std::int32_t blocks_of(const GameBodies& bodies, std::int32_t frame) {
  return frame < 0 ? 0 : bodies.body(frame).blocks - 1;
}

/// Whether it stands or is free, as the loops have it: alike along all axes.
bool is_taken(const GameBodies& bodies, std::int32_t frame) {
  if (frame < 0) return true;
  const GameBody& body = bodies.body(frame);
  return body.led < 0 && body.goes == Vec3::Ones() && 8 * blocks_of(bodies, frame) <= kMostBundledModes;
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
    const bool self = first.a.body == first.b.body;
    if (!self && is_taken(bodies, bodies.of(first.a.body)) && is_taken(bodies, bodies.of(first.b.body)))
      add_chunks(bodies, contacts.subspan(begin, end - begin), begin);
  }
  order_by_level();
  pack(bodies);
}

void PairBundles::add_chunks(const GameBodies& bodies, std::span<const PreparedContact> pair, std::size_t first) {
  const std::int32_t frames[2] = {bodies.of(pair.front().a.body), bodies.of(pair.front().b.body)};
  for (std::size_t i = 0; i < pair.size(); i += kChunk) {
    Chunk chunk{.first = static_cast<std::int32_t>(first + i),
                .count = static_cast<std::int32_t>(std::min(kChunk, pair.size() - i)),
                .frame = {frames[0], frames[1]},
                .blocks = {blocks_of(bodies, frames[0]), blocks_of(bodies, frames[1])}};
    for (const std::int32_t frame : frames)
      if (frame >= 0) chunk.level = std::max(chunk.level, next_level_[static_cast<std::size_t>(frame)]);
    for (const std::int32_t frame : frames)
      if (frame >= 0) next_level_[static_cast<std::size_t>(frame)] = chunk.level + 1;
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
  // Bodies with as many modes share bundles.
  for (std::size_t level = 0; level + 1 < begins_.size(); ++level)
    std::sort(ordered_.begin() + begins_[level], ordered_.begin() + begins_[level + 1],
              [](const Chunk& x, const Chunk& y) {
                return x.width() != y.width() ? x.width() < y.width() : x.first < y.first;
              });
}

void PairBundles::pack(const GameBodies& bodies) {
  bundles_.clear();
  lanes_.clear();
  runs_.clear();
  std::int32_t size = 0, rows = 0;
  for (std::size_t level = 0; level + 1 < begins_.size(); ++level) {
    const std::size_t first = bundles_.size();
    for (std::int32_t begin = begins_[level]; begin < begins_[level + 1]; begin += kBundleLanes) {
      PairBundle& bundle = bundles_.emplace_back();
      bundle.first = size, bundle.rows = rows;
      const std::int32_t end = std::min(begins_[level + 1], begin + static_cast<std::int32_t>(kBundleLanes));
      for (std::size_t lane = 0; lane < kBundleLanes; ++lane) {
        const std::int32_t at = begin + static_cast<std::int32_t>(lane);
        fill_lane(bodies, at < end ? ordered_[static_cast<std::size_t>(at)] : Chunk{.frame = {-1, -1}}, bundle, lane);
      }
      size += bundle.count;
      rows += 3 * bundle.count * (bundle.modes[0] + bundle.modes[1]);
    }
    add_to_runs(first);
  }
  if (packed_.size() < static_cast<std::size_t>(size)) packed_.resize(static_cast<std::size_t>(size));
  if (rows_.size() < static_cast<std::size_t>(rows)) rows_.resize(static_cast<std::size_t>(rows));
}

/// The bundles of a level, the last so far.
void PairBundles::add_to_runs(std::size_t begin) {
  const Run level{begin, bundles_.size(), bundles_.size() - begin > kBundlesAtOnce};
  if (!level.apart && !runs_.empty() && !runs_.back().apart)
    runs_.back().end = level.end;
  else
    runs_.push_back(level);
}

void PairBundles::empty(std::size_t at) {
  const PairBundle& bundle = bundles_[at];
  std::fill_n(packed_.begin() + bundle.first, bundle.count, BundleContact{});
  std::fill_n(rows_.begin() + bundle.rows, 3 * bundle.count * (bundle.modes[0] + bundle.modes[1]), Block8{});
}

void PairBundles::fill_lane(const GameBodies& bodies, const Chunk& chunk, PairBundle& bundle, std::size_t lane) {
  for (std::size_t s = 0; s < 2; ++s) {
    const std::int32_t frame = chunk.frame[s];
    bundle.frame[s][lane] = frame >= 0 ? frame : standing_;
    bundle.motion[s][lane] = frame >= 0 ? bodies.body(frame).first : zeros_;
    bundle.blocks[s][lane] = chunk.blocks[s];
    bundle.modes[s] = std::max(bundle.modes[s], 8 * chunk.blocks[s]);
    if (frame < 0) continue;
    const double h = bodies.plan().length();
    bundle.root[s].v[lane] = static_cast<float>(h / bodies.body(frame).root_mass);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        bundle.scale[s][i][j].v[lane] = static_cast<float>(h * bodies.body(frame).turn_scale(i, j));
  }
  for (std::int32_t k = 0; k < chunk.count; ++k)
    places_[static_cast<std::size_t>(chunk.first + k)] = {bundle.first + k, static_cast<std::int32_t>(lane),
                                                          static_cast<std::int32_t>(bundles_.size() - 1)};
  bundle.count = std::max(bundle.count, chunk.count);
  lanes_.push_back({chunk.first, chunk.count});
}

void PairBundles::put(std::size_t contact, const ContactRow& row) {
  const auto lane = static_cast<std::size_t>(places_[contact].lane);
  BundleContact& c = packed_[static_cast<std::size_t>(places_[contact].at)];
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (std::size_t i = 0; i < 3; ++i) c.axes[axis][i].v[lane] = row.axes[axis][i];
  for (std::size_t s = 0; s < 2; ++s)
    for (std::size_t i = 0; i < 3 && row.side[s].blocks > 0; ++i)
      c.arm[s][i].v[lane] = row.side[s].arm[i], c.lever[s][i].v[lane] = row.side[s].lever[i];
  c.rest.v[lane] = row.rest, c.friction.v[lane] = row.friction, c.slop.v[lane] = row.slop;
  c.compliance.v[lane] = row.compliance;
  for (std::size_t t = 0; t < 2; ++t) c.running[t].v[lane] = row.running[t];
  for (std::size_t axis = 0; axis < 3; ++axis) c.force[axis].v[lane] = row.force[axis];
}

void PairBundles::put_modes(std::size_t contact, std::size_t side, const Block8* rows) {
  const Place& place = places_[contact];
  const PairBundle& bundle = bundles_[static_cast<std::size_t>(place.bundle)];
  Block8* to = rows_.data() + bundle.rows + 3 * (place.at - bundle.first) * (bundle.modes[0] + bundle.modes[1]) +
               (side == 0 ? 0 : 3 * bundle.modes[0]);
  for (std::int32_t k = 0; k < bundle.blocks[side][place.lane]; ++k)
    for (std::int32_t axis = 0; axis < 3; ++axis)
      for (std::int32_t i = 0; i < 8; ++i) to[3 * (8 * k + i) + axis].v[place.lane] = rows[3 * k + axis].v[i];
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

void PairBundles::rebound(std::size_t contact, const ContactRow& row) {
  const auto lane = static_cast<std::size_t>(places_[contact].lane);
  bundles_[static_cast<std::size_t>(places_[contact].bundle)].rebounds = true;
  BundleContact& c = packed_[static_cast<std::size_t>(places_[contact].at)];
  c.rebound.v[lane] = row.rebound, c.fall.v[lane] = row.fall, c.stage.v[lane] = row.stage;
  c.energy.v[lane] = row.energy, c.release.v[lane] = row.release;
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
