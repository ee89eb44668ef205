/// @file limber/mesh/corner_tree.h
/// A tree of boxes over triangles or tetrahedra, of which it keeps the corners.
///
///   CornerTree<3> tree;
///   tree.build(corners);                                            // one std::array<Vec3, 3> for each triangle
///   tree.search(p, bound, all_matter, [&](Index place) { … });      // near leaves first, bound() may shrink
///   tree.any_leaf(may_matter, [&](Index first, Index end) { … });   // whatever the boxes let through
///
/// The tree halves the elements at the median of their centres, along the widest axis of these. Elements are named by
/// their *place* in the order of the leaves: corners(place), element(place). Nodes are numbered in depth-first order,
/// so that data of one's own for each node, such as a cone of normals, can stand in a vector beside the tree;
/// fill_upward() fills it. Building takes O(n log n), queries allocate nothing and may run at the same time.
///
/// It is the one tree over a resting mesh in limber: SurfaceLocator and TetLocator ask it for what is nearest, and
/// joint detection for what is nearest among faces that look one way, for rays, and for what a motion may sweep.
#pragma once

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "limber/core/types.h"

namespace limber {

template <std::size_t N>
class CornerTree {
 public:
  using Corners = std::array<Vec3, N>;

  /// @param most elements of a leaf, ≥ 1. @pre there is one element at least
  void build(const std::vector<Corners>& all, std::size_t most = 2) {
    element_.resize(all.size());
    std::iota(element_.begin(), element_.end(), Index{0});
    add_node(all, element_, 0, most);
    corners_.reserve(all.size());
    for (const Index e : element_) corners_.push_back(all[static_cast<std::size_t>(e)]);
  }

  const Corners& corners(Index place) const { return corners_[static_cast<std::size_t>(place)]; }
  /// Which one it is of those given.
  Index element(Index place) const { return element_[static_cast<std::size_t>(place)]; }
  /// Elements at the places [first, end).
  std::span<const Index> elements(Index first, Index end) const {
    return std::span(element_).subspan(static_cast<std::size_t>(first), static_cast<std::size_t>(end - first));
  }

  std::size_t nodes() const { return nodes_.size(); }
  /// Around all corners below a node; the root is node 0.
  const Eigen::AlignedBox3d& box(std::size_t node) const { return nodes_[node].box; }

  /// Calls visit(place) for the elements of leaves whose boxes lie within sqrt(bound()) of p and that may_matter(node)
  /// lets through, as it does all nodes above them; nearer boxes first.
  template <class Bound, class MayMatter, class Visit>
  void search(const Vec3& p, const Bound& bound, const MayMatter& may_matter, const Visit& visit) const {
    struct Waiting {
      std::size_t node;
      double squared_distance;
    };
    std::array<Waiting, kDeepest> stack;
    std::size_t size = 0;
    const auto put = [&](const Waiting& w) {
      if (w.squared_distance <= bound() && may_matter(w.node)) stack[size++] = w;
    };
    put({0, squared_distance(0, p)});
    while (size > 0) {
      const Waiting w = stack[--size];
      if (w.squared_distance > bound()) continue;
      const Node& node = nodes_[w.node];
      if (node.count > 0) {
        for (Index i = node.first; i < node.first + node.count; ++i) visit(i);
        continue;
      }
      Waiting near{w.node + 1, squared_distance(w.node + 1, p)};
      Waiting far{node.second_child, squared_distance(node.second_child, p)};
      if (far.squared_distance < near.squared_distance) std::swap(near, far);
      put(far);
      put(near);
    }
  }

  /// Calls use(first, end) with the places of each leaf that may_matter(node) lets through, as it does all nodes above
  /// it, until use returns true; returns whether it did. The leaf's own node is the last one asked about.
  template <class MayMatter, class Use>
  bool any_leaf(const MayMatter& may_matter, const Use& use) const {
    std::array<std::size_t, kDeepest> stack;
    std::size_t size = 0;
    stack[size++] = 0;
    while (size > 0) {
      const std::size_t number = stack[--size];
      if (!may_matter(number)) continue;
      const Node& node = nodes_[number];
      if (node.count > 0) {
        if (use(node.first, node.first + node.count)) return true;
        continue;
      }
      stack[size++] = node.second_child;
      stack[size++] = number + 1;
    }
    return false;
  }

  /// Calls leaf(node, first, end) and inner(node, first child, second child), each node after its children.
  template <class Leaf, class Inner>
  void fill_upward(const Leaf& leaf, const Inner& inner) const {
    for (std::size_t i = nodes_.size(); i-- > 0;)
      if (const Node& node = nodes_[i]; node.count > 0)
        leaf(i, node.first, node.first + node.count);
      else
        inner(i, i + 1, node.second_child);
  }

 private:
  static constexpr std::size_t kDeepest =
      64;  // a halving tree over 2³¹ elements is 31 deep and leaves one entry a level

  /// An inner node's first child follows it.
  struct Node {
    Eigen::AlignedBox3d box;
    std::size_t second_child = 0;  // inner nodes
    Index first = 0, count = 0;    // leaves: their elements; count 0 for inner nodes
  };

  double squared_distance(std::size_t node, const Vec3& p) const {
    const Eigen::AlignedBox3d& box = nodes_[node].box;
    return (box.min() - p).cwiseMax(p - box.max()).cwiseMax(Vec3::Zero()).squaredNorm();
  }

  static Vec3 sum(const Corners& corners) {
    Vec3 sum = corners[0];
    for (std::size_t i = 1; i < N; ++i) sum += corners[i];
    return sum;
  }

  void add_node(const std::vector<Corners>& all, std::span<Index> part, Index first, std::size_t most) {
    const std::size_t self = nodes_.size();
    nodes_.emplace_back();
    const auto corners_of = [&](Index e) -> const Corners& { return all[static_cast<std::size_t>(e)]; };
    Eigen::AlignedBox3d box, centres;
    for (const Index e : part) {
      for (const Vec3& x : corners_of(e)) box.extend(x);
      centres.extend(sum(corners_of(e)));
    }
    nodes_[self].box = box;
    if (part.size() <= most) {
      nodes_[self].first = first;
      nodes_[self].count = static_cast<Index>(part.size());
      return;
    }
    int axis = 0;
    centres.sizes().maxCoeff(&axis);
    const std::size_t half = part.size() / 2;
    const auto centre = [&](Index e) { return sum(corners_of(e))[axis]; };
    std::nth_element(part.begin(), part.begin() + static_cast<std::ptrdiff_t>(half), part.end(),
                     [&](Index a, Index b) { return std::pair(centre(a), a) < std::pair(centre(b), b); });
    add_node(all, part.first(half), first, most);
    nodes_[self].second_child = nodes_.size();
    add_node(all, part.subspan(half), first + static_cast<Index>(half), most);
  }

  std::vector<Node> nodes_;
  std::vector<Corners> corners_;  // in the order of the leaves
  std::vector<Index> element_;    // which each is of those given
};

}  // namespace limber
