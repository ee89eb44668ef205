/// @file nodal_elasticity.h
/// Elastic bodies by the places of all their nodes: linear tetrahedra, total Lagrangian, no modes and no body frame
/// kept as a state. The reference for limber's motions. Shares with the library the mesh and the material, nothing
/// else.
///
///   V(x) = Σ_e V_e Ψ(F_e),   F_e = Σ_a x_a ∇φ_aᵀ,   f = −∂V/∂x
///
///   kLinear              Ψ = λ/2 (tr ε)² + μ ε:ε of d = Rᵀ(x − c) − r: small strains in a frame R, c that turns with the
///                        body. R is the best rotation of the rest shape onto x in the mass product, so that
///                        ∫ρ r × d = 0 (Eckart's condition); a body with fixed nodes has R = 1. All inertia is there.
///   kStVenantKirchhoff   Ψ = λ/2 (tr E)² + μ E:E,   E = (FᵀF − 1)/2
///   kNeoHookean          Ψ = μ'/2 (I − 3) − μ'/2 log(I + 1) + λ'/2 (J − α)², stable where tets invert: Smith, de Goes, Kim,
///                        *Stable Neo-Hookean Flesh Simulation*, 2018; I = |F|², μ' = 4μ/3, λ' = λ + 5μ/6,
///                        α = 1 + 3μ'/(4λ'), which has λ and μ at small strains
#pragma once

#include <Eigen/Geometry>
#include <Eigen/SparseCore>
#include <array>
#include <span>
#include <vector>

#include "limber/mesh/tet_mesh.h"
#include "limber/model/material.h"

namespace limber::testing {

enum class ElasticLaw { kLinear, kStVenantKirchhoff, kNeoHookean };

/// A vector per node, a row each.
using NodeVectors = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
using SparseDoubles = Eigen::SparseMatrix<double>;

/// Places of the mesh's nodes, m.
NodeVectors node_places(const TetMesh& mesh);
/// All numbers, node by node.
Eigen::Map<const Eigen::VectorXd> numbers_of(const NodeVectors& vectors);

/// The rotation, about the centres of mass, that takes places a nearest to places b in the mass product.
struct BestRotation {
  Mat3 rotation = Mat3::Identity();
  Vec3 from = Vec3::Zero(), to = Vec3::Zero();  ///< centres of mass of a and b
};
/// @param weighted M a: the mass matrix times a
BestRotation best_rotation(const NodeVectors& a, const NodeVectors& weighted, const NodeVectors& b,
                           const Eigen::VectorXd& masses);

class NodalElasticity {
 public:
  /// @param mesh one body of one material. @param fixed nodes that stay where they are, three or more or none
  NodalElasticity(const TetMesh& mesh, const Material& material, ElasticLaw law, std::span<const Index> fixed = {});

  Eigen::Index nodes() const { return rest_.rows(); }
  const NodeVectors& rest() const { return rest_; }
  /// Consistent mass on the node graph, n × n, kg.
  const SparseDoubles& mass() const { return mass_; }
  const Eigen::VectorXd& node_masses() const { return node_masses_; }  ///< its rows' sums, kg
  const std::vector<char>& is_fixed() const { return is_fixed_; }

  double energy(const NodeVectors& x) const;       ///< J
  NodeVectors forces(const NodeVectors& x) const;  ///< N
  /// −∂f/∂x, 3n × 3n, N/m. For kLinear R K Rᵀ, without the turn of R with x.
  SparseDoubles stiffness(const NodeVectors& x) const;

 private:
  Mat3 deformation(const NodeVectors& x, std::size_t tet) const;
  /// For kLinear: d and the frame it is seen in.
  struct Turned {
    Mat3 R = Mat3::Identity();
    NodeVectors d;
  };
  Turned turned(const NodeVectors& x) const;
  NodeVectors linear_forces(const NodeVectors& x) const;
  void assemble_mass(double density);
  template <class Tangent>
  SparseDoubles assemble_stiffness(Tangent&& tangent_of) const;

  ElasticLaw law_;
  double lambda_, mu_;
  std::vector<Tet> tets_;
  std::vector<std::array<Vec3, 4>> gradients_;
  std::vector<double> volumes_;
  NodeVectors rest_, weighted_rest_;  // the latter: M (rest − centre of mass)
  Vec3 center_ = Vec3::Zero();
  SparseDoubles mass_, linear_stiffness_;
  Eigen::VectorXd node_masses_;
  std::vector<char> is_fixed_;
  bool turns_ = true;
};

}  // namespace limber::testing
