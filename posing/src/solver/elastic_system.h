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

struct PairTerm {
  Index a = -1, b = -1;  // bodies of the interface; second derivatives by their twists
  PairMatrix matrix = PairMatrix::Zero();
};

/// H = strain's Gauss–Newton matrix + what acts on single bodies + a small mass matrix, over the twists of all bodies
/// that are not pinned. It falls apart into blocks, the sets of bodies that links connect: joints and limits are not in
/// it. They act on few bodies, the *interface*. All others are eliminated (a sparse Cholesky factor in blocks of six),
/// what is left at the interface is a small dense matrix S, and every problem with joints and limits is one
/// of S alone, between the two sweeps of a solution:
///   reduce(f); at the interface: u_I = S⁻¹ (f_I − Jᵀ λ) with λ from J S⁻¹ Jᵀ; expand(u)
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
  /// Start of a body's six unknowns; −1: pinned.
  Index dof(Index body) const { return dof_[static_cast<std::size_t>(body)]; }

  /// Assembles and factors H at a pose. @param rotations per body. @param added per body, of what acts on it alone
  /// (handles, curvature). @param between what acts between two bodies of the interface (joints)
  /// @return whether H is positive definite; it always is if what is added is semidefinite
  bool factor(const std::vector<Mat3>& rotations, const std::vector<TwistMatrix>& added,
              const std::vector<PairTerm>& between);

  /// Cost of factor(), in steps that only sweep.
  double factor_cost() const;

  /// The first sweep of H⁻¹ f. @param interface out: S⁻¹ of what is left of f there
  void reduce(const VectorX& f, VectorX& interface);
  /// The second, for any twists of the interface. @param u out: of all bodies
  void expand(const VectorX& interface, VectorX& u);
  /// The same without forces on other bodies: what the interface's twists do to all.
  void follow(const VectorX& interface, VectorX& u) const;

  // Twists of the interface: six per body that is in it and not pinned.
  Index interface_dofs() const { return interface_dofs_; }
  /// Start of a body's six among them; −1: not in it, or pinned.
  Index interface_dof(Index body) const { return interface_dof_[static_cast<std::size_t>(body)]; }

  /// J S⁻¹ Jᵀ, which is J H⁻¹ Jᵀ. @param rows on the interface
  MatrixX compliance(const std::vector<Row>& rows) const;
  /// J u
  VectorX apply(const std::vector<Row>& rows, const VectorX& interface) const;
  /// u −= S⁻¹ Jᵀ λ
  void subtract_response(const std::vector<Row>& rows, const VectorX& lambda, VectorX& interface) const;

 private:
  struct Block;
  void number(Block& block, const std::vector<bool>& interface);
  void place(Block& block) const;
  void take_interface(Block& block, MatrixX& S) const;
  void find_followers(Block& block) const;
  void add_force(const Row& row, double f, VectorX& interface) const;
  void assemble(Block& block, const std::vector<Mat3>& rotations, const std::vector<TwistMatrix>& added) const;

  const PoseStructure* structure_;
  double proximal_, proximal_of_linked_;
  Index dofs_ = 0, interface_dofs_ = 0;
  std::vector<Index> dof_, block_of_, interface_dof_;  // per body
  MatrixX inverse_;                                    // S⁻¹
  std::vector<Block> blocks_;
};

}  // namespace limber::internal
