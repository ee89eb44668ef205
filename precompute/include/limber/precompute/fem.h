/// @file limber/precompute/fem.h
/// Linear tetrahedra: element matrices and their assembly.
///
///   K_e = V Bᵀ D B,   f = K u          12 × 12, constant strain; D isotropic (E, ν)
///   M_e = ρV/20 (1 + δ_ab) I₃          consistent;   ρV/4 δ_ab I₃   lumped
///
/// Degrees of freedom are node-major: dof = 3·node + axis. Assembly runs over the node graph, each column owned by one
/// task and its tets added in ascending order: no locks, the same bits for any thread count, Kᵀ = K exactly.
#pragma once

#include <array>
#include <span>

#include "limber/core/jobs.h"
#include "limber/mesh/tet_mesh.h"
#include "limber/model/material.h"
#include "limber/precompute/sparse_matrix.h"

namespace limber {

enum class MassKind { kLumped, kConsistent };

/// Row-major 12 × 12 stiffness of one tet, N/m. @param x its four corners, right-handed
std::array<double, 144> tet_stiffness(const std::array<Vec3, 4>& x, const Material& material);

/// K, 3n × 3n, N/m. @param materials one per region of the mesh; of a region without tets it is not looked at
/// @throws InvalidArgument if the counts differ or a material is outside its range
SparseMatrix assemble_stiffness(const TetMesh& mesh, std::span<const Material> materials, Jobs& jobs = serial_jobs());

/// K u tet by tet, from differences of displacements, N. In exact arithmetic the same as the assembled product. In
/// floating point the forces on every tet balance, so a stiff part that moves rigidly feels no net force, whereas the
/// rounded entries of an assembled K resist its motion a little: enough to drown a part 1e10 times softer.
/// @param displacements, forces 3n each, node-major; forces is overwritten
void elastic_forces(const TetMesh& mesh, std::span<const Material> materials, std::span<const double> displacements,
                    std::span<double> forces);

/// M on the node graph, n × n, kg (the same for the three axes). Lumped: a diagonal.
SparseMatrix assemble_mass(const TetMesh& mesh, std::span<const Material> materials, MassKind kind,
                           Jobs& jobs = serial_jobs());

}  // namespace limber
