/// @file bake_skin.h
/// The handles of a modal skin from a body's modes: where they are, what hangs on them, and how they move, by the
/// rotation-strain Poisson problem solved for the handles alone. docs/derivations/modal-skin.md has the equations.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "limber/model/embedding.h"
#include "limber/model/modal_skin.h"
#include "limber/precompute/bake.h"

namespace limber::internal {

/// A body as the skin is made of it. Rest positions are from the body's origin.
struct SkinBody {
  TetMesh mesh;                         ///< four-node tets: the body's own, or the eighths of its ten-node ones
  std::span<const Material> materials;  ///< one per region
  std::span<const Index> fixed;         ///< nodes
  FrameMotion motion = FrameMotion::kFree;
  Vec3 origin = Vec3::Zero();       ///< in the mesh's coordinates
  SparseMatrix node_mass;           ///< of the body's own tets
  Eigen::MatrixXd W;                ///< 3k × N: modes at the nodes, [axis][mode] down
  std::vector<double> eigenvalues;  ///< k
};

/// The columns of an analysis that a body keeps.
SkinBody skin_body(const ModalAnalysis& analysis, std::span<const Index> kept, const TetMesh& mesh,
                   std::span<const Material> materials, std::span<const Index> fixed, const ModalAnalysisOptions& made,
                   const Vec3& origin);

/// Handles and the influences of all nodes; those of surfaces are empty.
struct NodalSkin {
  ModalSkin skin;
  std::vector<SkinInfluences> nodes;
};

/// @param report gets handles, spread and energies. @pre the body is free or held at three points or more, k > 0
NodalSkin bake_skin(const SkinBody& body, const SkinOptions& options, SkinReport& report);

/// Places of all nodes under the map, from the body's origin. @param z k
std::vector<Vec3> skinned_nodes(const SkinBody& body, const NodalSkin& skin, std::span<const double> z);

/// Elastic energy of the nodes' places by St. Venant–Kirchhoff's law, J.
double shape_energy(const SkinBody& body, std::span<const Vec3> places);

/// Influences of an embedded surface: those of its tets' nodes, of ten-node tets the corners of their eighths, by its
/// weights there (none below 0), the four largest of them. @param mesh the body's own
std::vector<SkinInfluences> surface_influences(const NodalSkin& skin, const TetMesh& mesh, const Embedding& surface);

}  // namespace limber::internal
