#include "skin/tet_fields.h"

#include <cassert>

#include "limber/core/error.h"

namespace limber::internal {
namespace {

using Sparse = Eigen::SparseMatrix<double>;
using Triplet = Eigen::Triplet<double, int>;

/// Rows and columns of A that stay, renumbered by place (−1: goes).
Sparse part_of(const Sparse& A, std::span<const Index> row_place, Index rows, std::span<const Index> column_place,
               Index columns) {
  std::vector<Triplet> entries;
  for (int c = 0; c < A.outerSize(); ++c)
    for (Sparse::InnerIterator it(A, c); it; ++it)
      if (row_place[it.row()] >= 0 && column_place[c] >= 0)
        entries.emplace_back(row_place[it.row()], column_place[c], it.value());
  Sparse part(rows, columns);
  part.setFromTriplets(entries.begin(), entries.end());
  return part;
}

SparseMatrix plain(const Sparse& A) {
  SparseMatrix out;
  out.size = static_cast<Index>(A.rows());
  out.column_start.assign(A.outerIndexPtr(), A.outerIndexPtr() + A.outerSize() + 1);
  out.row.assign(A.innerIndexPtr(), A.innerIndexPtr() + A.nonZeros());
  out.value.assign(A.valuePtr(), A.valuePtr() + A.nonZeros());
  return out;
}

}  // namespace

TetFields::TetFields(const TetMesh& mesh) : node_volume(Eigen::VectorXd::Zero(static_cast<int>(mesh.nodes.size()))) {
  for (const Tet& t : mesh.tets) {
    const Vec3 e1 = mesh.nodes[t[1]] - mesh.nodes[t[0]], e2 = mesh.nodes[t[2]] - mesh.nodes[t[0]],
               e3 = mesh.nodes[t[3]] - mesh.nodes[t[0]];
    const double six_volumes = e1.cross(e2).dot(e3);
    std::array<Vec3, 4> g{Vec3::Zero(), e2.cross(e3) / six_volumes, e3.cross(e1) / six_volumes,
                          e1.cross(e2) / six_volumes};
    g[0] = -(g[1] + g[2] + g[3]);
    gradient.push_back(g);
    volume.push_back(six_volumes / 6.0);
    for (const Index n : t) node_volume[n] += six_volumes / 24.0;
  }
}

Sparse laplacian(const TetMesh& mesh, const TetFields& fields) {
  std::vector<Triplet> entries;
  entries.reserve(16 * mesh.tets.size());
  for (std::size_t e = 0; e < mesh.tets.size(); ++e)
    for (int a = 0; a < 4; ++a)
      for (int b = 0; b < 4; ++b)
        entries.emplace_back(mesh.tets[e][a], mesh.tets[e][b],
                             fields.volume[e] * fields.gradient[e][a].dot(fields.gradient[e][b]));
  const auto nodes = static_cast<int>(mesh.nodes.size());
  Sparse L(nodes, nodes);
  L.setFromTriplets(entries.begin(), entries.end());
  return L;
}

HeldSolver::HeldSolver(const Sparse& A, std::span<const Index> held) : held_(held.begin(), held.end()) {
  const auto size = static_cast<std::size_t>(A.rows());
  std::vector<Index> held_place(size, -1), free_place(size, -1);
  for (std::size_t i = 0; i < held_.size(); ++i) held_place[held_[i]] = static_cast<Index>(i);
  for (std::size_t i = 0; i < size; ++i) {
    if (held_place[i] >= 0) continue;
    free_place[i] = static_cast<Index>(free_.size());
    free_.push_back(static_cast<Index>(i));
  }
  const auto free = static_cast<Index>(free_.size());
  free_by_held_ = part_of(A, free_place, free, held_place, static_cast<Index>(held_.size()));
  if (free_.empty()) return;
  const SparseMatrix freely = plain(part_of(A, free_place, free, free_place, free));
  solver_.emplace(freely, order_nodes(freely, 1));
  if (!solver_->definite())
    throw ComputationError("skin: the Laplacian of " + std::to_string(free) +
                           " nodes is not positive definite; are there flat tetrahedra?");
}

Eigen::MatrixXd HeldSolver::solve(const Eigen::MatrixXd& B, const Eigen::MatrixXd& given) {
  Eigen::MatrixXd x(B.rows(), B.cols());
  const Eigen::MatrixXd values = given(held_, Eigen::all);
  x(held_, Eigen::all) = values;
  if (solver_) x(free_, Eigen::all) = solver_->solve(B(free_, Eigen::all) - free_by_held_ * values);
  return x;
}

}  // namespace limber::internal
