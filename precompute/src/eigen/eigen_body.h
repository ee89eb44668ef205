/// @file eigen_body.h
/// One connected body as the eigensolvers see it: K and M of its free nodes, and the motions that deform nothing.
#pragma once

#include <span>
#include <vector>

#include "eigen/elastic_inverse.h"
#include "eigen/null_space.h"
#include "limber/core/jobs.h"
#include "limber/mesh/tet_mesh.h"
#include "limber/model/material.h"
#include "limber/precompute/fem.h"

namespace limber::internal {

/// The body after fixing, in units that make it dimensionless.
struct EigenBody {
  std::vector<Index> fixed_nodes, free_nodes;  // ascending
  NullSpace null_space;                        // on all nodes
  ScaledProblem problem;                       // on the free nodes
  double stiffness_unit = 1.0;                 // N/m, a power of two: scaling by it does not round
  double mass_unit = 1.0;                      // kg, a power of two

  /// Of an eigenvalue in these units, in rad²/s².
  double eigenvalue_unit() const { return stiffness_unit / mass_unit; }
};

/// @param mesh, materials must outlive the body. @throws InvalidArgument unless the mesh is one body
EigenBody make_eigen_body(const TetMesh& mesh, std::span<const Material> materials, std::span<const Index> fixed_nodes,
                          MassKind mass, Jobs& jobs);

/// The three degrees of freedom of each node, in order.
std::vector<Index> dofs_of(const std::vector<Index>& nodes);

/// Writes columns over the free nodes, times a unit, behind what `all` holds, with zeros at the fixed nodes.
void append_columns(const EigenBody& body, Index nodes, const Eigen::Ref<const Eigen::MatrixXd>& columns, double unit,
                    std::vector<double>& all);

}  // namespace limber::internal
