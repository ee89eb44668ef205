/// @file orbit_box_tree.h
/// A tree over boxes in the orbit plane (see orbit_index.h). Private to the articulation module.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
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

/// Boxes packed along a Hilbert curve through their centres, eight to a node (Kamel and Faloutsos 1993). Queries answer
/// with places in order(), ascending; what is near in place is near in the plane.
class OrbitBoxTree {
 public:
  explicit OrbitBoxTree(const std::vector<OrbitBox>& boxes);

  /// Per place, the number of the box as given.
  const std::vector<Index>& order() const { return order_; }
  const OrbitBox& box(Index place) const { return boxes_[static_cast<std::size_t>(place)]; }

  /// Calls use(place) for each box that overlaps, to within the rounding of single precision, until it returns true;
  /// returns whether it did.
  template <class Use>
  bool any_overlapping(const OrbitBox& box, Use&& use) const {
    if (boxes_.empty()) return false;
    struct Entry {
      std::size_t level, node;
    };
    std::array<Entry, kWidth * 12> stack;  // a level leaves seven entries; 8¹¹ boxes are more than an Index counts
    std::size_t depth = 0;
    stack[depth++] = {levels_.size() - 1, 0};
    const Rounded rounded(box);
    while (depth > 0) {
      const auto [level, node] = stack[--depth];
      Lanes lanes = nodes_[levels_[level] + node].overlapping(rounded);
      if (level > 0) {
        for (; lanes != 0; lanes &= ~last_of(lanes)) stack[depth++] = {level - 1, kWidth * node + lane(last_of(lanes))};
        continue;
      }
      for (; lanes != 0; lanes &= lanes - 1) {
        if (use(static_cast<Index>(kWidth * node + lane(lanes)))) return true;
      }
    }
    return false;
  }

 private:
  static constexpr std::size_t kWidth = 8;
  using Lanes = std::uint64_t;  ///< a byte each, 0 or 1
  static std::size_t lane(Lanes first) { return static_cast<std::size_t>(std::countr_zero(first)) / 8; }
  static Lanes last_of(Lanes lanes) { return std::bit_floor(lanes); }

  /// A box in single precision that holds the one given.
  struct Rounded {
    explicit Rounded(const OrbitBox& box);
    std::array<float, 2> low{}, high{};
  };
  /// Eight boxes, of children or as given; those that are not there overlap nothing.
  struct Node {
    Node();
    void set(std::size_t lane, const Rounded& box);
    Rounded around() const;
    Lanes overlapping(const Rounded& box) const {
      std::array<unsigned char, kWidth> lanes;
      for (std::size_t i = 0; i < kWidth; ++i)
        lanes[i] = static_cast<unsigned char>((low[0][i] <= box.high[0]) & (box.low[0] <= high[0][i]) &
                                              (low[1][i] <= box.high[1]) & (box.low[1] <= high[1][i]));
      return std::bit_cast<Lanes>(lanes);
    }
    std::array<std::array<float, kWidth>, 2> low, high;
  };

  std::vector<Node> nodes_;
  std::vector<std::size_t> levels_;  ///< the first node of each, leaves first, the root last
  std::vector<OrbitBox> boxes_;
  std::vector<Index> order_;
};

}  // namespace limber::internal
