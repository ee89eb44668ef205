// Contacts packed for the vector loops: pairs in bundles of eight, in an order that gives what Gauss–Seidel from one
// contact to the next gives.
//
//   level(pair) = 1 + the largest level of the pairs before it that share a body that moves
//
// Pairs of a level share no such body, so a bundle may hold any of them, and levels after each other keep the order.
// A colouring with fewest colours fills bundles better, but its sweeps carry less: towers of boxes need half as many
// substeps again.
#pragma once

#include <algorithm>
#include <functional>
#include <span>
#include <vector>

#include "../prepared_contact.h"
#include "bundle_kernels.h"
#include "game_bodies.h"
#include "limber/core/jobs.h"

namespace limber::internal {

/// One side of a contact.
struct ContactArm {
  Vec3 arm = Vec3::Zero();    // of the point that the body carries along, body axes
  Vec3 lever = Vec3::Zero();  // from the origin to where the body touches, world
};

/// One contact, as it is put into its place: fields as those of BundleContact.
struct ContactRow {
  ContactArm side[2];
  Mat3 axes = Mat3::Identity();
  double rest = 0.0, friction = 0.0, slop = 0.0, compliance = 0.0;
  double running[2] = {};
  Vec3 force = Vec3::Zero();
  float rebound = 0.0f, fall = 0.0f, stage = 0.0f, energy = 0.0f, release = 0.0f;
};

class PairBundles {
 public:
  /// Finds places for the contacts of all pairs: those of a pair stand one after the other. A body that touches itself
  /// is the first of its pair, and its frame stands.
  void arrange(const GameBodies& bodies, std::span<const PreparedContact> contacts);
  /// Empties all places and visits them: visit(contact), those of a bundle one after the other. Then makes the rows of
  /// modes: point(contact, side, to be written) tells whether the side has any.
  template <class Visit, class Point>
  void fill(Jobs& jobs, const Visit& visit, const Point& point);
  /// Fills the place of a contact, but for its masses and the rows of modes; `rest` is the gap.
  void put(std::size_t contact, const ContactRow& row);
  /// Gives a contact in its place resistance to rolling. @param radius m, > 0. @param moment N·m, to begin with
  void resist_rolling(std::size_t contact, double radius, const Vec3& moment);

  float stage(std::size_t contact) const { return static_cast<float>(read(contact, &BundleContact::stage)); }
  float energy(std::size_t contact) const { return static_cast<float>(read(contact, &BundleContact::energy)); }

  /// Force along a contact's axes at the last substep, and the sum of all, N.
  Vec3 force(std::size_t contact) const { return read(contact, &BundleContact::force); }
  Vec3 sum(std::size_t contact) const { return read(contact, &BundleContact::sum); }
  /// What resists rolling at the last substep, N·m.
  Vec3 moment(std::size_t contact) const { return read(contact, &BundleContact::moment); }
  bool resists_rolling(std::size_t contact) const { return read(contact, &BundleContact::radius) > 0.0; }
  double friction(std::size_t contact) const { return read(contact, &BundleContact::friction); }
  double compliance(std::size_t contact) const { return read(contact, &BundleContact::compliance); }

  /// Visits all pairs after the forward sweep: visit(frame, open, yielded, given), the frame one of the pair's that
  /// moves (−1: none), the others as PairBundle has them.
  template <class Visit>
  void for_all_works(const Visit& visit) const;
  /// Leaves shares of the forces: share(frame) of a pair.
  template <class Share>
  void scale(const Share& share);

  /// Runs a kernel over all bundles, in parts.
  template <class Kernel>
  void for_all(Jobs& jobs, const Kernel& kernel);
  /// The same in the order of levels, or against it: for kernels that change coordinates.
  template <class Kernel>
  void in_order(Jobs& jobs, bool backward, const Kernel& kernel);
  bool overlap() const {
    return std::ranges::any_of(bundles_, [](const PairBundle& b) { return b.overlaps; });
  }
  float residual() const;

 private:
  /// Up to four contacts of a pair.
  struct Chunk {
    std::int32_t first = 0, count = 0, level = 0;
    std::int32_t body[2] = {-1, -1};  // −1: stands
    std::int32_t blocks[2] = {};      // of modes
    bool self = false;                // of a body that touches itself
    std::int32_t width() const { return blocks[0] + blocks[1]; }
  };
  /// The contacts of a lane, in their order.
  struct Lane {
    std::int32_t first = 0, count = 0;
    std::int32_t frame = -1;  // one of those that move; −1: none
  };
  static constexpr std::size_t kBundlesAtOnce = 4;  // of one thread
  // Of a level, in one thread. Waking another takes as long as a sweep over so many.
  static constexpr std::size_t kSweptAtOnce = 32;
  BundleArrays arrays() {
    return {bundles_.data(), packed_.data(), rows_.data(), room_.data(), width_, bundles_.size(), zeros_, standing_};
  }
  struct Place {
    std::int32_t at = -1, lane = -1, bundle = -1;  // the first in `packed_`
  };
  void add_chunks(const GameBodies& bodies, std::span<const PreparedContact> pair, std::size_t first);
  void order_by_level();
  void pack(const GameBodies& bodies);
  void fill_lane(const GameBodies& bodies, const Chunk& chunk, PairBundle& bundle, std::size_t lane);
  void empty(std::size_t bundle);
  template <class Point>
  void fill_modes(std::size_t bundle, const Point& point);
  Vec3 read(std::size_t contact, Block8 (BundleContact::*field)[3]) const;
  double read(std::size_t contact, Block8 BundleContact::*field) const;
  std::int32_t frame_of(std::size_t bundle, std::size_t lane) const {
    return lanes_[bundle * kBundleLanes + lane].frame;
  }

