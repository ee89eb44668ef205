#include "limber/model/soft_bodies.h"

#include <Eigen/Dense>
#include <Eigen/Sparse>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "limber/core/error.h"
#include "limber/mesh/surface_mesh.h"
#include "limber/mesh/tet_mesh.h"
#include "limber/model/tet_element.h"

namespace limber {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using Sparse = Eigen::SparseMatrix<double>;

/// The cube |x_i| ≤ 1, `cells` of it along each axis, each cut in six along its diagonal (Kuhn).
TetMesh grid(const std::array<Index, 3>& cells) {
  TetMesh mesh;
  const auto node = [&](const std::array<Index, 3>& at) {
    return at[0] + (cells[0] + 1) * (at[1] + (cells[1] + 1) * at[2]);
  };
  std::array<Index, 3> at{};
  const auto each = [&](Index more, const auto& visit) {
    for (at[2] = 0; at[2] < cells[2] + more; ++at[2])
      for (at[1] = 0; at[1] < cells[1] + more; ++at[1])
        for (at[0] = 0; at[0] < cells[0] + more; ++at[0]) visit();
  };
  each(1, [&] {
    mesh.nodes.emplace_back(2.0 * at[0] / cells[0] - 1.0, 2.0 * at[1] / cells[1] - 1.0, 2.0 * at[2] / cells[2] - 1.0);
  });
  each(0, [&] {
    std::array<std::size_t, 3> order{0, 1, 2};
    do {
      Tet tet{};
      std::array<Index, 3> corner = at;
      for (std::size_t i = 0; i < 4; ++i) {
        tet[i] = node(corner);
        if (i < 3) ++corner[order[i]];
      }
      const bool odd = order[1] == (order[0] + 2) % 3;
      if (odd) std::swap(tet[2], tet[3]);
      mesh.tets.push_back(tet);
    } while (std::next_permutation(order.begin(), order.end()));
  });
  return mesh;
}

/// K, and the masses at the nodes, three times each.
struct Matrices {
  Sparse K;
  VectorXd mass;
};

Matrices assemble(const TetMesh& mesh, const Material& material) {
  const auto size = static_cast<Eigen::Index>(3 * mesh.nodes.size());
  Matrices m{Sparse(size, size), VectorXd::Zero(size)};
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(144 * mesh.tets.size());
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    const Tet& tet = mesh.tets[t];
    std::array<Vec3, 4> x;
    for (std::size_t a = 0; a < 4; ++a) x[a] = mesh.nodes[static_cast<std::size_t>(tet[a])];
    const TetElement e = make_tet_element(x, material);
    const double quarter = 0.25 * material.density * signed_volume(mesh, static_cast<Index>(t));
    for (std::size_t a = 0; a < 4; ++a) {
      m.mass.segment<3>(3 * tet[a]).array() += quarter;
      for (std::size_t b = 0; b < 4; ++b) {
        const Mat3 block = stiffness_block(e, e.gradient[a], e.gradient[b]);
        for (int p = 0; p < 3; ++p)
          for (int q = 0; q < 3; ++q) entries.emplace_back(3 * tet[a] + p, 3 * tet[b] + q, block(p, q));
      }
    }
  }
  m.K.setFromTriplets(entries.begin(), entries.end());
  return m;
}

/// Takes the span of `to` out of X and makes what is left orthonormal, all in the masses' inner product; twice, which
/// is enough. Columns that vanish are left out.
MatrixXd orthonormal(MatrixXd X, const MatrixXd& to, const VectorXd& mass) {
  constexpr double kVanished = 1e-10;
  Eigen::Index kept = 0;
  for (Eigen::Index i = 0; i < X.cols(); ++i) {
    VectorXd x = X.col(i);
    const double before = std::sqrt(x.dot(mass.cwiseProduct(x)));
    for (int pass = 0; pass < 2; ++pass) {
      x -= to * (to.transpose() * mass.cwiseProduct(x));
      x -= X.leftCols(kept) * (X.leftCols(kept).transpose() * mass.cwiseProduct(x));
    }
    const double left = std::sqrt(x.dot(mass.cwiseProduct(x)));
    if (left > kVanished * before) X.col(kept++) = x / left;
  }
  return X.leftCols(kept);
}

