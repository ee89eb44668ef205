// A tree of boxes over triangles or tetrahedra, of which it keeps the corners: exact searches around a point.
#pragma once

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "limber/core/types.h"

namespace limber::internal {

template <std::size_t N>
class CornerTree {
 public:
  using Corners = std::array<Vec3, N>;

  /// @pre there is one element at least
  void build(const std::vector<Corners>& all) {
    element_.resize(all.size());
    std::iota(element_.begin(), element_.end(), Index{0});
    add_node(all, element_, 0);
    corners_.reserve(all.size());
    for (const Index e : element_) corners_.push_back(all[static_cast<std::size_t>(e)]);
  }

  /// By place in the tree, as search() tells it.
  const Corners& corners(Index i) const { return corners_[static_cast<std::size_t>(i)]; }
  /// Which one it is of those given.
  Index element(Index i) const { return element_[static_cast<std::size_t>(i)]; }

  /// Calls visit(i) for the elements of leaves whose boxes lie within sqrt(bound()) of p, nearer boxes first.
  template <class Bound, class Visit>
  void search(const Vec3& p, const Bound& bound, const Visit& visit) const {
    struct Waiting {
      std::size_t node;
      double squared_distance;
    };
    std::array<Waiting, 64> stack;  // a halving tree over 2³¹ elements is 31 deep
    std::size_t size = 0;
    stack[size++] = {0, nodes_[0].box.squared_distance(p)};
    while (size > 0) {
      const Waiting w = stack[--size];
      if (w.squared_distance > bound()) continue;
      const Node& node = nodes_[w.node];
      for (Index i = node.first; i < node.first + node.count; ++i) visit(i);
      if (node.count > 0) continue;
      Waiting near{w.node + 1, nodes_[w.node + 1].box.squared_distance(p)};
      Waiting far{node.second_child, nodes_[node.second_child].box.squared_distance(p)};
      if (far.squared_distance < near.squared_distance) std::swap(near, far);
      stack[size++] = far;
      stack[size++] = near;
    }
  }

 private:
  static constexpr std::size_t kLeafSize = 2;

  struct Box {
    Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity()), high = -low;
    void extend(const Vec3& p) { low = low.cwiseMin(p), high = high.cwiseMax(p); }
    double squared_distance(const Vec3& p) const {
      return (low - p).cwiseMax(p - high).cwiseMax(Vec3::Zero()).squaredNorm();
    }
  };
  /// In depth-first order: an inner node's first child follows it.
  struct Node {
    Box box;
    std::size_t second_child = 0;  // inner nodes
    Index first = 0, count = 0;    // leaves: their elements; count 0 for inner nodes
  };

  static Vec3 sum(const Corners& corners) {
    Vec3 sum = corners[0];
    for (std::size_t i = 1; i < N; ++i) sum += corners[i];
    return sum;
  }

  void add_node(const std::vector<Corners>& all, std::span<Index> part, Index first) {
    const std::size_t self = nodes_.size();
    nodes_.emplace_back();
    const auto corners_of = [&](Index e) -> const Corners& { return all[static_cast<std::size_t>(e)]; };
    Box box, centers;
    for (const Index e : part) {
      for (const Vec3& x : corners_of(e)) box.extend(x);
      centers.extend(sum(corners_of(e)));
    }
    nodes_[self].box = box;
    if (part.size() <= kLeafSize) {
      nodes_[self].first = first;
      nodes_[self].count = static_cast<Index>(part.size());
      return;
    }
    int axis = 0;
    (centers.high - centers.low).maxCoeff(&axis);
    const std::size_t half = part.size() / 2;
    const auto center = [&](Index e) { return sum(corners_of(e))[axis]; };
    std::nth_element(part.begin(), part.begin() + static_cast<std::ptrdiff_t>(half), part.end(),
                     [&](Index a, Index b) { return std::pair(center(a), a) < std::pair(center(b), b); });
    add_node(all, part.first(half), first);
    nodes_[self].second_child = nodes_.size();
    add_node(all, part.subspan(half), first + static_cast<Index>(half));
  }

  std::vector<Node> nodes_;
  std::vector<Corners> corners_;  // in the order of the leaves
  std::vector<Index> element_;    // which each is of those given
};

}  // namespace limber::internal
