/// @file frequency_error.h
/// How far the frequencies of a mesh are above those of the continuum in the same polyhedron: Zienkiewicz and Zhu's
/// estimate by recovered stresses.
///
/// For a mode w_h with w_hᵀM w_h = 1, M consistent, Rayleigh's quotient gives
///
///   λ_h − λ = ‖σ − σ_h‖² − λ ‖w − w_h‖²_M,     ‖σ‖² = ∫ σ : D⁻¹ : σ dV
///
/// whose second term is of higher order. The recovered stress σ* (fem/stress_recovery.h) stands for σ, and ‖σ*‖² for λ.
/// The lumped mass adds its own error to first order: λ_lumped/λ_consistent = w_hᵀM w_h with w_hᵀM_lumped w_h = 1.
#pragma once

#include <span>
#include <vector>

#include "limber/core/jobs.h"
#include "limber/mesh/tet_mesh.h"
#include "limber/model/material.h"
#include "limber/precompute/fem.h"

namespace limber::internal {

/// f_h/f − 1, estimated, per mode; 0 for mechanisms. By the lumped mass it may be below zero.
/// @param eigenvalues λ_h, rad²/s². @param shapes 3n per mode, wᵀMw = 1 with the mass that `mass` names
std::vector<double> frequency_errors(const TetMesh& mesh, std::span<const Material> materials,
                                     std::span<const Index> fixed_nodes, MassKind mass,
                                     std::span<const double> eigenvalues, std::span<const double> shapes,
                                     Jobs& jobs = serial_jobs());

}  // namespace limber::internal
