// The vector loop behind BroadPhase. Raw pointers only: the file that implements it is compiled for several instruction
// sets, so neither Eigen nor a header that includes it may reach it.
#pragma once

#include <cstddef>
#include <cstdint>

namespace limber {

inline constexpr std::size_t kSweepPadding = 16;  ///< entries behind the last, of low[0] = infinity
inline constexpr std::size_t kSweepPiece = 1024;  ///< columns tested by one call at most; a multiple of kSweepPadding

/// Boxes in single precision, ascending in low[0].
struct SweepBoxes {
  const float* low[3];
  const float* high[3];
  std::size_t count;
};

struct SweepPiece {
  std::size_t hits;  ///< how many were written
  std::size_t next;  ///< the column to go on from; `count` where the row is done
};

/// Which of the boxes from column `from` on overlap box `row`: their numbers, ascending, into `hits` (room for
/// kSweepPiece + kSweepPadding). Stops where low[0] exceeds the row's high[0].
SweepPiece sweep_row(const SweepBoxes& boxes, std::size_t row, std::size_t from, std::uint32_t* hits);

}  // namespace limber
