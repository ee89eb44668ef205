/// @file limber/model/modal_skin.h
/// A map from amplitudes to positions that bends far without swelling: a few handles whose turns are exponentials of
/// the amplitudes, and the modes less what the handles show of them. docs/large-bends.md tells what it is for.
///
///   R_h(z) = exp [Θ_h z]×                                                 turn of handle h, h = 1 … n
///   p_h(z) = r_h + Σ_l [(R_l − 1) a_lh + R_l D_lh z]                      its place
///   x_v(z) = Σ_h β_vh [p_h + R_h (r_v − r_h + Ũ_v z)]                     a vertex; four handles, β ≥ 0, Σ_h β_vh = 1
///   Ũ_v z  = U_v z − Σ_h β_vh [P_h z + (Θ_h z) × (r_v − r_h)],  P_h z = Σ_l [D_lh z + (Θ_l z) × a_lh]
///
/// The last line makes x(z) = r + U z + O(z²) for any handles and weights; x(0) = r to the bit, but for the round-off
/// of a free body's frame. A handle with Θ, a and D zero is the ground: what hangs on it alone does not move.
/// Derivation: docs/derivations/modal-skin.md.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "limber/core/types.h"

namespace limber {

/// Handles and weights of a vertex. Weights are multiples of 2⁻²⁰, so that their sum is 1 exactly, in floats too.
struct SkinInfluences {
  static constexpr std::size_t kMost = 4;
  static constexpr double kUnit = 0x1p-20;

  std::array<float, kMost> weight{1.0f, 0.0f, 0.0f, 0.0f};  ///< β ≥ 0, Σ = 1
  std::array<std::uint8_t, kMost> handle{};                 ///< where the weight is 0: any

  friend bool operator==(const SkinInfluences&, const SkinInfluences&) = default;
};

/// Influences from one weight per handle: the four largest less the fifth, so that they change continuously where the
/// weights do, over their sum. @param weights at least one above 0, one per handle; those below 0 count as 0
SkinInfluences skin_influences(std::span<const double> weights);

/// How a free body stays in its frame: its mass centre at the origin and Σ m r × x = 0 (Eckart), whatever the
/// amplitudes. With μ_v = ((M 1)_v, (M r)_v)/m, four numbers a node of the tetrahedral mesh:
///   Σ_v x_v μ_vᵀ = Σ_h [t_h b_hᵀ + R_h (S_h + Σ_i z_i Z_hi)],    t_h = p_h − R_h r_h
///   b_h = Σ_v β_vh μ_v,  S_h = Σ_v β_vh r_v μ_vᵀ,  Z_hi = Σ_v β_vh Ũ_vi μ_vᵀ
/// The first column of the sum is the mass centre, the others Σ m x rᵀ.
struct SkinGauge {
  std::vector<double> weights{};  ///< b, 4 per handle: 1, m, m, m
  std::vector<double> rest{};     ///< S, 12 per handle, column after column: m, m², m², m²
  std::vector<double> shapes{};   ///< Z, [handle][mode][12]: kg^−½, m·kg^−½
};

/// Plain data; ModalModel checks it. All arrays are indexed in the order named, the last index fastest.
struct ModalSkin {
  static constexpr Index kMaxHandles = 255;

  Index handles = 0;               ///< n
  Index modes = 0;                 ///< k
  std::vector<Vec3> rest{};        ///< r_h, body frame, m
  std::vector<float> rotations{};  ///< Θ, [handle][axis][mode], rad per kg^½·m
  std::vector<float> arms{};       ///< a_lh, [l][h][axis], m
  std::vector<float> shifts{};     ///< D_lh, [l][h][axis][mode], kg^−½

  std::vector<SkinInfluences> render{};     ///< one per vertex of the render surface
  std::vector<SkinInfluences> collision{};  ///< … of the collision surface; empty where the body has none of its own
  std::vector<SkinInfluences> volume{};     ///< … per node of the volume block; empty where the body has none
  SkinGauge gauge{};                        ///< of free bodies; else empty

  bool has_gauge() const { return !gauge.weights.empty(); }
  /// k numbers each.
  const float* rotation_row(Index h, int axis) const { return rotations.data() + row(h, axis); }
  const float* shift_row(Index l, Index h, int axis) const { return shifts.data() + row(l * handles + h, axis); }
  Vec3 arm(Index l, Index h) const {
    const float* a = arms.data() + std::size_t{3} * static_cast<std::size_t>(l * handles + h);
    return {a[0], a[1], a[2]};
  }

 private:
  std::size_t row(Index block, int axis) const {
    return (std::size_t{3} * static_cast<std::size_t>(block) + static_cast<std::size_t>(axis)) *
           static_cast<std::size_t>(modes);
  }
};

}  // namespace limber
