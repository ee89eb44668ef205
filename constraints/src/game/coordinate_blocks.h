// Coordinates of bodies as the vector loops of small steps see them. Plain data only: the files that implement the
// loops are compiled for several instruction sets, so neither Eigen nor a header that includes it may reach them.
//
// A body has blocks of eight coordinates: its frame first, then its modes. Coordinates are scaled so that what a row
// moves them by, per unit of a force held over the substep, is the row again (small_steps.h).
#pragma once

#include <cstddef>
#include <cstdint>

namespace limber::internal {

struct alignas(32) Block8 {
  float v[8] = {};
};

/// How a frame has moved since the rows were made: a point at r in the body has come by shift + turned r, turned the
/// change of the attitude. A led body is moved by carried + swung r in the substep at hand, whatever acts.
struct FrameShift {
  float shift[3] = {}, turned[9] = {};  // row by row
  float carried[3] = {}, swung[9] = {};
  float carried_turn[3] = {};
};

}  // namespace limber::internal
