#include "skin/handle_weights.h"

#include <algorithm>
#include <cmath>

namespace limber::internal {
namespace {

constexpr double kPlaceWeight = 0.3;  // of places beside turns, each scaled to variance 1
constexpr int kRounds = 30;           // of k-means: later ones move few nodes
constexpr double kDiffusion = 0.08;   // c over the square of a cluster's size
constexpr double kNothing = 1e-12;    // of the volume: what a cluster that the ground swallowed still holds

Eigen::MatrixXd scaled(const Eigen::MatrixXd& X, const Eigen::VectorXd& weights) {
  const Eigen::RowVectorXd mean = (weights.transpose() * X) / weights.sum();
  const Eigen::MatrixXd centred = X.rowwise() - mean;
  const double variance = weights.dot(centred.rowwise().squaredNorm()) / weights.sum();
  return variance > 0.0 ? Eigen::MatrixXd(centred / std::sqrt(variance)) : centred;
}

Eigen::MatrixXd spread_starts(const Eigen::MatrixXd& X, Index count) {
  const auto distances = [&](Eigen::Index from) -> Eigen::VectorXd {
    return (X.rowwise() - X.row(from)).rowwise().squaredNorm();
  };
  Eigen::MatrixXd centres(count, X.cols());
  Eigen::Index next = 0;
  X.rowwise().squaredNorm().maxCoeff(&next);
  Eigen::VectorXd nearest = distances(next);
  for (Index c = 0; c < count; ++c) {
    centres.row(c) = X.row(next);
    nearest = nearest.cwiseMin(distances(next));
    nearest.maxCoeff(&next);
  }
  return centres;
}

std::vector<Index> nearest_centres(const Eigen::MatrixXd& X, const Eigen::MatrixXd& centres) {
  Eigen::MatrixXd score = -2.0 * X * centres.transpose();
  score.rowwise() += Eigen::RowVectorXd(centres.rowwise().squaredNorm().transpose());
  std::vector<Index> cluster(static_cast<std::size_t>(X.rows()));
  for (Eigen::Index i = 0; i < X.rows(); ++i) {
    Eigen::Index best = 0;
    score.row(i).minCoeff(&best);
    cluster[static_cast<std::size_t>(i)] = static_cast<Index>(best);
  }
  return cluster;
}

/// The median over clusters of the mean square of the largest offset along an axis.
double squared_size(std::span<const Index> cluster, Index clusters, const Eigen::MatrixXd& places,
                    const Eigen::VectorXd& volume) {
  Eigen::MatrixXd centre = Eigen::MatrixXd::Zero(clusters, 3);
  Eigen::VectorXd weight = Eigen::VectorXd::Zero(clusters), square = Eigen::VectorXd::Zero(clusters);
  for (std::size_t v = 0; v < cluster.size(); ++v) {
    const auto i = static_cast<Eigen::Index>(v);
    centre.row(cluster[v]) += volume[i] * places.row(i);
    weight[cluster[v]] += volume[i];
  }
  for (std::size_t v = 0; v < cluster.size(); ++v) {
    const auto i = static_cast<Eigen::Index>(v);
    const Index c = cluster[v];
    square[c] += volume[i] * (places.row(i) - centre.row(c) / weight[c]).cwiseAbs2().maxCoeff() / weight[c];
  }
  std::vector<double> sizes;
  for (Index c = 0; c < clusters; ++c)
    if (square[c] > 0.0) sizes.push_back(square[c]);
  if (sizes.empty()) return 0.0;
  std::nth_element(sizes.begin(), sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2), sizes.end());
  return sizes[sizes.size() / 2];
}

/// Drops handles of no volume and renumbers the others; the ground, the last, stays.
void drop_idle_handles(const TetFields& fields, HandleWeights& weights) {
  std::vector<double> held(static_cast<std::size_t>(weights.handles), 0.0);
  for (std::size_t v = 0; v < weights.nodes.size(); ++v)
    for (std::size_t i = 0; i < SkinInfluences::kMost; ++i)
      held[weights.nodes[v].handle[i]] +=
          static_cast<double>(weights.nodes[v].weight[i]) * fields.node_volume[static_cast<Eigen::Index>(v)];
  std::vector<std::uint8_t> place(held.size(), 0);
  Index count = 0;
  for (std::size_t h = 0; h < held.size(); ++h) {
    const bool is_ground = weights.ground && h + 1 == held.size();
    if (is_ground || held[h] > kNothing * fields.node_volume.sum()) place[h] = static_cast<std::uint8_t>(count++);
  }
  for (SkinInfluences& at : weights.nodes)
    for (std::size_t i = 0; i < SkinInfluences::kMost; ++i)
      at.handle[i] = at.weight[i] > 0.0f ? place[at.handle[i]] : std::uint8_t{0};
  weights.handles = count;
}

}  // namespace

