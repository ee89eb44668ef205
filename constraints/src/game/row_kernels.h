// The vector loops of the rows of handles, joints and other constraints in a substep (game_rows.h), block by block of
// eight coordinates, in double. Plain data only, as in coordinate_blocks.h.
//
// Every result is the same bits on every instruction set that has fused multiply-add, whatever its vectors' length.
#pragma once

#include "frame_kernels.h"

namespace limber {
class Constraint;
}

namespace limber::internal {

/// A body in the rows of one constraint: as many blocks a row as it has.
struct GameSide {
  std::int32_t frame = -1, blocks = 0;  // frame −1: none
  std::int32_t body = 0, at = 0;        // first blocks: of its coordinates, and of the first row in J
};

/// The rows of one constraint.
struct GameGroup {
  Constraint* constraint = nullptr;
  std::uint32_t first = 0, count = 0;  // of its rows
  GameSide sides[2];
};

/// J, and W of the first block of each frame (game_rows.h).
struct RowArrays {
  const GameGroup* groups = nullptr;
  std::size_t count = 0;
  const Double8 *numbers = nullptr, *weights = nullptr;
};

/// Some rows of a group, by number in it.
struct RowsOfGroup {
  const GameGroup* group = nullptr;
  const std::int32_t* rows = nullptr;
  std::size_t count = 0;
};

/// J y. @param product one number for each row
void multiply_rows(const RowArrays& J, const Double8* y, double* product);
/// y += W Jᵀ f. @param forces likewise
void add_answer_of_rows(const RowArrays& J, const double* forces, Double8* y);
/// A part of J W Jᵀ, row by row; of rows by themselves its lower part.
void multiply_pair(const RowArrays& J, const RowsOfGroup& rows, const RowsOfGroup& columns, double* to);

}  // namespace limber::internal
