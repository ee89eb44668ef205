/// @file limber/constraints/island_status.h
/// How the step of an island ended.
#pragma once

#include <array>
#include <cstddef>

namespace limber {

enum class IslandStatus {
  kSolved,  ///< every row is within its tolerance
  kLimit,   ///< a limit of work or of iterations ended the search, or no motion meets all rows (hands that contradict
            ///< each other): the best impulses found act, and the residual tells how far from the rows' law they are
  kFailed,  ///< impulses or bending were given up, as the energy would have risen or no motion was found: rows may be
            ///< violated by any amount
};

/// Islands by how their steps ended.
class IslandStatusCounts {
 public:
  int& operator[](IslandStatus s) { return counts_[static_cast<std::size_t>(s)]; }
  int operator[](IslandStatus s) const { return counts_[static_cast<std::size_t>(s)]; }
  void add(const IslandStatusCounts& other) {
    for (std::size_t i = 0; i < counts_.size(); ++i) counts_[i] += other.counts_[i];
  }
  /// The worst; kSolved where there are none.
  IslandStatus worst() const {
    if ((*this)[IslandStatus::kFailed] > 0) return IslandStatus::kFailed;
    return (*this)[IslandStatus::kLimit] > 0 ? IslandStatus::kLimit : IslandStatus::kSolved;
  }

 private:
  std::array<int, 3> counts_{};
};

}  // namespace limber
