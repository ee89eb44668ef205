#include "fem/frequency_error.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "fem/element_rules.h"
#include "fem/stress_recovery.h"

namespace limber::internal {
namespace {

constexpr std::size_t kModesAtOnce = 16;  // bounds the memory, which is 6 numbers a mode, sample and node

using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic>;

Square mass_shares(std::size_t nodes) {
  Square share(nodes, nodes);
  for (std::size_t a = 0; a < nodes; ++a)
    for (std::size_t b = 0; b < nodes; ++b) share(a, b) = mass_share(a, b, nodes);
  return share;
}

/// Shapes of a few modes and what is summed up of them.
class Modes {
 public:
  Modes(const TetMesh& mesh, std::span<const Material> materials, std::span<const double> shapes)
      : mesh_(mesh), materials_(materials), shapes_(shapes), count_(shapes.size() / (3 * mesh.nodes.size())) {}

  std::size_t count() const { return count_; }

  /// Stresses at the samples of all tets.
  StressRows stresses(const std::vector<Barycentric>& points) const {
    StressRows all(static_cast<Eigen::Index>(points.size() * mesh_.tets.size()), static_cast<Eigen::Index>(6 * count_));
    for (std::size_t t = 0; t < mesh_.tets.size(); ++t) {
      const TetNodes nodes(mesh_, t);
      const auto slopes = barycentric_gradients(t);
      for (std::size_t q = 0; q < points.size(); ++q) {
        const std::vector<Vec3> g = shape_gradients(slopes, points[q]);
        for (std::size_t m = 0; m < count_; ++m) {
          Mat3 gradient = Mat3::Zero();
          for (std::size_t a = 1; a < nodes.size(); ++a)
            gradient += (u(m, nodes[a]) - u(m, nodes[0])) * g[a].transpose();
          put(gradient, materials_[mesh_.tet_region[t]], all.row(static_cast<Eigen::Index>(points.size() * t + q)), m);
        }
      }
    }
    return all;
  }

  /// wᵀ M w with the consistent mass.
  std::vector<double> masses(const Square& share) const {
    std::vector<double> sums(count_, 0.0);
    for (std::size_t t = 0; t < mesh_.tets.size(); ++t) {
      const TetNodes nodes(mesh_, t);
      const double mass = materials_[mesh_.tet_region[t]].density * signed_volume(mesh_, static_cast<Index>(t));
      for (std::size_t m = 0; m < count_; ++m)
        for (std::size_t a = 0; a < nodes.size(); ++a)
          for (std::size_t b = 0; b < nodes.size(); ++b)
            sums[m] += mass * share(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b)) *
                       u(m, nodes[a]).dot(u(m, nodes[b]));
    }
    return sums;
  }

 private:
  Eigen::Map<const Vec3> u(std::size_t mode, Index node) const {
    return Eigen::Map<const Vec3>(shapes_.data() + 3 * (mode * mesh_.nodes.size() + static_cast<std::size_t>(node)));
  }

  std::array<Vec3, 4> barycentric_gradients(std::size_t tet) const {
    Mat3 edges;
    for (int a = 0; a < 3; ++a) edges.col(a) = mesh_.nodes[mesh_.tets[tet][a + 1]] - mesh_.nodes[mesh_.tets[tet][0]];
    const Mat3 inverse = edges.inverse();
    std::array<Vec3, 4> g;
    for (int a = 0; a < 3; ++a) g[a + 1] = inverse.row(a).transpose();
    g[0] = -(g[1] + g[2] + g[3]);
    return g;
  }

  std::vector<Vec3> shape_gradients(const std::array<Vec3, 4>& barycentric, const Barycentric& L) const {
    if (!mesh_.has_mid_edge_nodes()) return {barycentric.begin(), barycentric.end()};
    const auto slopes = quadratic_shape_slopes(L);
    std::vector<Vec3> g(slopes.size(), Vec3::Zero());
    for (std::size_t a = 0; a < g.size(); ++a)
      for (std::size_t c = 0; c < 4; ++c) g[a] += slopes[a][c] * barycentric[c];
    return g;
  }

  void put(const Mat3& gradient, const Material& material, auto row, std::size_t mode) const {
    const double pressure = material.lame_lambda() * gradient.trace(), mu = material.shear_modulus();
    const Mat3 stress = pressure * Mat3::Identity() + mu * (gradient + gradient.transpose());
    const std::array<double, 6> six{stress(0, 0), stress(1, 1), stress(2, 2), stress(1, 2), stress(2, 0), stress(0, 1)};
    for (std::size_t c = 0; c < 6; ++c) row[static_cast<Eigen::Index>(c * count_ + mode)] = six[c];
  }