Eigen::MatrixXd cluster_features(const Eigen::MatrixXd& turns, std::span<const double> eigenvalues,
                                 const Eigen::MatrixXd& places, const Eigen::VectorXd& node_volume) {
  double least = 0.0;
  for (const double lambda : eigenvalues)
    if (lambda > 0.0 && (least == 0.0 || lambda < least)) least = lambda;
  const auto k = static_cast<Eigen::Index>(eigenvalues.size());
  Eigen::MatrixXd by_energy = turns;  // columns [axis][mode]
  for (Eigen::Index i = 0; i < turns.cols(); ++i) {
    const double lambda = std::max(eigenvalues[static_cast<std::size_t>(i % k)], least);
    if (lambda > 0.0) by_energy.col(i) /= std::sqrt(lambda);
  }
  Eigen::MatrixXd features(turns.rows(), turns.cols() + 3);
  features << scaled(by_energy, node_volume), kPlaceWeight * scaled(places, node_volume);
  return features;
}

std::vector<Index> cluster_nodes(const Eigen::MatrixXd& features, const Eigen::VectorXd& weights, Index count) {
  Eigen::MatrixXd centres = spread_starts(features, count);
  std::vector<Index> cluster = nearest_centres(features, centres);
  for (int round = 1; round < kRounds; ++round) {
    Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(count, features.cols());
    Eigen::VectorXd weight = Eigen::VectorXd::Zero(count);
    for (Eigen::Index v = 0; v < features.rows(); ++v) {
      const Index c = cluster[static_cast<std::size_t>(v)];
      sum.row(c) += weights[v] * features.row(v);
      weight[c] += weights[v];
    }
    for (Index c = 0; c < count; ++c)
      if (weight[c] > 0.0) centres.row(c) = sum.row(c) / weight[c];
    std::vector<Index> next = nearest_centres(features, centres);
    if (next == cluster) break;
    cluster = std::move(next);
  }
  return cluster;
}

HandleWeights diffuse_clusters(const TetFields& fields, const Eigen::SparseMatrix<double>& L,
                               std::span<const Index> cluster, Index clusters, const Eigen::MatrixXd& places,
                               std::span<const Index> fixed) {
  HandleWeights out{.handles = clusters + (fixed.empty() ? 0 : 1), .ground = !fixed.empty(), .nodes = {}};
  Eigen::MatrixXd chi = Eigen::MatrixXd::Zero(L.rows(), out.handles);
  for (std::size_t v = 0; v < cluster.size(); ++v) chi(static_cast<Eigen::Index>(v), cluster[v]) = 1.0;
  for (const Index v : fixed) {
    chi.row(v).setZero();
    chi(v, out.handles - 1) = 1.0;
  }
  const double c = kDiffusion * squared_size(cluster, clusters, places, fields.node_volume);
  Eigen::SparseMatrix<double> A = c * L;
  A.diagonal() += fields.node_volume;
  const Eigen::MatrixXd beta = HeldSolver(A, fixed).solve(fields.node_volume.asDiagonal() * chi, chi);
  std::vector<double> row(static_cast<std::size_t>(out.handles));
  for (Eigen::Index v = 0; v < beta.rows(); ++v) {
    for (Index h = 0; h < out.handles; ++h) row[static_cast<std::size_t>(h)] = beta(v, h);
    out.nodes.push_back(skin_influences(row));
  }
  drop_idle_handles(fields, out);
  return out;
}

}  // namespace limber::internal
