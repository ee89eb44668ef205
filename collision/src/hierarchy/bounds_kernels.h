// The vector loops behind DeformedSurface. Raw pointers only: the file that implements them is compiled for several
// instruction sets, so neither Eigen nor a header that includes it may reach it.
#pragma once

#include <cstddef>
#include <cstdint>

#include "limber/collision/tree_node.h"

namespace limber::internal {

/// Coordinates and displacements are smaller, m: boxes are made in single precision, which ends at 3.4e38.
inline constexpr double kFarthest = 1e30;
/// Far below any length, m: what single precision may lose to underflow in the sums that make a box.
inline constexpr double kBoxUnderflow = 1e-36;

/// Rows of mode shapes and amplitudes are padded with zeros to a multiple of so many modes.
inline constexpr std::size_t kBoundsLanes = 8;

/// A box in single precision; the fourth lanes make it two whole vectors.
struct alignas(32) NodeBox {
  float low[3];
  std::uint32_t stamp;  ///< of the state it belongs to
  float high[3];
  float unused;
};

/// What a box is made of beside its rows, see CollisionSurface: center, half and energy, xyz and a zero each, and four
/// zeros that fill the line.
inline constexpr std::size_t kNodeConstants = 16;

/// Amplitudes in the forms that the loops read, each padded to a multiple of kBoundsLanes.
struct StateView {
  const float* amplitudes;  ///< z · scale
  const float* magnitudes;  ///< |z| · scale
  float norm;               ///< ‖z‖_w, rounded up
  std::size_t stride;       ///< of the rows of coefficients: modes, padded
};

/// Sums over the modes of one state: Σ|z_i| largest_i and Σ w_i z_i². Pads its outputs up to `stride`.
struct StateSums {
  double farthest, squared_norm;
};
StateSums prepare_state(const double* z, std::size_t modes, std::size_t stride, const double* largest,
                        const double* weights, const double* scale, float* amplitudes, float* magnitudes);

/// `count` boxes in a row: center + C z ± (half + min(d |z|, energy ‖z‖_w)).
/// @param coefficients half floats, 16-byte aligned
void make_boxes(const StateView& state, const float* constants, const std::uint16_t* coefficients, std::size_t count,
                std::uint32_t stamp, NodeBox* boxes);

/// u = Σ z_i u_i for one vertex. @param rows three, `stride` floats apart, zero from `modes` on
/// @param z padded with zeros to a multiple of kBoundsLanes; the same bits on every instruction set with FMA
void make_displacement(const float* rows, std::size_t stride, const double* z, std::size_t padded_modes, double* u);

/// Where frame B lies as seen from A, in single precision, for the separating axis test along the axes of both.
struct alignas(64) BoxFrames {
  float columns[3][4];  ///< of R_AB
  float rows[3][4];
  float p[4];  ///< of B in A, at the middle of its way
  /// By axis of A and of B: margin, half the way along it, and what single precision may be wrong by.
  float slack_a[4], slack_b[4];
};

/// Which of up to 64 boxes in a row may be within reach of one box: a bit each.
/// @param many_of_b whether the one box is in frame A and the others in B, or the other way round
std::uint64_t boxes_within(const BoxFrames& frames, const NodeBox& one, const NodeBox* many, std::size_t count,
                           bool many_of_b);

}  // namespace limber::internal
