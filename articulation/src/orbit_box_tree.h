/// @file orbit_box_tree.h
/// A tree over boxes in the orbit plane (see orbit_index.h). Private to the articulation module.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "limber/core/types.h"

namespace limber::internal {

/// A box in the orbit plane.
struct OrbitBox {
  std::array<double, 2> low{1e300, 1e300}, high{-1e300, -1e300};
  void add(double first, double second) {
    low = {std::min(low[0], first), std::min(low[1], second)};
    high = {std::max(high[0], first), std::max(high[1], second)};
  }
  void add(const OrbitBox& other) {
    add(other.low[0], other.low[1]);
    add(other.high[0], other.high[1]);
  }
  void grow(double by) {
    for (std::size_t i = 0; i < 2; ++i) low[i] -= by, high[i] += by;
  }
  bool overlaps(const OrbitBox& other) const {
    return (low[0] <= other.high[0]) & (other.low[0] <= high[0]) & (low[1] <= other.high[1]) &
           (other.low[1] <= high[1]);
  }
};

/// Boxes split at the median. Queries answer with places in order(), which is near in place for what is near in the
/// plane.
class OrbitBoxTree {
 public:
  explicit OrbitBoxTree(const std::vector<OrbitBox>& boxes);

  /// Per place, the number of the box as given.
  const std::vector<Index>& order() const { return order_; }
  const OrbitBox& box(Index place) const { return boxes_[static_cast<std::size_t>(place)]; }

  /// Calls use(place) for each box that overlaps, until it returns true; returns whether it did.
  template <class Use>
  bool any_overlapping(const OrbitBox& box, Use&& use) const {
    if (nodes_.empty() || !nodes_.front().box.overlaps(box)) return false;
    std::array<Index, 64> stack;  // a tree split at the median is never that deep
    std::size_t depth = 0;
    stack[depth++] = 0;
    const auto visit = [&](Index id) {
      if (nodes_[static_cast<std::size_t>(id)].box.overlaps(box)) stack[depth++] = id;
    };
    while (depth > 0) {
      const Index id = stack[--depth];
      const Node& node = nodes_[static_cast<std::size_t>(id)];
      if (node.right >= 0) {
        visit(node.right);
        visit(id + 1);
        continue;
      }
      for (Index place = node.first; place < node.first + node.count; ++place)
        if (boxes_[static_cast<std::size_t>(place)].overlaps(box) && use(place)) return true;
    }
    return false;
  }

 private:
  struct Node {
    OrbitBox box;
    Index first = 0, count = 0;  ///< of a leaf
    Index right = -1;            ///< of an inner node; left is the next node
  };
  struct Entry {
    OrbitBox box;
    Index number = 0;
  };
  Index build(std::vector<Entry>& entries, Index first, Index count);

  std::vector<Node> nodes_;
  std::vector<OrbitBox> boxes_;
  std::vector<Index> order_;
};

}  // namespace limber::internal
