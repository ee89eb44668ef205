#include "broad/box_tree.h"

namespace limber::internal {
namespace {

/// Half the surface: what a random line or box near it meets is proportional to it.
double half_area(const Aabb& box) {
  const Vec3 d = box.high - box.low;
  return d.x() * d.y() + d.y() * d.z() + d.z() * d.x();
}

Aabb joined(const Aabb& a, const Aabb& b) { return {a.low.cwiseMin(b.low), a.high.cwiseMax(b.high)}; }

}  // namespace

Index BoxTree::take_node() {
  if (free_ < 0) {
    nodes_.emplace_back();
    return static_cast<Index>(nodes_.size()) - 1;
  }
  const Index node = free_;
  free_ = at(node).parent;
  at(node) = {};
  return node;
}

/// Goes down to where the new box costs least: as a sibling here, or in the child whose area it grows least.
Index BoxTree::best_sibling(const Aabb& box) const {
  Index index = root_;
  for (;;) {
    const Node& node = nodes_[static_cast<std::size_t>(index)];
    if (node.child[0] < 0) return index;
    const double here = half_area(joined(node.box, box));
    const double inherited = here - half_area(node.box);
    double cost[2];
    for (int c = 0; c < 2; ++c) {
      const Node& child = nodes_[static_cast<std::size_t>(node.child[c])];
      cost[c] = inherited + half_area(joined(child.box, box)) - (child.child[0] < 0 ? 0.0 : half_area(child.box));
    }
    if (here < cost[0] && here < cost[1]) return index;
    index = node.child[cost[0] <= cost[1] ? 0 : 1];
  }
}

void BoxTree::replace_child(Index parent, Index old_child, Index new_child) {
  if (parent < 0) {
    root_ = new_child;
  } else {
    Node& node = at(parent);
    node.child[node.child[0] == old_child ? 0 : 1] = new_child;
  }
  at(new_child).parent = parent;
}

/// Of the swaps of a child with a grandchild on the other side, makes the one that shrinks the other child most.
void BoxTree::rotate(Index index) {
  Index best_child = -1, best_grandchild = -1;
  double best_gain = 0.0;
  for (int c = 0; c < 2; ++c) {
    const Index other = at(index).child[1 - c];
    if (at(other).child[0] < 0) continue;
    for (int g = 0; g < 2; ++g) {
      const Index stays = at(other).child[1 - g];
      const double gain = half_area(at(other).box) - half_area(joined(at(at(index).child[c]).box, at(stays).box));
      if (gain > best_gain) best_gain = gain, best_child = at(index).child[c], best_grandchild = at(other).child[g];
    }
  }
  if (best_child < 0) return;
  const Index other = at(best_grandchild).parent;
  replace_child(index, best_child, best_grandchild);
  replace_child(other, best_grandchild, best_child);
  at(other).box = joined(at(at(other).child[0]).box, at(at(other).child[1]).box);
}

void BoxTree::refit_upwards(Index index) {
  for (; index >= 0; index = at(index).parent) {
    at(index).box = joined(at(at(index).child[0]).box, at(at(index).child[1]).box);
    rotate(index);
  }
}

Index BoxTree::insert(Index body, const Aabb& box) {
  const Index leaf = take_node();
  at(leaf).box = box;
  at(leaf).body = body;
  if (root_ < 0) {
    root_ = leaf;
    return leaf;
  }
  const Index sibling = best_sibling(box), parent = take_node();
  replace_child(at(sibling).parent, sibling, parent);
  at(parent).child[0] = sibling;
  at(parent).child[1] = leaf;
  at(sibling).parent = at(leaf).parent = parent;
  refit_upwards(parent);
  return leaf;
}

void BoxTree::remove(Index leaf) {
  const Index parent = at(leaf).parent;
  if (parent < 0) {
    root_ = -1;
  } else {
    const Index sibling = at(parent).child[at(parent).child[0] == leaf ? 1 : 0], above = at(parent).parent;
    replace_child(above, parent, sibling);
    at(parent).parent = free_;
    free_ = parent;
    refit_upwards(above);
  }
  at(leaf).parent = free_;
  free_ = leaf;
}

}  // namespace limber::internal
