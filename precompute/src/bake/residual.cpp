#include "bake/residual.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <functional>

#include "limber/core/cross_matrix.h"
#include "limber/mesh/patch_samples.h"

namespace limber::internal {
namespace {

// Loads solved together: enough to make the triangular solves matrix products, few enough to stay in cache.
constexpr Index kVerticesPerSolve = 16;
// A compliance below this part of the largest is round-off of the solves.
constexpr double kRoundOff = 1e-10;

using Columns = Eigen::Map<const Eigen::MatrixXd>;

Columns columns(const std::vector<double>& all, Index nodes) {
  const auto rows = 3 * static_cast<Eigen::Index>(nodes);
  return {all.data(), rows, static_cast<Eigen::Index>(all.size()) / rows};
}

std::span<const double> numbers(const Eigen::MatrixXd& X) { return {X.data(), static_cast<std::size_t>(X.size())}; }

Columns like(const std::vector<double>& numbers, const Eigen::MatrixXd& X) {
  return {numbers.data(), X.rows(), X.cols()};
}

Eigen::MatrixXd displacements(ElasticCompliance& compliance, const Eigen::MatrixXd& forces) {
  return like(compliance.displacements(numbers(forces)), forces);
}

Eigen::MatrixXd mass_times(const ElasticCompliance& compliance, const Eigen::MatrixXd& X) {
  return like(compliance.mass_times(numbers(X)), X);
}

/// The kept modes that answer statically: those with λ > 0. A mechanism gives way to any load.
struct StaticModes {
  Eigen::MatrixXd W, MW;  // 3n × k
  Eigen::VectorXd inverse_eigenvalues;

  StaticModes(const ModalAnalysis& a, std::span<const Index> kept) {
    std::vector<Index> elastic;
    std::copy_if(kept.begin(), kept.end(), std::back_inserter(elastic),
                 [&](Index m) { return a.eigenvalues[m] > 0.0; });
    W = columns(a.shapes, a.nodes)(Eigen::all, elastic);
    MW = columns(a.mass_times_shapes, a.nodes)(Eigen::all, elastic);
    inverse_eigenvalues.resize(static_cast<Eigen::Index>(elastic.size()));
    for (std::size_t i = 0; i < elastic.size(); ++i)
      inverse_eigenvalues[static_cast<Eigen::Index>(i)] = 1.0 / a.eigenvalues[elastic[i]];
  }
};

/// G_res F.
Eigen::MatrixXd residual_displacements(ElasticCompliance& compliance, const StaticModes& modes,
                                       const Eigen::MatrixXd& F) {
  Eigen::MatrixXd U = displacements(compliance, F);
  U -= modes.W * (modes.inverse_eigenvalues.asDiagonal() * (modes.W.transpose() * F));
  return U;
}

/// Ritz modes in the span of Y, which is K-orthonormal: their eigenvalues ascend.
struct Ritz {
  Eigen::MatrixXd W, MW;
  Eigen::VectorXd eigenvalues;
};

Ritz ritz_modes(const ElasticCompliance& compliance, const Eigen::MatrixXd& Y) {
  const Eigen::MatrixXd MY = mass_times(compliance, Y);
  const Eigen::MatrixXd gram = Y.transpose() * MY;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(0.5 * (gram + gram.transpose()));
  const Eigen::VectorXd inverse_root = eigen.eigenvalues().reverse().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd turn = eigen.eigenvectors().rowwise().reverse() * inverse_root.asDiagonal();
  return {Y * turn, MY * turn, inverse_root.cwiseAbs2()};
}

/// Vertices [first, last) of a surface, loaded one axis at a time: Sᵀ.
Eigen::MatrixXd unit_loads(const TetMesh& mesh, const Embedding& surface, Index first, Index last) {
  Eigen::MatrixXd F = Eigen::MatrixXd::Zero(3 * static_cast<Eigen::Index>(mesh.nodes.size()), 3 * (last - first));
  for (Index v = first; v < last; ++v) {
    const NodeShares at = node_shares(mesh, surface.vertices[v]);
    for (std::size_t c = 0; c < at.count; ++c)
      F.block<3, 3>(3 * at.node[c], 3 * (v - first)) += at.share[c] * Mat3::Identity();
  }
  return F;
}

/// S U at one vertex.
Mat3 at_vertex(const NodeShares& at, const Eigen::MatrixXd& U, Eigen::Index column) {
  Mat3 block = Mat3::Zero();
  for (std::size_t c = 0; c < at.count; ++c) block += at.share[c] * U.block<3, 3>(3 * at.node[c], column);
  return block;
}

/// A vertex by itself yields to a force, never against it: what round-off leaves below zero is taken away.
Mat3 yielding(const Mat3& block) {
  const Eigen::SelfAdjointEigenSolver<Mat3> eigen(0.5 * (block + block.transpose()));
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).asDiagonal() * eigen.eigenvectors().transpose();
}

/// What a patch is a mean over; the nearest vertex where none is within.
std::vector<PatchSample> samples_of(const SurfaceMesh& surface, const AttachmentPatch& patch) {
  std::vector<bool> inside(surface.vertices.size(), false);
  std::size_t nearest = 0;
  const auto distance = [&](std::size_t v) { return (surface.vertices[v] - patch.center).norm(); };
  for (std::size_t v = 0; v < inside.size(); ++v) {
    inside[v] = distance(v) <= patch.radius;
    if (distance(v) < distance(nearest)) nearest = v;
  }
  if (std::ranges::none_of(inside, std::identity())) inside[nearest] = true;
  return patch_samples(surface.triangles, inside, [&](std::size_t v) { return surface.vertices[v]; });
}

void append(const Eigen::MatrixXd& columns, std::vector<double>& all) {
  all.insert(all.end(), columns.data(), columns.data() + columns.size());
}

}  // namespace