/// Three translations, three rotations.
MatrixXd rigid_motions(const TetMesh& mesh, const VectorXd& mass) {
  MatrixXd R(mass.size(), 6);
  for (std::size_t n = 0; n < mesh.nodes.size(); ++n)
    for (int axis = 0; axis < 3; ++axis) {
      R.block<3, 1>(static_cast<Eigen::Index>(3 * n), axis) = Vec3::Unit(axis);
      R.block<3, 1>(static_cast<Eigen::Index>(3 * n), 3 + axis) = Vec3::Unit(axis).cross(mesh.nodes[n]);
    }
  return orthonormal(R, MatrixXd(mass.size(), 0), mass);
}

struct Modes {
  VectorXd eigenvalues;
  MatrixXd shapes;  // 3n × k, orthonormal over the masses
};

/// The lowest modes. Each round takes the best shapes known and what (K + σM)⁻¹M makes of them, three times over, and
/// picks the best of their span (Rayleigh–Ritz).
Modes lowest_modes(const Matrices& m, const MatrixXd& rigid, Eigen::Index count, double shift) {
  constexpr int kDepth = 3, kMostRounds = 200;
  constexpr double kConverged = 1e-10;  // change of each λ in a round; it falls with the square of the shapes' error
  const Eigen::Index block = std::min(count + 6, m.mass.size() - 6);
  Sparse S = m.K;
  S.diagonal() += shift * m.mass;
  const Eigen::SimplicialLDLT<Sparse> factor(S);
  if (factor.info() != Eigen::Success) throw ComputationError("make_soft body: the stiffness matrix has no factor");
  MatrixXd X(m.mass.size(), block);
  for (Eigen::Index j = 0; j < block; ++j)  // any that miss no mode: waves that no symmetry of the grid shares
    for (Eigen::Index i = 0; i < X.rows(); ++i)
      X(i, j) = std::sin(1.0 + 0.7 * static_cast<double>(i) * (1.0 + std::sqrt(2.0) * static_cast<double>(j)));
  X = orthonormal(X, rigid, m.mass);
  VectorXd before = VectorXd::Constant(count, std::numeric_limits<double>::infinity());
  for (int round = 0; round < kMostRounds; ++round) {
    MatrixXd space = X;
    for (int depth = 0; depth < kDepth && X.cols() > 0; ++depth) {
      MatrixXd known(space.rows(), rigid.cols() + space.cols());
      known << rigid, space;
      X = orthonormal(factor.solve(m.mass.asDiagonal() * X), known, m.mass);
      MatrixXd larger(space.rows(), space.cols() + X.cols());
      larger << space, X;
      space = std::move(larger);
    }
    const Eigen::SelfAdjointEigenSolver<MatrixXd> ritz(space.transpose() * (m.K * space));
    X = space * ritz.eigenvectors().leftCols(block);
    const VectorXd now = ritz.eigenvalues().head(count);
    if (((before - now).cwiseAbs().array() <= kConverged * now.array()).all()) return {now, X.leftCols(count)};
    before = now;
  }
  throw ComputationError("make_soft body: modes have not converged in " + std::to_string(kMostRounds) + " rounds");
}

/// Rows of all nodes' shapes at some of them.
ModalBasis basis_at(const std::vector<Index>& nodes, const MatrixXd& shapes) {
  ModalBasis basis(static_cast<Index>(nodes.size()), static_cast<Index>(shapes.cols()));
  for (std::size_t v = 0; v < nodes.size(); ++v)
    for (Eigen::Index i = 0; i < shapes.cols(); ++i)
      basis.set(static_cast<Index>(v), static_cast<Index>(i),
                shapes.block<3, 1>(Eigen::Index{3} * nodes[v], i).cast<float>());
  return basis;
}

