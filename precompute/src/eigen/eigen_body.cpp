#include "eigen/eigen_body.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include "eigen/canonical_modes.h"
#include "eigen/sparse_operations.h"
#include "limber/core/error.h"

namespace limber::internal {
namespace {

std::vector<Index> checked_fixed_nodes(const TetMesh& mesh, std::span<const Index> fixed_nodes) {
  std::vector<Index> fixed(fixed_nodes.begin(), fixed_nodes.end());
  std::sort(fixed.begin(), fixed.end());
  fixed.erase(std::unique(fixed.begin(), fixed.end()), fixed.end());
  if (!fixed.empty() && (fixed.front() < 0 || static_cast<std::size_t>(fixed.back()) >= mesh.nodes.size()))
    throw InvalidArgument("analyse_modes: fixed node " +
                          std::to_string(fixed.front() < 0 ? fixed.front() : fixed.back()) + ", expected 0 to " +
                          std::to_string(mesh.nodes.size() - 1));
  return fixed;
}

void check_body(const TetMesh& mesh) {
  if (mesh.tets.empty()) throw InvalidArgument("analyse_modes: the mesh has no tetrahedra");
  std::vector<bool> used(mesh.nodes.size(), false);
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    for (const Index node : TetNodes(mesh, t)) used[node] = true;
  const auto unused = std::find(used.begin(), used.end(), false);
  if (unused != used.end())
    throw InvalidArgument("analyse_modes: no tetrahedron uses node " + std::to_string(unused - used.begin()) +
                          "; extract the body first (extract_component)");
  const auto component = connected_components(mesh);
  const Index bodies = 1 + *std::max_element(component.begin(), component.end());
  if (bodies != 1)
    throw InvalidArgument("analyse_modes: the mesh is " + std::to_string(bodies) +
                          " bodies, expected one; extract them first (extract_component)");
}

/// Divides by a power of two near the mean of the diagonal. @return it
double scale_to_one(SparseMatrix& A) {
  double trace = 0.0;
  for (Index j = 0; j < A.size; ++j)
    for (Index e = A.column_start[j]; e < A.column_start[j + 1]; ++e)
      if (A.row[e] == j) trace += A.value[e];
  const double unit = std::exp2(std::round(std::log2(trace / A.size)));
  for (double& v : A.value) v /= unit;
  return unit;
}

/// K X on the free nodes, in the problem's unit, by way of displacements of all nodes.
Eigen::MatrixXd stiffness_times(const TetMesh& mesh, std::span<const Material> materials,
                                const std::vector<Index>& free_dofs, double unit, const Eigen::MatrixXd& X) {
  Eigen::MatrixXd KX(X.rows(), X.cols());
  Eigen::VectorXd u = Eigen::VectorXd::Zero(3 * static_cast<Eigen::Index>(mesh.nodes.size())), f(u.size());
  for (Eigen::Index c = 0; c < X.cols(); ++c) {
    u(free_dofs) = X.col(c);
    elastic_forces(mesh, materials, {u.data(), u.data() + u.size()}, {f.data(), f.data() + f.size()});
    KX.col(c) = f(free_dofs) / unit;
  }
  return KX;
}

/// Makes NᵀMN = I without mixing a column with later ones, so that the rigid motions stay first. Twice: once leaves an
/// error of round-off times the condition of NᵀMN.
void orthonormalise(ScaledProblem& problem) {
  Eigen::MatrixXd& N = problem.N;
  for (int pass = 0; pass < 2; ++pass) {
    for (auto column : N.colwise()) column /= std::sqrt(column.dot(problem.mass_times(column).col(0)));
    const Eigen::MatrixXd gram = N.transpose() * problem.mass_times(N);
    Eigen::LLT<Eigen::MatrixXd>(gram).matrixU().solveInPlace<Eigen::OnTheRight>(N);
  }
  problem.MN = problem.mass_times(N);
}

}  // namespace

std::vector<Index> dofs_of(const std::vector<Index>& nodes) {
  std::vector<Index> dofs;
  dofs.reserve(3 * nodes.size());
  for (const Index node : nodes)
    for (Index axis = 0; axis < 3; ++axis) dofs.push_back(3 * node + axis);
  return dofs;
}

EigenBody make_eigen_body(const TetMesh& mesh, std::span<const Material> materials, std::span<const Index> fixed_nodes,
                          MassKind mass, Jobs& jobs) {
  check_body(mesh);
  EigenBody body;
  body.fixed_nodes = checked_fixed_nodes(mesh, fixed_nodes);
  std::vector<Index> all(mesh.nodes.size());
  std::iota(all.begin(), all.end(), 0);
  std::set_difference(all.begin(), all.end(), body.fixed_nodes.begin(), body.fixed_nodes.end(),
                      std::back_inserter(body.free_nodes));
  body.null_space = find_null_space(mesh, body.fixed_nodes);
  if (body.free_nodes.empty()) return body;

  const std::vector<Index> free_dofs = dofs_of(body.free_nodes);
  ScaledProblem& p = body.problem;
  p.K = principal_submatrix(assemble_stiffness(mesh, materials, jobs), free_dofs);
  p.node_mass = principal_submatrix(assemble_mass(mesh, materials, mass, jobs), body.free_nodes);
  body.stiffness_unit = scale_to_one(p.K);
  body.mass_unit = scale_to_one(p.node_mass);
  p.stiffness_times = [&mesh, materials, free_dofs, unit = body.stiffness_unit](const Eigen::MatrixXd& X) {
    return stiffness_times(mesh, materials, free_dofs, unit, X);
  };
  p.N = body.null_space.basis(free_dofs, Eigen::all);
  orthonormalise(p);
  make_canonical(p.N.rightCols(body.null_space.mechanisms));
  p.MN = p.mass_times(p.N);
  return body;
}

void append_columns(const EigenBody& body, Index nodes, const Eigen::Ref<const Eigen::MatrixXd>& columns, double unit,
                    std::vector<double>& all) {
  for (Eigen::Index c = 0; c < columns.cols(); ++c) {
    const std::size_t start = all.size();
    all.resize(start + 3 * static_cast<std::size_t>(nodes), 0.0);
    for (std::size_t i = 0; i < body.free_nodes.size(); ++i)
      for (int axis = 0; axis < 3; ++axis) all[start + 3 * body.free_nodes[i] + axis] = unit * columns(3 * i + axis, c);
  }
}

}  // namespace limber::internal
