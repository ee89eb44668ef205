/// @file residual.h
/// The static compliance that the kept modes leave out: as further modes at chosen nodes, or as blocks between the
/// vertices of a surface (limber/model/residual_compliance.h).
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "limber/model/embedding.h"
#include "limber/model/residual_compliance.h"
#include "limber/precompute/bake.h"
#include "limber/precompute/modal_analysis.h"

namespace limber::internal {

/// Unit forces at some nodes, one axis at a time: 3n × 3 nodes.
Eigen::MatrixXd node_loads(Index mesh_nodes, std::span<const Index> nodes);

/// Loads of a patch as a whole: three forces, shared by area, and the moments that work with the rotation
/// which fits the vertices' displacements best (limber/constraints/material_frame.h), over the patch's radius of
/// gyration: forces too. None about directions in which it has no extent.
/// @param touching in mesh coordinates. @param surface where its vertices lie in the tets
Eigen::MatrixXd patch_loads(const TetMesh& mesh, const SurfaceMesh& touching, const Embedding& surface,
                            const AttachmentPatch& patch);

/// Modes that joined the analysis, and the kept modes' part of fᵀ K⁺ f without them, with the rest, for each load.
struct ResidualModes {
  Index appended = 0;
  Eigen::VectorXd shown, left;  // m/N, of unit loads
};

/// Appends to the analysis the modes in the span of G_res F, so that kept and new modes together answer static loads
/// in the span of F exactly. Rayleigh–Ritz in that span: they are M-orthonormal to each other
/// and to the kept ones, with the eigenvalues that the span allows, ascending (above those of the modes that the span
/// is made of). Directions whose compliance is below round-off of the largest are left out.
/// @param kept columns of the analysis that the body keeps. @pre analysis.compliance
/// New modes are behind all other columns.
ResidualModes append_residual_modes(ModalAnalysis& analysis, std::span<const Index> kept, const Eigen::MatrixXd& F);

/// G_res of a surface. @pre analysis.compliance
ResidualCompliance residual_compliance(const ModalAnalysis& analysis, std::span<const Index> kept, const TetMesh& mesh,
                                       const Embedding& surface, ResidualCompliance::Form form);

}  // namespace limber::internal
