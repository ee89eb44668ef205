/// @file limber/core/disjoint_sets.h
/// Sets of indices that grow together: connected parts of meshes (union–find with path halving).
#pragma once

#include <algorithm>
#include <numeric>
#include <vector>

#include "limber/core/types.h"

namespace limber {

/// A partition of the indices 0 … count − 1.
class DisjointSets {
 public:
  /// Every index a set of its own.
  explicit DisjointSets(std::size_t count = 0) { reset(count); }

  /// The same anew; allocates only where there are more than ever before.
  void reset(std::size_t count) {
    parent_.resize(count);
    std::iota(parent_.begin(), parent_.end(), Index{0});
  }

  /// The lowest index of the set that holds i. @pre 0 ≤ i < count
  Index root(Index i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }

  /// Makes one set of two. @return whether they were apart
  bool join(Index a, Index b) {
    a = root(a), b = root(b);
    parent_[std::max(a, b)] = std::min(a, b);
    return a != b;
  }

  /// Per index the number of its set; sets are numbered by their first index.
  std::vector<Index> labels() {
    std::vector<Index> label(parent_.size());
    Index count = 0;
    for (std::size_t i = 0; i < parent_.size(); ++i) {
      const Index r = root(static_cast<Index>(i));
      label[i] = r == static_cast<Index>(i) ? count++ : label[r];
    }
    return label;
  }

 private:
  std::vector<Index> parent_;
};

}  // namespace limber
