#include "types/bridges.h"

#include <algorithm>
#include <cstddef>
#include <limits>

namespace limber::internal {
namespace {

/// One way out of a node.
struct WayOut {
  Index to = 0;
  std::size_t edge = 0;
};

/// A node on the way from the start of the search.
struct Visit {
  Index node = 0;
  std::size_t came_by = std::numeric_limits<std::size_t>::max();
  std::size_t tried = 0;  ///< of its ways out
};

class BridgeSearch {
 public:
  BridgeSearch(Index nodes, std::span<const std::pair<Index, Index>> edges)
      : ways_(static_cast<std::size_t>(nodes)),
        seen_(ways_.size(), 0),
        earliest_(ways_.size(), 0),
        is_bridge_(edges.size(), false) {
    for (std::size_t e = 0; e < edges.size(); ++e) {
      ways_[static_cast<std::size_t>(edges[e].first)].push_back({edges[e].second, e});
      ways_[static_cast<std::size_t>(edges[e].second)].push_back({edges[e].first, e});
    }
  }

  std::vector<bool> run() {
    for (Index n = 0; n < static_cast<Index>(ways_.size()); ++n) {
      if (seen(n) != 0) continue;
      enter(n, std::numeric_limits<std::size_t>::max());
      while (!visits_.empty()) step();
    }
    return is_bridge_;
  }

 private:
  Index& seen(Index n) { return seen_[static_cast<std::size_t>(n)]; }
  Index& earliest(Index n) { return earliest_[static_cast<std::size_t>(n)]; }

  void enter(Index n, std::size_t by) {
    seen(n) = earliest(n) = ++count_;
    visits_.push_back({n, by});
  }

  void step() {
    Visit& at = visits_.back();
    const auto& ways = ways_[static_cast<std::size_t>(at.node)];
    if (at.tried == ways.size()) return leave();
    const WayOut way = ways[at.tried++];
    if (way.edge == at.came_by) return;
    if (seen(way.to) == 0)
      enter(way.to, way.edge);
    else
      earliest(at.node) = std::min(earliest(at.node), seen(way.to));
  }

  void leave() {
    const Visit left = visits_.back();
    visits_.pop_back();
    if (visits_.empty()) return;
    const Index before = visits_.back().node;
    earliest(before) = std::min(earliest(before), earliest(left.node));
    is_bridge_[left.came_by] = earliest(left.node) == seen(left.node);
  }

  std::vector<std::vector<WayOut>> ways_;  ///< per node
  std::vector<Index> seen_;                ///< per node, as which one the search came there, from 1
  std::vector<Index> earliest_;            ///< per node, that is reached from beyond it
  std::vector<bool> is_bridge_;            ///< per edge
  std::vector<Visit> visits_;
  Index count_ = 0;
};

}  // namespace

std::vector<bool> find_bridges(Index nodes, std::span<const std::pair<Index, Index>> edges) {
  return BridgeSearch(nodes, edges).run();
}

}  // namespace limber::internal
