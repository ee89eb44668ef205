/// @file limber/dynamics/reconstruct.h
/// Deformed vertices from amplitudes, on demand, into the caller's arrays.
///
///   p_i = R (rest_i + Σ_m z_m shape_i,m) + t                        i: vertex
///
/// The product is one stream over the basis for a block of up to eight instances; the rigid transform is fused into the
/// store. Single precision throughout; pass poses relative to an origin near the viewer (a float near 10⁶ m has 6 cm
/// steps).
#pragma once

#include <span>

#include "limber/core/jobs.h"
#include "limber/core/rigid_transform.h"
#include "limber/model/modal_basis.h"

namespace limber {

/// One instance to reconstruct.
struct ReconstructionTarget {
  RigidTransform X_OB;  ///< body in the output frame O (world less an origin, or identity for body frame)
  const double* amplitudes = nullptr;  ///< k, z
  float* positions = nullptr;          ///< out: 3V, xyz per vertex; m
  float* normals = nullptr;  ///< out, optional: 3V unit normals of the deformed surface, area-weighted; null: none
};

/// @throws InvalidArgument if a required pointer is null.
void reconstruct(const ModalSurface& surface, std::span<const ReconstructionTarget> targets,
                 Jobs& jobs = serial_jobs());

/// Area-weighted unit vertex normals of triangles over 3V positions; (0, 0, 1) where a vertex has no area. Does not
/// allocate.
void vertex_normals(std::span<const Triangle> triangles, std::span<const float> positions, std::span<float> normals);

}  // namespace limber
