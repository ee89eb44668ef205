// A body as the finder of contacts knows it, and what a thread works on bodies with.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <span>
#include <tuple>
#include <variant>
#include <vector>

#include "finder/contact_regions.h"
#include "finder/geometry_cache.h"
#include "finder/surface_pool.h"
#include "limber/collision/broad_phase.h"
#include "limber/collision/contact_finder.h"

namespace limber::internal {

struct FoundBody {
  bool present = false;
  std::shared_ptr<const ModalGeometry> modal{};  ///< one of the two
  std::shared_ptr<const RigidGeometry> rigid{};
  double diagonal = 0.0;       ///< of its box at rest, m; infinite for a half-space
  bool placed_asleep = false;  ///< as its place in the broad phase was made

  Index modes() const { return modal ? modal->surface->modes() : 0; }
  bool is_half_space() const { return rigid && std::holds_alternative<HalfSpace>(rigid->shape()); }
};

/// What one thread works with.
struct Worker {
  explicit Worker(const ContactFinderOptions& options) : narrow(options.narrow_phase), clusters(options.clusters) {}
  NarrowPhase narrow;
  ContactClusters clusters;
  RegionFinder regions;
  SurfacePool pool;
  DeformedSurface root;  ///< for boxes of whole bodies
};

/// What was kept of one pair: a range of ids.
struct PairIds {
  BodyPair pair;
  std::size_t first = 0, count = 0;

  template <class Self>
  static auto state_fields(Self& s) {
    return std::tie(s.pair.a, s.pair.b, s.first, s.count);
  }
};

/// The ids of the contacts that were kept of each pair, ascending.
struct KeptIds {
  std::vector<PairIds> pairs;
  std::vector<std::uint64_t> ids;

  std::span<const std::uint64_t> of(const BodyPair& pair) const {
    const auto known = std::lower_bound(pairs.begin(), pairs.end(), pair,
                                        [](const PairIds& entry, const BodyPair& p) { return entry.pair < p; });
    if (known == pairs.end() || known->pair != pair) return {};
    return std::span(ids).subspan(known->first, known->count);
  }
  /// @param contacts by pair and id, ascending
  void keep(std::span<const ContactPoint> contacts) {
    pairs.clear();
    ids.clear();
    for (const ContactPoint& c : contacts) {
      const BodyPair pair{c.a.body, c.b.body};
      if (pairs.empty() || pairs.back().pair != pair) pairs.push_back({pair, ids.size(), 0});
      ++pairs.back().count;
      ids.push_back(c.id);
    }
  }
};

}  // namespace limber::internal
