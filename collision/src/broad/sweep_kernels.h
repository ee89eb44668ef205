// The vector loop behind BroadPhase. Raw pointers only: the file that implements it is compiled for several instruction
// sets, so neither Eigen nor a header that includes it may reach it.
#pragma once

#include <cstddef>
#include <cstdint>

namespace limber::internal {

inline constexpr std::size_t kSweepPadding = 16;  ///< entries behind the last, of low[0] = infinity
inline constexpr std::size_t kSweepHits = 1024;   ///< room for what one call finds

/// Boxes in single precision, ascending in low[0].
struct SweepBoxes {
  const float* low[3];
  const float* high[3];
  std::size_t count;
};

struct SweepHit {
  std::uint32_t row, column;  ///< row < column
};

/// Where a sweep stands.
struct SweepCursor {
  std::size_t row, column;
};

/// Finds overlaps of rows before `last` with later boxes and moves the cursor on behind them, until its row is `last`
/// or there may be no room for more: call again then. @return how many hits were written
std::size_t sweep_rows_on(const SweepBoxes& boxes, std::size_t last, SweepCursor& cursor, SweepHit* hits);

}  // namespace limber::internal
