/// @file limber/dynamics/reconstruct.h
/// Deformed vertices from amplitudes, on demand, into the caller's arrays.
///
///   p_i = R (rest_i + Σ_m z_m shape_i,m + d_i) + t                  i: vertex; d: what the modes do not show, if any
///   p_i = R x_i(z) + t                                                with a modal skin: see skin_pose.h, d_i is turned
///
/// The product is one stream over the basis for a block of up to eight instances; the rigid transform is fused into the
/// store. Single precision throughout; pass poses relative to an origin near the viewer (a float near 10⁶ m has 6 cm
/// steps).
#pragma once

#include <span>

#include "limber/core/jobs.h"
#include "limber/core/rigid_transform.h"
#include "limber/dynamics/skin_tiles.h"
#include "limber/model/modal_basis.h"
#include "limber/model/modal_model.h"
#include "limber/model/skin_pose.h"

namespace limber {

/// One instance to reconstruct.
struct ReconstructionTarget {
  RigidTransform X_OB{};  ///< body in the output frame O (world less an origin, or identity for body frame)
  const double* amplitudes = nullptr;  ///< k, z, kg^½·m; may be null where k = 0
  float* positions = nullptr;          ///< out: 3V, xyz per vertex; m
  float* normals = nullptr;  ///< out, optional: 3V unit normals of the deformed surface, area-weighted; null: none
  const float* displacement = nullptr;  ///< d, 3V, xyz per vertex, body frame, m; null: none
  Index modes = -1;  ///< the first so many are summed, ≤ k; negative: all. For bodies far away (drawn_modes())
  const SkinPose* skin = nullptr;  ///< its handles at these amplitudes; null: drawn by its modes alone
};

/// How many of the first modes are to be drawn so that no vertex is off by more than a tolerance: the fewest for which
/// Σ |z_i| max|shape_i| over the others is at most that. The sets are nested, so that a body that is drawn by more or
/// fewer modes from one frame to the next jumps by no more than the larger of the two tolerances.
/// @param extent of the render surface, as long as z. @param tolerance m, ≥ 0; 0: all whose amplitude is not zero
Index drawn_modes(const SurfaceExtent& extent, std::span<const double> z, double tolerance);

/// Writes the vertices (and normals) of every target; arrays of different targets must not overlap. Does not allocate
/// but in what `jobs` does. The result has the same bits however targets are grouped and whatever `jobs` does.
///
/// Error against real arithmetic, with u = 2⁻²⁴: (k + 4) u Σ|z_m||shape_m| of the sum, and 8u (|rest| +
/// Σ|z_m||shape_m| + |d|) + 2u|t| of the rigid motion. The displacement is summed by itself and the rest position added
/// last.
/// @throws InvalidArgument if a required pointer is null, basis and rest shape differ in their vertices, the basis has
/// more than 8192 modes, a target has a skin, or normals are asked for and a triangle names a vertex that is not there.
void reconstruct(const ModalSurface& surface, std::span<const ReconstructionTarget> targets,
                 Jobs& jobs = serial_jobs());

/// No handle turns by more, rad: the body is drawn by its modes alone, at their price. A vertex is then off by no more
/// than the angle's square times the body's size, 2.5e-5 of it, a part of a pixel, by which it jumps when it bends on.
inline constexpr double kDrawnStraight = 0.005;

/// The same for targets of which some or all have a skin; the others, and those straighter than kDrawnStraight, get the
/// bits that they get without. The error of a vertex with a skin is at most 64u of the size of every term: rest,
/// Σ|z_m||shape_m|, d, t_h, e_h, |Θ_h z||rest|.
/// @param influences of the surface. @throws InvalidArgument also if they are not one per vertex, or name a handle that
/// a skin has not
void reconstruct(const ModalSurface& surface, const SkinTiles& influences,
                 std::span<const ReconstructionTarget> targets, Jobs& jobs = serial_jobs());

/// Area-weighted unit vertex normals of triangles over 3V positions; (0, 0, 1) where the triangles of a vertex have no
/// area (in all, under 1e-19 m²). Does not allocate. @throws InvalidArgument if the arrays differ in size or a triangle
/// names a vertex that is not there.
void vertex_normals(std::span<const Triangle> triangles, std::span<const float> positions, std::span<float> normals);

}  // namespace limber
