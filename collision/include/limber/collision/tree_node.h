/// @file limber/collision/tree_node.h
/// A node of a binary tree whose leaves hold ranges of a list.
#pragma once

#include <cstdint>

namespace limber {

/// Both children of a node lie side by side and after their parent.
struct TreeNode {
  std::int32_t child = -1;            ///< first child, the second is child + 1; −1: a leaf
  std::int32_t first = 0, count = 0;  ///< range of the list

  bool leaf() const { return child < 0; }
};

}  // namespace limber
