// Sets of indices that grow together (union–find with path halving).
#pragma once

#include <numeric>
#include <vector>

#include "limber/core/types.h"

namespace limber {

class DisjointSets {
 public:
  explicit DisjointSets(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), Index{0}); }

  Index root(Index i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(Index a, Index b) { parent_[root(a)] = root(b); }

  /// Per index the number of its set; sets are numbered by their first index.
  std::vector<Index> labels() {
    std::vector<Index> label_of_root(parent_.size(), -1), label(parent_.size());
    Index count = 0;
    for (std::size_t i = 0; i < parent_.size(); ++i) {
      Index& of_root = label_of_root[root(static_cast<Index>(i))];
      if (of_root < 0) of_root = count++;
      label[i] = of_root;
    }
    return label;
  }

 private:
  std::vector<Index> parent_;
};

}  // namespace limber
