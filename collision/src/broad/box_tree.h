// A binary tree of boxes, one leaf per body, in which bodies come and go in O(log n).
#pragma once

#include <vector>

#include "limber/collision/aabb.h"

namespace limber::internal {

/// Leaves are put where they grow the tree's surface least, and each ancestor is then turned where that lowers it
/// further (Kopta et al., *Fast, Effective BVH Updates for Animated Scenes*, 2012), which keeps the tree shallow
/// whatever the order of insertion.
class BoxTree {
 public:
  /// @return the leaf's node
  Index insert(Index body, const Aabb& box);
  void remove(Index node);
  bool empty() const { return root_ < 0; }

  /// Calls visit(body, box) for each leaf under nodes for all of which wanted(box) holds, in an order that depends on
  /// the calls so far only. @param stack scratch
  template <class Wanted, class Visit>
  void visit(const Wanted& wanted, const Visit& visit, std::vector<Index>& stack) const {
    if (root_ < 0) return;
    stack.assign(1, root_);
    while (!stack.empty()) {
      const Node& node = nodes_[static_cast<std::size_t>(stack.back())];
      stack.pop_back();
      if (!wanted(node.box)) continue;
      if (node.child[0] < 0) {
        visit(node.body, node.box);
      } else {
        stack.push_back(node.child[0]);
        stack.push_back(node.child[1]);
      }
    }
  }

 private:
  struct Node {
    Aabb box;
    Index parent = -1;  ///< of a free node: the next free one
    Index child[2] = {-1, -1};
    Index body = -1;  ///< leaves only
  };

  Node& at(Index node) { return nodes_[static_cast<std::size_t>(node)]; }
  Index take_node();
  Index best_sibling(const Aabb& box) const;
  void replace_child(Index parent, Index old_child, Index new_child);
  void refit_upwards(Index node);
  void rotate(Index node);

  std::vector<Node> nodes_;
  Index root_ = -1, free_ = -1;
};

}  // namespace limber::internal
