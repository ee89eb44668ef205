/// @file modal_blocks.h
/// Columns of a modal analysis as an asset keeps them: at the vertices of surfaces, at all nodes, and as integrals.
#pragma once

#include <span>
#include <vector>

#include "bake/body_surfaces.h"
#include "limber/model/modal_model.h"
#include "limber/precompute/modal_analysis.h"

namespace limber::internal {

std::vector<NodeShares> shares_of(const Embedding& embedding, const TetMesh& mesh);

/// Of one column of the shapes, m kg^−½.
double largest_displacement(const ModalAnalysis& a, Index mode, std::span<const NodeShares> vertices);

/// @param kept columns of the analysis. @param origin of the body's frame, input coordinates
ModalSurface modal_surface(const PlacedSurface& placed, const ModalAnalysis& a, const TetMesh& mesh,
                           std::span<const Index> kept, const Vec3& origin);
ModalVolume modal_volume(const ModalAnalysis& a, const TetMesh& mesh, std::span<const Index> kept, const Vec3& origin);

/// Participation and moments of the columns kept about the frame's origin, which `data` has.
void add_inertial_integrals(ModalModelData& data, const ModalAnalysis& a, const TetMesh& mesh,
                            std::span<const Index> kept);

}  // namespace limber::internal
