#include <string>

#include "eigen/cholesky_solver.h"
#include "eigen/eigen_body.h"
#include "eigen/join_slices.h"
#include "eigen/stored_body.h"
#include "limber/precompute/spectrum_slice.h"

namespace limber {
namespace {

template <class T>
void append(const T* values, std::size_t count, std::string& bytes) {
  bytes.append(reinterpret_cast<const char*>(values), count * sizeof(T));
}

void append_arrays(const internal::EigenBody& body, const TetMesh& mesh, std::string& bytes) {
  append(body.fixed_nodes.data(), body.fixed_nodes.size(), bytes);
  for (const Vec3& x : mesh.nodes) append(x.data(), 3, bytes);
  const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> motions = body.problem.N;
  append(motions.data(), static_cast<std::size_t>(motions.size()), bytes);
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    const TetNodes nodes(mesh, t);
    append(nodes.begin(), nodes.size(), bytes);
    append(&mesh.tet_region[t], 1, bytes);
  }
  const std::vector<Index> order = internal::order_nodes(body.problem.K);
  append(order.data(), order.size(), bytes);
}

}  // namespace

std::string eigenproblem_bytes(std::span<const EigenproblemInput> inputs, MassKind mass, Jobs& jobs) {
  std::vector<internal::StoredBody> heads;
  std::string arrays;
  for (const EigenproblemInput& input : inputs) {
    const TetMesh& mesh = *input.mesh;
    const internal::EigenBody body = internal::make_eigen_body(mesh, input.materials, input.fixed_nodes, mass, jobs);
    heads.push_back({.problem = internal::fingerprint(body),
                     .nodes = static_cast<Index>(mesh.nodes.size()),
                     .tets = static_cast<Index>(mesh.tets.size()),
                     .fixed = static_cast<Index>(body.fixed_nodes.size()),
                     .nodes_per_tet = mesh.has_mid_edge_nodes() ? 10 : 4,
                     .mass = mass,
                     .stiffness_unit = body.stiffness_unit,
                     .mass_unit = body.mass_unit,
                     .zero_modes = static_cast<int>(body.problem.N.cols()),
                     .pins = internal::choose_pins(body.problem.N),
                     .materials = {input.materials.begin(), input.materials.end()}});
    append_arrays(body, mesh, arrays);
  }
  return internal::stored_bodies_line(heads, arrays) + arrays;
}

}  // namespace limber