Eigen::MatrixXd node_loads(Index mesh_nodes, std::span<const Index> nodes) {
  Eigen::MatrixXd F =
      Eigen::MatrixXd::Zero(3 * static_cast<Eigen::Index>(mesh_nodes), 3 * static_cast<Eigen::Index>(nodes.size()));
  for (std::size_t i = 0; i < nodes.size(); ++i)
    F.block<3, 3>(3 * nodes[i], 3 * static_cast<Eigen::Index>(i)).setIdentity();
  return F;
}

Eigen::MatrixXd patch_loads(const TetMesh& mesh, const SurfaceMesh& touching, const Embedding& surface,
                            const AttachmentPatch& patch) {
  const std::vector<PatchSample> samples = samples_of(touching, patch);
  const auto vertex = [&](const PatchSample& sample, std::size_t corner) {
    return static_cast<std::size_t>(touching.triangles[static_cast<std::size_t>(sample.triangle)][corner]);
  };
  const auto place = [&](const PatchSample& sample) {
    Vec3 p = Vec3::Zero();
    for (std::size_t c = 0; c < 3; ++c) p += sample.at[c] * touching.vertices[vertex(sample, c)];
    return p;
  };
  Vec3 mean = Vec3::Zero();
  for (const PatchSample& sample : samples) mean += sample.weight * place(sample);
  Mat3 inertia = Mat3::Zero();
  for (const PatchSample& sample : samples) {
    const Vec3 x = place(sample) - mean;
    inertia += sample.weight * (x.squaredNorm() * Mat3::Identity() - x * x.transpose());
  }
  const Eigen::SelfAdjointEigenSolver<Mat3> eigen(inertia);
  const double largest = eigen.eigenvalues().maxCoeff();
  Vec3 inverse = Vec3::Zero();
  for (int i = 0; i < 3; ++i)
    if (eigen.eigenvalues()[i] > kRoundOff * largest) inverse[i] = 1.0 / eigen.eigenvalues()[i];
  const Mat3 turns = std::sqrt(largest) * eigen.eigenvectors() * inverse.asDiagonal();  // about the principal axes
  Eigen::MatrixXd F = Eigen::MatrixXd::Zero(3 * static_cast<Eigen::Index>(mesh.nodes.size()), 6);
  for (const PatchSample& sample : samples) {
    // The mean displacement's and rotation's part of this point's displacement, transposed.
    Eigen::Matrix<double, 3, 6> load;
    load << Mat3::Identity(), cross_matrix(place(sample) - mean).transpose() * turns;
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const NodeShares at = node_shares(mesh, surface.vertices[vertex(sample, corner)]);
      for (std::size_t c = 0; c < at.count; ++c)
        F.middleRows<3>(3 * at.node[c]) += sample.weight * sample.at[corner] * at.share[c] * load;
    }
  }
  return F;
}