std::shared_ptr<const ModalModel> make_soft(const std::string& name, TetMesh mesh, const Material& material, int modes,
                                            double damping_ratio) {
  const auto most = static_cast<int>(mesh.nodes.size());
  if (modes < 1 || modes > most)
    throw InvalidArgument("make_soft_" + name + ": modes is " + std::to_string(modes) + ", expected 1 to " +
                          std::to_string(most));
  if (!(damping_ratio >= 0.0 && std::isfinite(damping_ratio)))
    throw InvalidArgument("make_soft_" + name + ": damping_ratio is " + std::to_string(damping_ratio) +
                          ", expected a finite number of at least 0");
  material.validate("make_soft_" + name);
  const VolumeProperties solid = volume_properties(mesh);
  for (Vec3& p : mesh.nodes) p -= solid.centroid;
  const Matrices m = assemble(mesh, material);
  const double size2 = solid.second_moment.trace() / solid.volume;
  const Modes found =
      lowest_modes(m, rigid_motions(mesh, m.mass), modes, 0.01 * material.shear_modulus() / (material.density * size2));

  ModalModelData data;
  data.name = name;
  data.mass = material.density * solid.volume;
  data.volume = solid.volume;
  data.inertia = material.density * (solid.second_moment.trace() * Mat3::Identity() - solid.second_moment);
  for (Eigen::Index i = 0; i < modes; ++i) {
    data.eigenvalues.push_back(found.eigenvalues[i]);
    data.decays.push_back(damping_ratio * std::sqrt(found.eigenvalues[i]));
    data.participation.push_back(Vec3::Zero());
    Mat3 moment = Mat3::Zero();
    for (std::size_t n = 0; n < mesh.nodes.size(); ++n) {
      const auto at = static_cast<Eigen::Index>(3 * n);
      moment += m.mass[at] * mesh.nodes[n] * found.shapes.col(i).segment<3>(at).transpose();
    }
    data.moments.push_back(moment);
  }
  const BoundarySurface boundary = boundary_surface(mesh);
  for (const Vec3& p : boundary.surface.vertices) data.render.rest.push_back(p.cast<float>());
  data.render.triangles = boundary.surface.triangles;
  data.render.basis = basis_at(boundary.node_of, found.shapes);
  std::vector<Index> all(mesh.nodes.size());
  for (std::size_t n = 0; n < all.size(); ++n) all[n] = static_cast<Index>(n);
  data.volume_block = ModalVolume{std::move(mesh.nodes), std::move(mesh.tets), basis_at(all, found.shapes),
                                  basis_at(all, m.mass.asDiagonal() * found.shapes)};
  return std::make_shared<const ModalModel>(std::move(data));
}

void require_cells(Index cells, Index least, const char* function) {
  if (cells < least)
    throw InvalidArgument(std::string(function) + ": cells is " + std::to_string(cells) + ", expected at least " +
                          std::to_string(least));
}

}  // namespace

std::shared_ptr<const ModalModel> make_soft_box(const Vec3& half_extents, const std::array<Index, 3>& cells,
                                                const Material& material, int modes, double damping_ratio) {
  if (!half_extents.allFinite() || !(half_extents.minCoeff() > 0.0))
    throw InvalidArgument("make_soft_box: half_extents are not all finite and above 0");
  for (const Index along : cells) require_cells(along, 1, "make_soft_box");
  TetMesh mesh = grid(cells);
  for (Vec3& p : mesh.nodes) p = p.cwiseProduct(half_extents);
  return make_soft("box", std::move(mesh), material, modes, damping_ratio);
}

std::shared_ptr<const ModalModel> make_soft_ball(double radius, Index cells, const Material& material, int modes,
                                                 double damping_ratio) {
  if (!(radius > 0.0 && std::isfinite(radius)))
    throw InvalidArgument("make_soft_ball: radius is " + std::to_string(radius) +
                          " m, expected a finite number above 0");
  require_cells(cells, 2, "make_soft_ball");
  TetMesh mesh = grid({cells, cells, cells});
  for (Vec3& p : mesh.nodes)
    if (!p.isZero()) p *= radius * p.cwiseAbs().maxCoeff() / p.norm();
  return make_soft("ball", std::move(mesh), material, modes, damping_ratio);
}

}  // namespace limber
