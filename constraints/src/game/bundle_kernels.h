// The vector loops of contacts between free or standing bodies: eight pairs at a time, one in each lane. Plain data
// only, as in sweep_kernels.h, whose coordinates these are.
//
// No two pairs of a bundle share a body that moves, so that each lane sees what one contact after the other would.
// Every result is the same bits on every instruction set that has fused multiply-add, whatever its vectors' length.
#pragma once

#include "sweep_kernels.h"

namespace limber::internal {

inline constexpr std::size_t kBundleLanes = 8;
inline constexpr std::int32_t kMostBundledModes = kConstraintsTuning.small_steps.most_bundled_modes;

/// Up to eight pairs. Contact k of all is contacts[first + k].
struct PairBundle {
  std::int32_t frame[2][kBundleLanes] = {};   // into FrameShifts and pushes; one past the last: stands
  std::int32_t motion[2][kBundleLanes] = {};  // into the blocks of coordinates; one past the last: stands
  Block8 root[2];                             // h/√m; 0: its origin does not move
  Block8 scale[2][3][3];                      // coordinates of the turn per moment held over the substep, row by row
  std::int32_t blocks[2][kBundleLanes] = {};  // of each lane's modes
  std::int32_t modes[2] = {};                 // the most in any lane, in whole blocks
  std::int32_t rows = 0;                      // of its first contact's modes
  std::int32_t first = 0, count = 0;
  Block8 inverse_turn;    // as RollingRow::inverse
  bool rolls = false;     // whether any resists rolling
  bool rebounds = false;  // whether any does
  bool overlaps = false;  // whether any is to be pushed apart
  float residual = 0.0f;  // as residual_of_contacts()
  // By lane, of the forces f after the forward sweep: f·c₀ and f C f, and what rebounds and springs may give, as
  // GameContacts::limit_forces() has them.
  Block8 open, yielded, given;
};

/// One contact in each lane; fields as those of ContactRow. A lane without a contact has masses and rows of 0.
struct BundleContact {
  Block8 axes[3][3];     // normal, tangents; world: [axis][component]
  Block8 turn[2][3][3];  // rows of the sides' turns: [side][axis][component]
  Block8 arm[2][3];      // body axes
  Block8 lever[2][3];    // world
  Block8 rest, friction, slop, compliance, inverse_normal, inverse_tangent, inverse_push, coupling[2], running[2];
  Block8 now, gap, slip[2], target, force[3], before, push, part;
  Block8 sum[3];             // of the substeps' forces, N
  Block8 radius, moment[3];  // as those of RollingRow
  Block8 rebound, fall, stage, energy, release;
};

/// Kernels of different bundles may run at once, but for those that change coordinates: these where no body is shared.
struct BundleArrays {
  PairBundle* bundles = nullptr;
  BundleContact* contacts = nullptr;
  Block8* rows = nullptr;     // of modes: by contact, side, mode and axis
  std::size_t count = 0;      // of bundles
  std::int32_t zeros = 0;     // the block of coordinates that stands
  std::int32_t standing = 0;  // number of frames: where what stands is found

  BundleArrays part(std::size_t begin, std::size_t end) const {
    return {bundles + begin, contacts, rows, end - begin, zeros, standing};
  }
};

/// What a point of a surface that bends by its modes moves by: U of its triangle's corners.
struct ModePoint {
  const float* rows[3][3] = {};  // by corner and axis of the body, padded to whole blocks
  float weight[3] = {};          // of the corners
  float axes[3][3] = {};         // the contact's, in those of the body: [axis][component]
  const float* roots = nullptr;  // √ρ, padded likewise
  std::size_t blocks = 0;
};
/// √ρ n·R U: three blocks, one an axis, of each eight modes.
void make_mode_rows(const ModePoint& point, Block8* rows);

/// Rows of frames and effective masses, from axes, levers and the rows of modes; takes from the gaps in `rest` what the
/// modes give them. @param shapes with a block of zeros at their end
void make_bundle_rows(const BundleArrays& bundles, const Block8* shapes);
/// As measure_contacts(), and whether any is to be pushed apart is told to each bundle. @param frames with one that
/// stands at their end. @param shapes with a block of zeros at theirs
void measure_bundles(const BundleArrays& bundles, const FrameShift* frames, const Block8* shapes, float share,
                     float most);
/// As sweep_contacts(); a forward one tells bundles what their forces do, a backward one adds them up. @param motion
/// with a block of zeros at its end
void sweep_bundles(const BundleArrays& bundles, bool backward, Block8* motion);
/// As push_contacts(). @param pushes with a block of zeros at their end
void push_bundles(const BundleArrays& bundles, bool backward, Block8* pushes);
/// Tells each bundle its residual.
void find_residuals(const BundleArrays& bundles, const Block8* motion);
/// As apply_forces().
void apply_bundle_forces(const BundleArrays& bundles, Block8* motion);
/// Leaves a share of each lane's forces. @param shares by bundle
void scale_bundle_forces(const BundleArrays& bundles, const Block8* shares);
/// As note_rebounds(). @param free, motion with a block of zeros at their end
void note_bundle_rebounds(const BundleArrays& bundles, const Block8* free, const Block8* motion);

}  // namespace limber::internal