ResidualModes append_residual_modes(ModalAnalysis& analysis, std::span<const Index> kept, const Eigen::MatrixXd& F) {
  const StaticModes modes(analysis, kept);
  Eigen::MatrixXd U = residual_displacements(*analysis.compliance, modes, F);
  // K U = F less what the zero and the kept modes carry, so UᵀKU = FᵀU.
  const Eigen::MatrixXd energy = F.transpose() * U;
  const Eigen::MatrixXd answers = modes.inverse_eigenvalues.cwiseSqrt().asDiagonal() * (modes.W.transpose() * F);
  ResidualModes out{.shown = answers.colwise().squaredNorm(), .left = energy.diagonal().cwiseMax(0.0)};
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(0.5 * (energy + energy.transpose()));
  const double largest = eigen.eigenvalues().size() == 0 ? 0.0 : eigen.eigenvalues().maxCoeff();
  const auto above = static_cast<Eigen::Index>((eigen.eigenvalues().array() > kRoundOff * largest).count());
  if (above == 0) return out;
  Eigen::MatrixXd Y = U * (eigen.eigenvectors().rightCols(above) *
                           eigen.eigenvalues().tail(above).cwiseSqrt().cwiseInverse().asDiagonal());
  Y -= modes.W * (modes.MW.transpose() * Y);  // what round-off left of the kept modes
  const Ritz ritz = ritz_modes(*analysis.compliance, Y);
  analysis.eigenvalues.insert(analysis.eigenvalues.end(), ritz.eigenvalues.data(), ritz.eigenvalues.data() + above);
  append(ritz.W, analysis.shapes);
  append(ritz.MW, analysis.mass_times_shapes);
  out.appended = static_cast<Index>(above);
  return out;
}

ResidualCompliance residual_compliance(const ModalAnalysis& analysis, std::span<const Index> kept, const TetMesh& mesh,
                                       const Embedding& surface, ResidualCompliance::Form form) {
  const auto vertices = static_cast<Index>(surface.vertices.size());
  const StaticModes modes(analysis, kept);
  ResidualCompliance residual(form, vertices);
  std::vector<NodeShares> shares;
  for (const EmbeddedVertex& vertex : surface.vertices) shares.push_back(node_shares(mesh, vertex));
  for (Index first = 0; first < vertices; first += kVerticesPerSolve) {
    const Index last = std::min(first + kVerticesPerSolve, vertices);
    const Eigen::MatrixXd U =
        residual_displacements(*analysis.compliance, modes, unit_loads(mesh, surface, first, last));
    for (Index b = first; b < last; ++b) {
      const Eigen::Index column = 3 * (b - first);
      residual.set(b, b, yielding(at_vertex(shares[b], U, column)));
      if (form == ResidualCompliance::Form::kLocal) continue;
      for (Index a = b + 1; a < vertices; ++a) residual.set(a, b, at_vertex(shares[a], U, column));
    }
  }
  return residual;
}

}  // namespace limber::internal
