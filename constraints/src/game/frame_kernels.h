// The vector loops of the frames of bodies by small steps: eight at a time, one in each lane, in double. Plain data
// only, as in coordinate_blocks.h, whose coordinates these are.
//
// Every result is the same bits on every instruction set that has fused multiply-add, whatever its vectors' length.
#pragma once

#include "coordinate_blocks.h"

namespace limber::internal {

inline constexpr std::size_t kFramesAtOnce = 8;

struct alignas(64) Double8 {
  double v[kFramesAtOnce] = {};
};
inline constexpr Double8 kOnes{{1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0}};

/// Eight frames, from substep to substep. Of led ones (game_bodies.h) the loops move the turn alone. A lane without a
/// body is a free one at rest, so that it asks for no way of the loops that the others do not.
struct EightFrames {
  // Blocks of their coordinates; −1: a lane without a body, as are those after it.
  std::int32_t first[kFramesAtOnce] = {-1, -1, -1, -1, -1, -1, -1, -1};
  Double8 start[3][3];                       // R at the step's start
  Double8 turn_scale[3][3];                  // ω = turn_scaleᵀ coordinates
  Double8 momentum[3][3];                    // L = momentumᵀ coordinates, world
  Double8 keeps_axes;                        // 1: its rows stay while it turns, so that its momentum tells how; 0: else
  Double8 turns_axes = kOnes;                // 1: turn_frames() is for it; 0: else
  Double8 principal[3][3];                   // its principal axes in the body, as columns
  Double8 roots[3] = {kOnes, kOnes, kOnes};  // of the moments of inertia about them
  Double8 per_turn[3] = {kOnes, kOnes, kOnes};  // 1/roots; 0: it does not turn about that axis
  Double8 root_mass, per_root = kOnes;          // √m, 1/√m; 0: led
  /// With a substep's loads and damping v becomes left v + gain, and so do the turn's coordinates.
  struct Loads {
    Double8 left, gain[3], turn_left, turn_gain[3];
    Double8 torque[3];  // of which the turn's coordinates have turn_gain
  } loads;
  struct Now {
    Double8 shift[3], attitude[4] = {kOnes}, v[3], turn[3];
    Double8 free_turn[3];  // the turn of the substep at hand if nothing acted
    Double8 turned[4];     // by the last substep
    Double8 from[4];       // attitude at the start of the substep
    Double8 way[3];        // by how much place_frames() is to turn it
  } now;
};

struct FrameArrays {
  EightFrames* frames = nullptr;
  std::size_t count = 0;  // of eights
  FrameShift* shifts = nullptr;
  const Block8* pushes = nullptr;
  Block8 *free = nullptr, *motion = nullptr, *answers = nullptr;
  double length = 0.0;  // h, s

  FrameArrays part(std::size_t begin, std::size_t end) const {
    FrameArrays out = *this;
    out.frames += begin, out.count = end - begin;
    out.shifts += kFramesAtOnce * begin, out.pushes += kFramesAtOnce * begin;
    return out;
  }
};

/// Free turns here keep momentum and energy whatever their length: the implicit midpoint rule, by Cayley's map.
///
/// Coordinates of turns become those about the principal axes as they will be after half of a time, by the momentum.
void turn_frames(const FrameArrays& all, double time);
/// Loads and damping; free motion, y with the answers of the substep before, and how frames have shifted.
void begin_frames(const FrameArrays& all);
/// Answers, and where frames go by them. @param pushed whether pushes move them too
void end_frames(const FrameArrays& all, bool pushed);
/// Of what turns its axes: where its momentum brings it by the substep's end, and then its way.
/// @param again whether the momentum has changed
void place_frames(const FrameArrays& all, bool again);

}  // namespace limber::internal
