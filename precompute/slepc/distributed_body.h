/// @file distributed_body.h
/// One body whose degrees of freedom are shared out among processes: each assembles the rows of its own nodes from the
/// tets around them. Matrices of columns hold the own rows, three a node. All but the accessors is collective.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "eigen/stored_body.h"
#include "limber/precompute/sparse_matrix.h"
#include "mesh_share.h"
#include "petsc_objects.h"
#include "stages.h"

namespace limber::internal {

class DistributedBody {
 public:
  DistributedBody(const std::filesystem::path& path, const StoredBody& body);

  const StoredBody& stored() const { return body_; }
  Stages& stages() { return stages_; }
  PetscInt size() const { return 3 * body_.free_nodes(); }
  PetscInt own_size() const { return 3 * (share_.end - share_.first); }
  const Eigen::MatrixXd& N() const { return N_; }  ///< the null space of K, NᵀMN = I
  const Eigen::MatrixXd& MN() const { return MN_; }

  /// AᵀB over all processes, the same bits on each.
  static Eigen::MatrixXd dot(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B);

  Eigen::MatrixXd mass_times(const Eigen::Ref<const Eigen::MatrixXd>& X);
  /// Tet by tet, without the round-off of K's entries.
  Eigen::MatrixXd stiffness_times(const Eigen::Ref<const Eigen::MatrixXd>& X);

  OwnedMat pinned_stiffness() const;  ///< K with rows and columns of the pins those of the identity
  /// Own rows that are pins, at which loads on that matrix must be zero.
  const std::vector<Index>& pinned_rows() const { return pinned_rows_; }
  OwnedMat shifted_stiffness(double s) const;  ///< K + sM

  /// Place of each degree of freedom in the order of elimination, from 1; empty on all processes but the first.
  const std::vector<int>& elimination_order() const { return order_; }
  OwnedVec own_coordinates() const;

  /// The same for every number of processes, spread evenly over (−1, 1).
  Eigen::VectorXd start_vector(std::uint64_t seed) const;

  /// One column over all nodes of the body, zero at the fixed ones; empty on all processes but the first.
  std::vector<double> gathered(const Eigen::Ref<const Eigen::VectorXd>& x) const;

 private:
  Stages stages_;
  StoredBody body_;
  NodeShare share_;
  MeshShare mine_;
  std::vector<Index> own_dofs_;    // of the mesh here, ascending places
  std::vector<Index> free_nodes_;  // of the mesh here
  std::vector<char> pinned_;       // each degree of freedom of the mesh here
  std::vector<Index> pinned_rows_;
  SparseMatrix node_mass_;  // of the mesh here, complete in the own columns
  std::vector<int> order_;
  Eigen::MatrixXd N_, MN_;
  OwnedVec outer_, inner_;  // own rows; three a free node of the mesh here
  OwnedScatter scatter_;

  void find_pins();
  void prepare_exchange();
  void read_order(const std::filesystem::path& path);
  void read_motions(const std::filesystem::path& path);
  Eigen::MatrixXd on_mesh(const Eigen::Ref<const Eigen::MatrixXd>& X);
  SparseMatrix scaled_stiffness() const;
  OwnedMat rows(const SparseMatrix& A, bool pins) const;
};

}  // namespace limber::internal