  std::int32_t standing_ = 0, zeros_ = 0;
  std::size_t width_ = 0;  // the most modes of a bundle
  std::vector<PairBundle> bundles_;
  std::vector<BundleContact> packed_;
  std::vector<Block8> rows_;    // of modes
  std::vector<Block8> room_;    // by bundle, as parts begin at any: its first one's is theirs
  std::vector<Block8> shares_;  // by bundle
  std::vector<Place> places_;   // by contact
  std::vector<Lane> lanes_;     // by bundle
  std::vector<Chunk> chunks_, ordered_;
  std::vector<std::int32_t> next_level_;  // by frame
  std::vector<std::int32_t> begins_;      // by level, in `ordered_`
  std::vector<std::size_t> levels_;       // where they begin in `bundles_`, and where the last one ends
};

template <class Visit, class Point>
void PairBundles::fill(Jobs& jobs, const Visit& visit, const Point& point) {
  const auto part = [&](std::size_t begin, std::size_t end) {
    for (std::size_t b = begin; b < end; ++b) {
      empty(b);
      const std::size_t first = b * kBundleLanes;
      for (std::size_t lane = first; lane < first + kBundleLanes; ++lane)
        for (std::int32_t k = 0; k < lanes_[lane].count; ++k) visit(static_cast<std::size_t>(lanes_[lane].first + k));
      fill_modes(b, point);
    }
  };
  jobs.parallel_for(bundles_.size(), kBundlesAtOnce, std::ref(part));
}

template <class Point>
void PairBundles::fill_modes(std::size_t b, const Point& point) {
  const PairBundle& bundle = bundles_[b];
  if (bundle.modes[0] + bundle.modes[1] == 0) return;
  const Lane* lanes = &lanes_[b * kBundleLanes];
  Block8* rows = rows_.data() + bundle.rows;
  ModePoint points[kBundleLanes];
  const ModePoint* given[kBundleLanes];
  for (std::int32_t k = 0; k < bundle.count; ++k)
    for (std::size_t side = 0; side < 2; ++side) {
      for (std::size_t l = 0; l < kBundleLanes; ++l)
        given[l] = k < lanes[l].count && point(static_cast<std::size_t>(lanes[l].first + k), side, points[l])
                       ? &points[l]
                       : nullptr;
      make_mode_rows(given, bundle.modes[side], rows);
      rows += 3 * bundle.modes[side];
    }
}

template <class Visit>
void PairBundles::for_all_works(const Visit& visit) const {
  for (std::size_t b = 0; b < bundles_.size(); ++b)
    for (std::size_t lane = 0; lane < kBundleLanes; ++lane)
      visit(frame_of(b, lane), static_cast<double>(bundles_[b].open.v[lane]),
            static_cast<double>(bundles_[b].yielded.v[lane]), static_cast<double>(bundles_[b].given.v[lane]));
}

template <class Share>
void PairBundles::scale(const Share& share) {
  shares_.resize(bundles_.size());
  for (std::size_t b = 0; b < bundles_.size(); ++b)
    for (std::size_t lane = 0; lane < kBundleLanes; ++lane) shares_[b].v[lane] = share(frame_of(b, lane));
  scale_bundle_forces(arrays(), shares_.data());
}

template <class Kernel>
void PairBundles::for_all(Jobs& jobs, const Kernel& kernel) {
  const auto part = [&](std::size_t begin, std::size_t end) { kernel(arrays().part(begin, end)); };
  jobs.parallel_for(bundles_.size(), 4 * kBundlesAtOnce, std::ref(part));
}

template <class Kernel>
void PairBundles::in_order(Jobs& jobs, bool backward, const Kernel& kernel) {
  if (jobs.concurrency() == 1) return kernel(arrays());
  const auto threads = static_cast<std::size_t>(jobs.concurrency());
  for (std::size_t i = 0; i + 1 < levels_.size(); ++i) {
    const std::size_t* level = &levels_[backward ? levels_.size() - 2 - i : i];
    const auto part = [&](std::size_t begin, std::size_t end) { kernel(arrays().part(*level + begin, *level + end)); };
    const std::size_t count = level[1] - level[0], share = (count + threads - 1) / threads;
    jobs.parallel_for(count, std::max(kSweptAtOnce, share), std::ref(part));
  }
}

}  // namespace limber::internal
