/// @file residual.h
/// What the kept modes leave out of the static compliance: as further modes at chosen nodes, or as blocks between the
/// vertices of a surface (limber/model/residual_compliance.h).
#pragma once

#include <span>
#include <vector>

#include "limber/model/embedding.h"
#include "limber/model/residual_compliance.h"
#include "limber/precompute/modal_analysis.h"

namespace limber::internal {

/// Appends to the analysis the modes in the span of G_res e_j, e_j the unit forces at some nodes, so that kept and new
/// modes together answer static loads there exactly. Rayleigh–Ritz in that span: they are M-orthonormal to each other
/// and to the kept ones, with the eigenvalues that the span allows, ascending (above those of the modes that the span
/// is made of). Directions whose compliance is below round-off of the largest are left out.
/// @param kept columns of the analysis that the body keeps. @pre analysis.compliance
/// @return how many were appended, behind all other columns
Index append_residual_modes(ModalAnalysis& analysis, std::span<const Index> kept, std::span<const Index> nodes);

/// G_res of a surface. @pre analysis.compliance
ResidualCompliance residual_compliance(const ModalAnalysis& analysis, std::span<const Index> kept, const TetMesh& mesh,
                                       const Embedding& surface, ResidualCompliance::Form form);

}  // namespace limber::internal
