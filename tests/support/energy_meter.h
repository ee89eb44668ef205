/// @file energy_meter.h
/// A second meter of a baked free body's energy: sums over the nodes of its mesh with the matrices of dense_fem.h.
/// It shares with World::energy the state (pose, velocities, amplitudes, rates) and the asset's shapes, nothing else.
///
///   v_n = v + ω × (r_n + u_n) + u̇_n,   u = W z, u̇ = W ż          body axes, every node n
///   T = ½ vᵀ M v,   S = ½ uᵀ K u,   V = −g·Σ M x                  consistent masses
///
/// World::energy adds ½ Σ ż² and ½ Σ λ z² to the energies of a rigid body of the rest shape. For exact shapes (the
/// asset keeps them in single precision) WᵀMW = I, WᵀKW = Λ, and W is M-orthogonal to the rigid motions. Then S = ½ Σ λ
/// z² and V is that of the mass centre exactly, and the products of v with u and u̇ vanish, as does that of ω × r with
/// u̇:
///
///   T − T_world = ⟨ω × r, ω × u⟩ + ½ |ω × u|² + ⟨ω × u, u̇⟩        in the inner product of M
///
/// With |u| = |z|, |u̇| = |ż| and |ω × r|² = ω·I ω this is, by Cauchy and Schwarz,
///
///   |T − T_world| ≤ |ω| |z| (√(ω·I ω) + ½ |ω| |z| + |ż|)           "spin_bound"
///
/// first order in the displacement, second in the spin: the change of inertia that the frame leaves out
/// (docs/derivations/rigid-frame.md). The bake must use consistent masses, since lumped ones have another inertia than
/// the solid by which the frame turns.
#pragma once

#include <Eigen/Dense>
#include <Eigen/SparseCore>
#include <cmath>
#include <memory>
#include <vector>

#include "dense_fem.h"
#include "limber/engine/world.h"
#include "limber/model/modal_model.h"

namespace limber::testing {

/// What the nodes have, J.
struct NodeEnergy {
  double kinetic = 0.0, strain = 0.0, potential = 0.0;
  double spin_bound = 0.0;  ///< by which `kinetic` may differ from World's for exact shapes
  double total() const { return kinetic + strain + potential; }
};

class EnergyMeter {
 public:
  /// @param model of a free body, baked from the mesh with consistent masses; with a volume block if it has modes
  EnergyMeter(const TetMesh& mesh, const Material& material, std::shared_ptr<const ModalModel> model)
      : model_(std::move(model)) {
    assemble(mesh, material);
    const Vec3 origin = model_->data().origin_in_input;
    rest_.resize(3 * static_cast<Eigen::Index>(mesh.nodes.size()));
    shapes_.resize(rest_.size(), model_->modes());
    for (std::size_t n = 0; n < mesh.nodes.size(); ++n) {
      const auto row = 3 * static_cast<Eigen::Index>(n);
      rest_.segment<3>(row) = mesh.nodes[n] - origin;
      for (Index m = 0; m < model_->modes(); ++m)
        shapes_.block<3, 1>(row, m) = model_->data().volume_block->basis.shape(static_cast<Index>(n), m).cast<double>();
    }
  }

  NodeEnergy read(const BodyView& body, const Vec3& gravity) const {
    const auto vector = [](std::span<const double> values) {
      return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
    };
    const Eigen::VectorXd z = vector(body.amplitudes), rates = vector(body.rates);
    const Eigen::VectorXd u = shapes_ * z, place = rest_ + u;
    const Quaternion q_BW = body.pose.q.conjugate();
    const Vec3 v = q_BW * body.velocity, omega = q_BW * body.angular_velocity;
    const Eigen::VectorXd turning = cross(omega, rest_);
    const Eigen::VectorXd velocity = uniform(v) + cross(omega, place) + shapes_ * rates;

    NodeEnergy energy;
    energy.kinetic = 0.5 * velocity.dot(M_ * velocity);
    energy.strain = 0.5 * u.dot(K_ * u);
    // The place of the body by itself: turned into body axes it would lose digits far from the origin.
    const double mass = sum_of(M_ * uniform(Vec3::UnitX())).x();
    energy.potential = -(q_BW * gravity).dot(sum_of(M_ * place)) - mass * gravity.dot(body.pose.p);
    const double turn = omega.norm() * z.norm();
    energy.spin_bound = turn * (std::sqrt(turning.dot(M_ * turning)) + 0.5 * turn + rates.norm());
    return energy;
  }

 private:
  /// The element matrices of dense_fem.h, summed.
  void assemble(const TetMesh& mesh, const Material& material) {
    std::vector<Eigen::Triplet<double>> stiffness, mass;
    const auto material_of = [&](std::size_t) -> const Material& { return material; };
    for_each_element(mesh, false, material_of, [&](const Tet& t, const auto& K, const auto& M) {
      for (int i = 0; i < 12; ++i)
        for (int j = 0; j < 12; ++j) {
          const auto row = 3 * t[i / 3] + i % 3, column = 3 * t[j / 3] + j % 3;
          stiffness.emplace_back(row, column, K(i, j));
          if (i % 3 == j % 3) mass.emplace_back(row, column, M(i / 3, j / 3));
        }
    });
    const auto size = static_cast<Eigen::Index>(3 * mesh.nodes.size());
    K_.resize(size, size), M_.resize(size, size);
    K_.setFromTriplets(stiffness.begin(), stiffness.end());
    M_.setFromTriplets(mass.begin(), mass.end());
  }

  Eigen::VectorXd uniform(const Vec3& v) const { return v.replicate(rest_.size() / 3, 1); }
  static Eigen::VectorXd cross(const Vec3& omega, const Eigen::VectorXd& x) {
    Eigen::VectorXd out(x.size());
    for (Eigen::Index i = 0; i < x.size(); i += 3) out.segment<3>(i) = omega.cross(Vec3(x.segment<3>(i)));
    return out;
  }
  static Vec3 sum_of(const Eigen::VectorXd& x) {
    Vec3 sum = Vec3::Zero();
    for (Eigen::Index i = 0; i < x.size(); i += 3) sum += x.segment<3>(i);
    return sum;
  }

  std::shared_ptr<const ModalModel> model_;
  Eigen::SparseMatrix<double> K_, M_;
  Eigen::VectorXd rest_;
  Eigen::MatrixXd shapes_;
};

}  // namespace limber::testing
