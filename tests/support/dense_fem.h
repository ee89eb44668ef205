/// @file dense_fem.h
/// A second route to the matrices of linear tets: everything dense, nothing shared with the library but the mesh type.
///
/// Stiffness as the Hessian of the strain energy ½ ∫ (λ (tr ε)² + 2μ ε:ε), with the displacement gradient F from F·E =
/// U (edge matrices), and mass by a quadrature rule exact for quadratics.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <span>

#include "limber/mesh/tet_mesh.h"
#include "limber/model/material.h"

namespace limber::testing {

struct DenseModel {
  Eigen::MatrixXd K, M;  // 3n × 3n
};

/// The displacement gradient of a tet with corners x for the displacements u, both 3 × 4.
inline Mat3 displacement_gradient(const Eigen::Matrix<double, 3, 4>& x, const Eigen::Matrix<double, 3, 4>& u) {
  Mat3 E, U;
  for (int a = 0; a < 3; ++a) {
    E.col(a) = x.col(a + 1) - x.col(0);
    U.col(a) = u.col(a + 1) - u.col(0);
  }
  return U * E.inverse();
}

/// The energy W is quadratic, so K_ij = W(e_i + e_j) − W(e_i) − W(e_j), without truncation error.
inline Eigen::Matrix<double, 12, 12> dense_tet_stiffness(const Eigen::Matrix<double, 3, 4>& x, const Material& m) {
  const double volume = std::abs((x.col(1) - x.col(0)).cross(x.col(2) - x.col(0)).dot(x.col(3) - x.col(0))) / 6.0;
  const double nu = m.poisson_ratio, E = m.youngs_modulus;
  const double mu = E / (2 * (1 + nu)), lambda = E * nu / ((1 + nu) * (1 - 2 * nu));
  const auto energy = [&](const Eigen::Matrix<double, 12, 1>& u) {
    const Mat3 F = displacement_gradient(x, Eigen::Map<const Eigen::Matrix<double, 3, 4>>(u.data()));
    const Mat3 strain = (F + F.transpose()) / 2.0;
    return volume * (0.5 * lambda * strain.trace() * strain.trace() + mu * strain.squaredNorm());
  };
  using Vec12 = Eigen::Matrix<double, 12, 1>;
  Eigen::Matrix<double, 12, 12> K;
  for (int i = 0; i < 12; ++i)
    for (int j = 0; j < 12; ++j)
      K(i, j) = energy(Vec12::Unit(i) + Vec12::Unit(j)) - energy(Vec12::Unit(i)) - energy(Vec12::Unit(j));
  return K;
}

/// ∫ρ φ_a φ_b over a tet by the four-point rule that is exact for quadratics, or ρV/4 on the diagonal.
inline Eigen::Matrix4d dense_tet_mass(double rho_volume, bool lumped) {
  if (lumped) return rho_volume / 4.0 * Eigen::Matrix4d::Identity();
  const double near = (5.0 + 3.0 * std::sqrt(5.0)) / 20.0, far = (5.0 - std::sqrt(5.0)) / 20.0;
  Eigen::Matrix4d M = Eigen::Matrix4d::Zero();
  for (int point = 0; point < 4; ++point) {
    Eigen::Vector4d phi = Eigen::Vector4d::Constant(far);
    phi[point] = near;
    M += rho_volume / 4.0 * phi * phi.transpose();
  }
  return M;
}

/// add(nodes, K, M) for each tetrahedron: its stiffness, 12 × 12, and its mass, 4 × 4. @param material_of(element)
template <class MaterialOf, class Add>
void for_each_element(const TetMesh& mesh, bool lumped, MaterialOf&& material_of, Add&& add) {
  for (std::size_t e = 0; e < mesh.tets.size(); ++e) {
    const Tet& t = mesh.tets[e];
    const Material& m = material_of(e);
    Eigen::Matrix<double, 3, 4> x;
    for (int a = 0; a < 4; ++a) x.col(a) = mesh.nodes[t[a]];
    const double volume = std::abs((x.col(1) - x.col(0)).cross(x.col(2) - x.col(0)).dot(x.col(3) - x.col(0))) / 6.0;
    add(t, dense_tet_stiffness(x, m), dense_tet_mass(m.density * volume, lumped));
  }
}

inline DenseModel dense_model(const TetMesh& mesh, std::span<const Material> materials, bool lumped) {
  const auto size = static_cast<Eigen::Index>(3 * mesh.nodes.size());
  DenseModel model{Eigen::MatrixXd::Zero(size, size), Eigen::MatrixXd::Zero(size, size)};
  const auto material_of = [&](std::size_t e) -> const Material& { return materials[mesh.tet_region[e]]; };
  for_each_element(mesh, lumped, material_of, [&](const Tet& t, const auto& K, const auto& M) {
    for (int a = 0; a < 4; ++a)
      for (int b = 0; b < 4; ++b) {
        model.K.block<3, 3>(3 * t[a], 3 * t[b]) += K.template block<3, 3>(3 * a, 3 * b);
        model.M.block<3, 3>(3 * t[a], 3 * t[b]).diagonal().array() += M(a, b);
      }
  });
  return model;
}

}  // namespace limber::testing
