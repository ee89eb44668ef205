/// @file limber/precompute/fem.h
/// Tetrahedra of four nodes (linear) and of ten (quadratic, straight sides): element matrices and their assembly. The
/// mesh tells which: ten where it has mid-edge nodes.
///
///   K_e = ∫ Bᵀ D B dV,   f = K u       D isotropic (E, ν)
///     linear      12 × 12, B constant: V Bᵀ D B
///     quadratic   30 × 30, B linear: the four-point rule, which is exact ([ZT] table 5.3)
///   M_e = ρ ∫ N_a N_b dV I₃            consistent, closed form; of the whole, m = ρV:
///     linear      m/20 (1 + δ_ab)
///     quadratic   m/420 × 6 and 1 between corners, 32, 16 (edges that meet) and 8 (that do not) between edges, −4 and
///                 −6 between a corner and an edge that ends there, or not
///   lumped: the diagonal of that scaled to the whole mass (Hinton, Rock, Zienkiewicz 1976), m/4 at each of four
///   corners; m/36 at corners and 4m/27 at edges of ten-node tets, whose row sums would be negative at corners
///
/// [ZT] Zienkiewicz, Taylor, Zhu: The Finite Element Method, 6th edition, 2005.
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

/// Row-major 30 × 30 stiffness of one ten-node tet with straight sides, N/m. @param x its corners, right-handed
std::array<double, 900> ten_node_stiffness(const std::array<Vec3, 4>& x, const Material& material);

/// M on the node graph, n × n, kg (the same for the three axes). Lumped: a diagonal.
SparseMatrix assemble_mass(const TetMesh& mesh, std::span<const Material> materials, MassKind kind,
                           Jobs& jobs = serial_jobs());

}  // namespace limber