  const TetMesh& mesh_;
  std::span<const Material> materials_;
  std::span<const double> shapes_;
  std::size_t count_;
};

/// Values at a tet's nodes from those at its samples, between which stresses are linear or constant.
Square to_nodes(const std::vector<Barycentric>& points, std::size_t nodes) {
  if (points.size() == 1) return Square::Ones(static_cast<Eigen::Index>(nodes), 1);
  Square at_points(4, 4), at_nodes = Square::Zero(static_cast<Eigen::Index>(nodes), 4);  // of the four coordinates
  for (Eigen::Index q = 0; q < 4; ++q)
    for (Eigen::Index c = 0; c < 4; ++c)
      at_points(q, c) = points[static_cast<std::size_t>(q)][static_cast<std::size_t>(c)];
  at_nodes.topRows<4>().setIdentity();
  for (std::size_t e = 0; 4 + e < nodes; ++e)
    for (const int end : kTetEdges[e]) at_nodes(static_cast<Eigen::Index>(4 + e), end) = 0.5;
  return at_nodes * at_points.inverse();
}

/// ∫ σ : D⁻¹ : σ over a tet of volume one, per mode. @param nodal a row per node
Eigen::RowVectorXd complementary_energy(const StressRows& nodal, const Square& share, const Material& material) {
  const Eigen::Index modes = nodal.cols() / 6;
  const StressRows weighted = share * nodal;
  Eigen::RowVectorXd product = Eigen::RowVectorXd::Zero(modes);
  StressRows trace = StressRows::Zero(nodal.rows(), modes), weighted_trace = trace;
  for (Eigen::Index c = 0; c < 6; ++c) {
    const auto a = nodal.middleCols(c * modes, modes), b = weighted.middleCols(c * modes, modes);
    product += (c < 3 ? 1.0 : 2.0) * a.cwiseProduct(b).colwise().sum();
    if (c < 3) trace += a, weighted_trace += b;
  }
  const double nu = material.poisson_ratio;
  return ((1.0 + nu) * product - nu * trace.cwiseProduct(weighted_trace).colwise().sum()) / material.youngs_modulus;
}

/// What tets of one kind have in common.
struct Kind {
  std::size_t nodes;
  Square share, to_nodes;
};

/// ‖σ* − σ_h‖²/‖σ*‖², per mode.
Eigen::RowVectorXd relative_errors(const TetMesh& mesh, std::span<const Material> materials, const Kind& kind,
                                   const StressRecovery& recovery, const StressRows& raw) {
  const StressRows smooth = recovery.recover(raw);
  const auto samples = static_cast<Eigen::Index>(recovery.samples());
  Eigen::RowVectorXd whole = Eigen::RowVectorXd::Zero(raw.cols() / 6), off = whole;
  StressRows nodal(static_cast<Eigen::Index>(kind.nodes), raw.cols());
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    for (std::size_t a = 0; a < kind.nodes; ++a)
      nodal.row(static_cast<Eigen::Index>(a)) = smooth.row(recovery.value_of(t, a));
    const Material& material = materials[mesh.tet_region[t]];
    const double volume = signed_volume(mesh, static_cast<Index>(t));
    whole += volume * complementary_energy(nodal, kind.share, material);
    nodal -= kind.to_nodes * raw.middleRows(samples * static_cast<Eigen::Index>(t), samples);
    off += volume * complementary_energy(nodal, kind.share, material);
  }
  return off.cwiseQuotient(whole);
}

}  // namespace

std::vector<double> frequency_errors(const TetMesh& mesh, std::span<const Material> materials,
                                     std::span<const Index> fixed_nodes, MassKind mass,
                                     std::span<const double> eigenvalues, std::span<const double> shapes, Jobs& jobs) {
  if (eigenvalues.empty()) return {};
  const std::size_t nodes = mesh.has_mid_edge_nodes() ? 10 : 4, rows = 3 * mesh.nodes.size();
  const Kind kind{nodes, mass_shares(nodes), to_nodes(rule_points(nodes), nodes)};
  const StressRecovery recovery(mesh, fixed_nodes);
  std::vector<double> errors(eigenvalues.size(), 0.0);
  // Groups of modes do not depend on how many threads there are, and so neither do the bits.
  jobs.parallel_for((errors.size() + kModesAtOnce - 1) / kModesAtOnce, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t group = begin; group < end; ++group) {
      const std::size_t first = kModesAtOnce * group, count = std::min(kModesAtOnce, errors.size() - first);
      const Modes modes(mesh, materials, shapes.subspan(rows * first, rows * count));
      const Eigen::RowVectorXd off =
          relative_errors(mesh, materials, kind, recovery, modes.stresses(rule_points(nodes)));
      const std::vector<double> masses =
          mass == MassKind::kLumped ? modes.masses(kind.share) : std::vector<double>(count, 1.0);
      for (std::size_t m = 0; m < count; ++m)
        if (eigenvalues[first + m] > 0.0) errors[first + m] = std::sqrt(masses[m] * (1.0 + off[m])) - 1.0;
    }
  });
  return errors;
}

}  // namespace limber::internal
