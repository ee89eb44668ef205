// The vector loops of contact by small steps: eight pairs of bodies at a time, one in each lane. Plain data only, as in
// coordinate_blocks.h.
//
// A contact has three rows a side, along the normal and two tangents. Lengths in m, forces in N, held over the substep.
// No two pairs of a bundle share a body that moves, so that each lane sees what one contact after the other would.
// Every result is the same bits on every instruction set that has fused multiply-add, whatever its vectors' length.
#pragma once

#include "../tuning.h"
#include "coordinate_blocks.h"

namespace limber::internal {

inline constexpr std::size_t kBundleLanes = 8;

/// Stages of a contact that rebounds. Each takes one substep, but for 0, in which it is open, and the last one: bodies
/// come together up to kTogether, part up to kParted, and stay there while they press.
inline constexpr float kTogether = kConstraintsTuning.small_steps.together,
                       kParted = kTogether + kConstraintsTuning.small_steps.parting;

/// Up to eight pairs. Contact k of all is contacts[first + k].
struct PairBundle {
  std::int32_t frame[2][kBundleLanes] = {};   // into FrameShifts and pushes; one past the last: stands
  std::int32_t motion[2][kBundleLanes] = {};  // into the blocks of coordinates; one past the last: stands
  Block8 root[2][3];                          // h/√m along each axis of the world; 0: its origin does not move so
  Block8 scale[2][3][3];                      // coordinates of the turn per moment held over the substep, row by row
  std::int32_t blocks[2][kBundleLanes] = {};  // of each lane's modes
  std::int32_t modes[2] = {};                 // the most in any lane, in whole blocks
  std::int32_t rows = 0;                      // of its first contact's modes
  std::int32_t first = 0, count = 0;
  Block8 inverse_turn;    // effective inertia of resistance to rolling, N·m/rad
  bool rolls = false;     // whether any resists rolling
  bool rebounds = false;  // whether any does
  bool carried = false;   // whether any body is led
  bool overlaps = false;  // whether any is to be pushed apart
  float residual = 0.0f;  // the largest approach that the rows still show, m: how far from their law sweeps ended
  // By lane, of the forces f after the forward sweep: f·c₀ and f C f, and what rebounds and springs may give, as
  // GameContacts::limit_forces() has them.
  Block8 open, yielded, given;
};

/// One contact in each lane. A lane without a contact has masses and rows of 0.
struct BundleContact {
  Block8 axes[3][3];     // normal, tangents; world: [axis][component]
  Block8 turn[2][3][3];  // rows of the sides' turns: [side][axis][component]
  Block8 arm[2][3];      // of the point that the body carries along, body axes
  Block8 lever[2][3];    // from the origin to where the body touches, world
  Block8 rest;           // the gap at the step's start less what the modes give it
  Block8 friction, slop;
  Block8 compliance;                                     // m/N
  Block8 inverse_normal, inverse_tangent, inverse_push;  // effective masses, N/m
  Block8 coupling[2];                                    // of the normal with the tangents
  Block8 running[2];                                     // of the surfaces along the tangents, m a substep
  Block8 now;                                            // the gap at the substep's start
  Block8 gap, slip[2], target;                           // what the rows' own numbers are added to; wanted gap
  Block8 force[3], before;                               // the latter: along the normal in the last substep
  Block8 push, part;                                     // what displaces frames; the overlap beyond the slop, m
  Block8 sum[3];                                         // of the substeps' forces, N
  Block8 radius, moment[3];  // resistance to rolling and spinning: a moment up to radius × normal force, N·m
  Block8 rebound;            // e² of a contact between rigid bodies
  Block8 fall;               // what free motion adds to the gap in a substep, m
  Block8 stage, energy;      // J: what it took as they come together, then what it has still to give
  Block8 release;            // of that, what it gives in the coming substep
};

/// Kernels of different bundles may run at once, but for those that change coordinates: these where no body is shared.
struct BundleArrays {
  PairBundle* bundles = nullptr;
  BundleContact* contacts = nullptr;
  Block8* rows = nullptr;     // of modes: by contact, side, mode and axis
  Block8* room = nullptr;     // for the modes of the bundle at hand, a block a mode
  std::size_t width = 0;      // the most modes of a bundle, of both sides
  std::size_t count = 0;      // of bundles
  std::int32_t zeros = 0;     // the block of coordinates that stands
  std::int32_t standing = 0;  // number of frames: where what stands is found

  BundleArrays part(std::size_t begin, std::size_t end) const {
    return {bundles + begin, contacts, rows, room + begin * width, width, end - begin, zeros, standing};
  }
};

/// What a side moves by as its body bends: U of its triangle's corners, or of both sides' where a body touches itself.
struct ModePoint {
  const float* rows[6][3] = {};  // by corner and axis of the body, padded to whole blocks
  float weight[6] = {};
  std::size_t corners = 0;       // those of a weight
  float axes[3][3] = {};         // the contact's, in those of the body: [axis][component]
  const float* roots = nullptr;  // √ρ, padded likewise
  std::size_t blocks = 0;
};
/// √ρ n·R U of one contact in each lane. @param points null: a lane without. @param rows three a mode, by axis
/// @param modes whole blocks
void make_mode_rows(const ModePoint* const* points, std::int32_t modes, Block8* rows);

/// Rows of frames and effective masses, from axes, levers and the rows of modes; takes from the gaps in `rest` what the
/// modes give them. @param shapes with a block of zeros at their end
void make_bundle_rows(const BundleArrays& bundles, const Block8* shapes);
/// Gaps at the substep's start, and what their rows are to add up to; whether any is to be pushed apart is told to each
/// bundle. @param frames with one that stands at their end. @param shapes the modes at the substep's start, with a
/// block of zeros at their end
void measure_bundles(const BundleArrays& bundles, const FrameShift* frames, const Block8* shapes);
/// One sweep of Gauss–Seidel: each contact's normal, then both tangents by one step. A forward one takes the normals of
/// a pair backward first, and tells bundles what their forces do; a backward one adds them up. @param motion
/// coordinates at the substep's end, as found so far, with a block of zeros at their end
void sweep_bundles(const BundleArrays& bundles, bool backward, Block8* motion);
/// One sweep over displacements of the frames alone that part what overlaps: an implicit Euler step of the flow down
/// ½ Σ k (overlap − slop)², whose k undoes a `share` of one overlap alone. So pushes against each other come to rest.
/// @param most by one contact, m. @param pushes by frame, with a block of zeros at their end
void push_bundles(const BundleArrays& bundles, bool backward, float share, float most, Block8* pushes);
/// Tells each bundle its residual.
void find_residuals(const BundleArrays& bundles, const Block8* motion);
/// motion += rows · force, of all contacts: what they begin the step with.
void apply_bundle_forces(const BundleArrays& bundles, Block8* motion);
/// Leaves a share of each lane's forces. @param shares by bundle
void scale_bundle_forces(const BundleArrays& bundles, const Block8* shares);
/// At a substep's end: what contacts that rebound took and are to give. @param free the coordinates that the bodies
/// would have come to by themselves. @param motion those at the end; both with a block of zeros at their end
void note_bundle_rebounds(const BundleArrays& bundles, const Block8* free, const Block8* motion);

}  // namespace limber::internal
