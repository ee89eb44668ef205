// The vector loops of contact by small steps. Plain data only: the file that implements them is compiled for several
// instruction sets, so neither Eigen nor a header that includes it may reach it.
//
// A body has blocks of eight coordinates: its frame first, then its modes. Coordinates are scaled so that what a row
// moves them by, per unit of a force held over the substep, is the row again (small_steps.h). A contact has three rows
// a side, along the normal and two tangents, block by block: rows of block k at rows + 3 k, + 1, + 2.
//
// Every result is the same bits on every instruction set that has fused multiply-add.
#pragma once

#include <cstddef>
#include <cstdint>

#include "../tuning.h"

namespace limber::internal {

struct alignas(32) Block8 {
  float v[8] = {};
};

/// How a frame has moved since the rows were made: a point at r in the body has come by shift + turned r, turned the
/// change of the attitude R.
struct FrameShift {
  float shift[3] = {}, turned[9] = {};          // row by row
  float attitude[9] = {};                       // R at the substep's start, row by row; of led bodies alone
  float carried[3] = {}, carried_turn[3] = {};  // what a led body is moved by in the substep at hand, whatever acts
  bool is_carried = false;
};

struct ContactSideRows {
  std::int32_t rows = 0;    // first block
  std::int32_t body = 0;    // first block of its coordinates
  std::int32_t blocks = 0;  // 0: the side does not move
  std::int32_t frame = 0;   // its number
  float arm[3] = {};        // of the point that the body carries along, body axes
  float lever[3] = {};      // from the origin to where the body touches, world
};

/// Stages of a contact that rebounds. Each takes one substep, but for 0, in which it is open, and the last one: bodies
/// come together up to kTogether, part up to kParted, and stay there while they press.
inline constexpr float kTogether = kConstraintsTuning.small_steps.together,
                       kParted = kTogether + kConstraintsTuning.small_steps.parting;

/// One contact as the sweeps see it. Lengths in m, forces in N, held over the substep.
struct ContactRow {
  ContactSideRows side[2];
  float axes[3][3] = {};  // normal, tangents; world
  float rest = 0.0f;      // the gap at the step's start less what the modes give it
  float friction = 0.0f, slop = 0.0f;
  float running[2] = {};    // of the surfaces along the tangents, m a substep
  float compliance = 0.0f;  // m/N
  float inverse_normal = 0.0f, inverse_tangent = 0.0f, inverse_push = 0.0f;  // effective masses, N/m
  float coupling[2] = {};                                                    // of the normal with the tangents
  float gap = 0.0f, target = 0.0f, slip[2] = {};  // what the rows' own numbers are added to; wanted gap
  float now = 0.0f;                               // the gap at the substep's start
  float force[3] = {}, before = 0.0f;             // the latter: along the normal in the last substep
  float push = 0.0f, part = 0.0f;                 // what displaces frames; how far they are to part in the substep, m
  float rebound = 0.0f;                           // e² of a contact between rigid bodies
  float fall = 0.0f;                              // what free motion adds to the gap in a substep, m
  float stage = 0.0f, energy = 0.0f;  // J: what it took as they come together, then what it has still to give
  float release = 0.0f;               // of that, what it gives in the coming substep
};

/// Resistance of a round contact to rolling and spinning: a moment up to `radius` times the contact's normal force.
struct RollingRow {
  std::int32_t contact = 0;
  std::int32_t rows[2] = {};  // three blocks a side that moves
  float radius = 0.0f, inverse = 0.0f;
  float moment[3] = {};  // N·m
};

struct SweepArrays {
  const Block8* rows = nullptr;
  Block8* motion = nullptr;  // coordinates at the substep's end, as found so far
};

/// Gaps at the substep's start, and what their rows are to add up to. @param shapes the modes at the substep's start,
/// by block. @param share of an overlap beyond the slop that is undone in the substep. @param most m
/// @return whether any is to be pushed apart
bool measure_contacts(ContactRow* contacts, std::size_t count, const Block8* rows, const Block8* shapes,
                      const FrameShift* frames, float share, float most);

/// At a substep's end: what contacts that rebound took and are to give. @param free the coordinates that the bodies
/// would have come to by themselves. @param motion those at the end
void note_rebounds(ContactRow* contacts, std::size_t count, const Block8* rows, const Block8* free,
                   const Block8* motion);

/// One sweep of Gauss–Seidel: each contact's normal, then both tangents by one step.
void sweep_contacts(ContactRow* contacts, std::size_t count, RollingRow* rolling, std::size_t rolling_count,
                    bool backward, const SweepArrays& arrays);

/// One sweep over displacements of the frames alone that part what overlaps. @param pushes by frame
void push_contacts(ContactRow* contacts, std::size_t count, bool backward, const Block8* rows, Block8* pushes);

/// The largest approach that the rows still show, m: how far from their law the sweeps ended.
float residual_of_contacts(const ContactRow* contacts, std::size_t count, const SweepArrays& arrays);

/// motion += rows · force, of all contacts: what they begin the step with.
void apply_forces(const ContactRow* contacts, std::size_t count, const RollingRow* rolling, std::size_t rolling_count,
                  const SweepArrays& arrays);

}  // namespace limber::internal
