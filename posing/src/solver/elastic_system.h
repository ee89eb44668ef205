// The quadratic model of the energy in all bodies' twists, and its inverse.
#pragma once

#include <memory>
#include <vector>

#include "solver/rows.h"

namespace limber::internal {

using VectorX = Eigen::VectorXd;
using MatrixX = Eigen::MatrixXd;
using TwistMatrix = Eigen::Matrix<double, 6, 6>;

/// The second derivative (Gauss–Newton) of ½ weight |R s + p|² + ½ Σ_k |R L_k|² in the twist of a body.
TwistMatrix own_block(double weight, const Vec3& arm, const Mat3& spread);

/// H = strain's Gauss–Newton matrix + what acts on single bodies + a small mass matrix, over the twists of all bodies
/// that are not pinned. It falls apart into blocks, the sets of bodies that links connect: joints and limits are not in
/// it. They act on few bodies, the *interface*; what a force there does to all bodies is kept as dense columns H⁻¹E,
/// and with them every problem with joints and limits is a small dense one.
class ElasticSystem {
 public:
  /// @param interface bodies on which rows act. @param proximal weight of the mass matrix of single bodies, and of
  /// blocks of several
  ElasticSystem(const PoseStructure& structure, const std::vector<bool>& interface, double proximal,
                double proximal_of_linked);
  ~ElasticSystem();
  ElasticSystem(ElasticSystem&&) noexcept;
  ElasticSystem& operator=(ElasticSystem&&) noexcept;

  Index dofs() const { return dofs_; }
  /// Where a body's six unknowns begin; −1: pinned.
  Index dof(Index body) const { return dof_[static_cast<std::size_t>(body)]; }

  /// Assembles and factors H at a pose. @param rotations per body. @param added per body, of what acts on it alone
  /// (handles, curvature); positive semidefinite
  void factor(const std::vector<Mat3>& rotations, const std::vector<TwistMatrix>& added);

  /// u = H⁻¹ f
  void solve(const VectorX& f, VectorX& u) const;

  /// uᵀ H u
  double square(const VectorX& u) const;

  /// A row's derivative in the unknowns of the interface: sparse.
  struct InterfaceRow {
    Index block = -1;  // of the first of two pieces; −1: nothing there
    Index offset = 0;  // of the body within its block's interface
    Twist J = Twist::Zero();
  };
  using InterfaceRows = std::vector<std::array<InterfaceRow, 2>>;
  InterfaceRows at_interface(const std::vector<Row>& rows) const;

  /// J H⁻¹ Jᵀ
  MatrixX compliance(const InterfaceRows& rows) const;
  /// J u
  VectorX apply(const InterfaceRows& rows, const VectorX& u) const;
  /// u −= H⁻¹ Jᵀ λ
  void subtract_response(const InterfaceRows& rows, const VectorX& lambda, VectorX& u) const;

 private:
  struct Block;
  void assemble(Block& block, const std::vector<Mat3>& rotations, const std::vector<TwistMatrix>& added) const;

  const PoseStructure* structure_;
  double proximal_, proximal_of_linked_;
  Index dofs_ = 0;
  std::vector<Index> dof_, block_of_, slot_of_;  // per body; slot: within its block's interface, or −1
  std::vector<Block> blocks_;
};

}  // namespace limber::internal
