#include "distributed_body.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "eigen/sparse_operations.h"

namespace limber::internal {
namespace {

SparseMatrix divided(SparseMatrix A, double unit) {
  for (double& value : A.value) value /= unit;
  return A;
}

}  // namespace

DistributedBody::DistributedBody(const std::filesystem::path& path, const StoredBody& body)
    : body_(body), share_(share_nodes(path, body)), mine_(read_share(path, body, share_)) {
  for (std::size_t i = 0; i < mine_.node_of.size(); ++i) {
    if (share_.has(mine_.node_of[i]))
      for (Index axis = 0; axis < 3; ++axis) own_dofs_.push_back(static_cast<Index>(3 * i) + axis);
    if (share_.place[mine_.node_of[i]] >= 0) free_nodes_.push_back(static_cast<Index>(i));
  }
  find_pins();
  node_mass_ = divided(assemble_mass(mine_.mesh, body_.materials, body_.mass), body_.mass_unit);
  prepare_exchange();
  if (process() == 0) read_order(path);
  read_motions(path);
  MN_ = mass_times(N_);
  stages_.lap("share");
}

void DistributedBody::find_pins() {
  pinned_.assign(3 * mine_.node_of.size(), 0);
  Index free_before = 0, node = 0;  // pins are numbered over the free nodes in the order of the body
  for (std::size_t i = 0; i < mine_.node_of.size(); ++i) {
    for (; node < mine_.node_of[i]; ++node)
      if (share_.place[node] >= 0) ++free_before;
    if (share_.place[node] < 0) continue;
    for (int axis = 0; axis < 3; ++axis)
      pinned_[3 * i + axis] = std::binary_search(body_.pins.begin(), body_.pins.end(), 3 * free_before + axis) ? 1 : 0;
  }
  for (std::size_t row = 0; row < own_dofs_.size(); ++row)
    if (pinned_[own_dofs_[row]]) pinned_rows_.push_back(static_cast<Index>(row));
}

void DistributedBody::prepare_exchange() {
  std::vector<PetscInt> from;
  for (const Index node : free_nodes_) from.push_back(share_.place[mine_.node_of[node]]);
  const auto count = static_cast<PetscInt>(from.size());
  check(VecCreateMPIWithArray(PETSC_COMM_WORLD, 1, own_size(), size(), nullptr, outer_.out()));
  check(VecCreateSeq(PETSC_COMM_SELF, 3 * count, inner_.out()));
  OwnedIndices of_outer, of_inner;
  check(ISCreateBlock(PETSC_COMM_SELF, 3, count, from.data(), PETSC_COPY_VALUES, of_outer.out()));
  check(ISCreateStride(PETSC_COMM_SELF, 3 * count, 0, 1, of_inner.out()));
  check(VecScatterCreate(outer_, of_outer, inner_, of_inner, scatter_.out()));
}

void DistributedBody::read_order(const std::filesystem::path& path) {
  std::vector<Index> places;  // of free nodes in the order of the body
  for (const Index place : share_.place)
    if (place >= 0) places.push_back(place);
  order_.resize(3 * places.size());
  for_each_record<Index>(path, body_.order_begin(), body_.free_nodes(), 1, [&](Index step, const Index* node) {
    for (int axis = 0; axis < 3; ++axis)
      order_[3 * static_cast<std::size_t>(places[*node]) + axis] = 3 * step + axis + 1;
  });
}

void DistributedBody::read_motions(const std::filesystem::path& path) {
  N_.resize(own_size(), body_.zero_modes);
  // Nodes lie in the file in their own order, as the own ones do here.
  std::vector<bool> own;
  own.reserve(static_cast<std::size_t>(body_.free_nodes()));
  for (std::size_t node = 0; node < share_.place.size(); ++node)
    if (share_.place[node] >= 0) own.push_back(share_.has(static_cast<Index>(node)));
  Eigen::Index row = 0;
  for_each_record<double>(path, body_.motions_begin(), body_.zero_modes > 0 ? body_.free_nodes() : 0,
                          3 * body_.zero_modes, [&](Index node, const double* motions) {
                            if (!own[node]) return;
                            for (int axis = 0; axis < 3; ++axis, ++row, motions += body_.zero_modes)
                              N_.row(row) = Eigen::Map<const Eigen::RowVectorXd>(motions, body_.zero_modes);
                          });
}

Eigen::MatrixXd DistributedBody::dot(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B) {
  const Eigen::MatrixXd here = A.transpose() * B;
  Eigen::MatrixXd all(here.rows(), here.cols());
  const auto count = static_cast<int>(here.size());
  MPI_Reduce(here.data(), all.data(), count, MPI_DOUBLE, MPI_SUM, 0, PETSC_COMM_WORLD);
  MPI_Bcast(all.data(), count, MPI_DOUBLE, 0, PETSC_COMM_WORLD);
  return all;
}

Eigen::MatrixXd DistributedBody::on_mesh(const Eigen::Ref<const Eigen::MatrixXd>& X) {
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(3 * static_cast<Eigen::Index>(mine_.node_of.size()), X.cols());
  for (Eigen::Index c = 0; c < X.cols(); ++c) {
    check(VecPlaceArray(outer_, X.col(c).data()));
    check(VecScatterBegin(scatter_, outer_, inner_, INSERT_VALUES, SCATTER_FORWARD));
    check(VecScatterEnd(scatter_, outer_, inner_, INSERT_VALUES, SCATTER_FORWARD));
    check(VecResetArray(outer_));
    const PetscScalar* value = nullptr;
    check(VecGetArrayRead(inner_, &value));
    for (std::size_t i = 0; i < free_nodes_.size(); ++i)
      all.col(c).segment<3>(3 * free_nodes_[i]) = Eigen::Map<const Eigen::Vector3d>(value + 3 * i);
    check(VecRestoreArrayRead(inner_, &value));
  }
  return all;
}

Eigen::MatrixXd DistributedBody::mass_times(const Eigen::Ref<const Eigen::MatrixXd>& X) {
  return multiply_by_axes(node_mass_, on_mesh(X))(own_dofs_, Eigen::all);
}

Eigen::MatrixXd DistributedBody::stiffness_times(const Eigen::Ref<const Eigen::MatrixXd>& X) {
  Eigen::MatrixXd KX(X.rows(), X.cols());
  for (Eigen::Index c = 0; c < X.cols(); ++c) {
    const Eigen::VectorXd u = on_mesh(X.col(c));
    Eigen::VectorXd f(u.size());
    elastic_forces(mine_.mesh, body_.materials, {u.data(), u.data() + u.size()}, {f.data(), f.data() + f.size()});
    KX.col(c) = f(own_dofs_) / body_.stiffness_unit;
  }
  return KX;
}

SparseMatrix DistributedBody::scaled_stiffness() const {
  return divided(assemble_stiffness(mine_.mesh, body_.materials), body_.stiffness_unit);
}

OwnedMat DistributedBody::pinned_stiffness() const { return rows(scaled_stiffness(), true); }

OwnedMat DistributedBody::shifted_stiffness(double s) const {
  return rows(add_mass(scaled_stiffness(), s, node_mass_), false);
}

OwnedMat DistributedBody::rows(const SparseMatrix& A, bool pins) const {
  std::vector<PetscInt> place(static_cast<std::size_t>(A.size));  // of each degree of freedom here; −1: none
  for (std::size_t i = 0; i < mine_.node_of.size(); ++i) {
    const Index node = share_.place[mine_.node_of[i]];
    for (int axis = 0; axis < 3; ++axis) place[3 * i + axis] = node < 0 ? -1 : 3 * node + axis;
  }
  std::vector<PetscInt> start{0}, column;
  std::vector<PetscScalar> value;
  column.reserve(A.row.size());
  value.reserve(A.row.size());
  std::vector<std::pair<PetscInt, PetscScalar>> row;  // PETSc takes them by ascending column
  for (const Index j : own_dofs_) {                   // a column, which is a row too
    row.clear();
    for (Index e = A.column_start[j]; e < A.column_start[j + 1]; ++e) {
      const Index i = A.row[e];
      const bool cut = pins && (pinned_[i] || pinned_[j]);
      if (place[i] >= 0 && (i == j || !cut)) row.emplace_back(place[i], cut ? 1.0 : A.value[e]);
    }
    std::sort(row.begin(), row.end());
    for (const auto& [place_of_entry, entry] : row) {
      column.push_back(place_of_entry);
      value.push_back(entry);
    }
    start.push_back(static_cast<PetscInt>(column.size()));
  }
  OwnedMat matrix;
  check(MatCreate(PETSC_COMM_WORLD, matrix.out()));
  check(MatSetSizes(matrix, own_size(), own_size(), size(), size()));
  check(MatSetBlockSize(matrix, 3));
  check(MatSetType(matrix, MATMPIAIJ));
  check(MatMPIAIJSetPreallocationCSR(matrix, start.data(), column.data(), value.data()));
  check(MatSetOption(matrix, MAT_SYMMETRIC, PETSC_TRUE));
  return matrix;
}

OwnedVec DistributedBody::own_coordinates() const {
  OwnedVec all;
  check(VecCreate(PETSC_COMM_WORLD, all.out()));
  check(VecSetSizes(all, own_size(), size()));
  check(VecSetBlockSize(all, 3));
  check(VecSetUp(all));
  PetscScalar* x = nullptr;
  check(VecGetArray(all, &x));
  for (const Index dof : own_dofs_) *x++ = mine_.mesh.nodes[dof / 3][dof % 3];
  check(VecRestoreArray(all, &x));
  return all;
}

Eigen::VectorXd DistributedBody::start_vector(std::uint64_t seed) const {
  Eigen::VectorXd start(own_size());
  for (Eigen::Index i = 0; i < start.size(); ++i) {
    const Index dof = own_dofs_[static_cast<std::size_t>(i)];
    start[i] = scattered(seed, 3 * static_cast<std::uint64_t>(mine_.node_of[dof / 3]) + dof % 3);
  }
  return start;
}

std::vector<double> DistributedBody::gathered(const Eigen::Ref<const Eigen::VectorXd>& x) const {
  const bool is_first = process() == 0;
  const auto own = static_cast<int>(own_size());
  std::vector<int> count(static_cast<std::size_t>(processes())), start(count.size(), 0);
  MPI_Gather(&own, 1, MPI_INT, count.data(), 1, MPI_INT, 0, PETSC_COMM_WORLD);
  std::exclusive_scan(count.begin(), count.end(), start.begin(), 0);
  std::vector<double> by_place(is_first ? static_cast<std::size_t>(size()) : 0);
  MPI_Gatherv(x.data(), own, MPI_DOUBLE, by_place.data(), count.data(), start.data(), MPI_DOUBLE, 0, PETSC_COMM_WORLD);
  std::vector<double> all;
  if (!is_first) return all;
  all.assign(3 * share_.place.size(), 0.0);
  for (std::size_t node = 0; node < share_.place.size(); ++node)
    if (share_.place[node] >= 0)
      std::copy_n(by_place.begin() + 3 * static_cast<std::ptrdiff_t>(share_.place[node]), 3,
                  all.begin() + 3 * static_cast<std::ptrdiff_t>(node));
  return all;
}

}  // namespace limber::internal
