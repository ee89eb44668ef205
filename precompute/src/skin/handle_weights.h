/// @file handle_weights.h
/// Places and influences of the handles of a modal skin: clusters of nodes that turn alike, diffused along the
/// mesh.
#pragma once

#include "limber/model/modal_skin.h"
#include "skin/tet_fields.h"

namespace limber::internal {

/// One node per row; what k-means tells apart: turns per mode over √λ and, less strongly, places.
/// @param turns N × 3k, mean of Θ over the tets of a node. @param eigenvalues k; where 0 the least above it is taken
Eigen::MatrixXd cluster_features(const Eigen::MatrixXd& turns, std::span<const double> eigenvalues,
                                 const Eigen::MatrixXd& places, const Eigen::VectorXd& node_volume);

/// The cluster of each node, 0 … count − 1, by k-means from starts that lie farthest apart; a cluster may be empty.
std::vector<Index> cluster_nodes(const Eigen::MatrixXd& features, const Eigen::VectorXd& weights, Index count);

/// Influences per node from the clusters' indicators χ by one implicit step of diffusion, (M_V + c L) β = M_V χ, c by
/// the clusters' size. Fixed nodes hang on the ground alone, the last handle where there are any. Clusters that nothing
/// hangs on are left out.
struct HandleWeights {
  Index handles = 0;
  bool ground = false;
  std::vector<SkinInfluences> nodes;
};
HandleWeights diffuse_clusters(const TetFields& fields, const Eigen::SparseMatrix<double>& L,
                               std::span<const Index> cluster, Index clusters, const Eigen::MatrixXd& places,
                               std::span<const Index> fixed);

}  // namespace limber::internal
