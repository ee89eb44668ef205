/// @file null_space.h
/// The motions that deform nothing, from geometry alone.
///
/// A linear tet's energy vanishes only if it moves rigidly, u(x) = t + r × x. Two tets that share a face share three
/// points that are not in line, so they share t and r: face-connected tets form rigid *parts* with six unknowns each.
/// Parts that meet at lone nodes or edges must agree there, and nothing moves at fixed nodes. The null space of these
/// equations is that of K, exactly: rigid motions and mechanisms (hinges, ball joints) alike.
#pragma once

#include <Eigen/Core>
#include <span>

#include "limber/mesh/tet_mesh.h"
#include "limber/model/modal_model.h"

namespace limber::internal {

/// Rigid motions of the whole body that fixed nodes leave.
struct RigidFreedom {
  FrameMotion motion = FrameMotion::kFree;
  Vec3 pivot = Vec3::Zero();       ///< kPoint, kLine: a fixed node's place
  Vec3 line_axis = Vec3::UnitX();  ///< kLine
  int dimension() const;           ///< 6, 3, 1, 0
};
/// Nodes count as coincident or in line within 1e-9 of the body's size.
RigidFreedom rigid_freedom(const TetMesh& mesh, std::span<const Index> fixed_nodes);

struct NullSpace {
  RigidFreedom rigid;
  int mechanisms = 0;     ///< motions besides the rigid ones
  Eigen::MatrixXd basis;  ///< 3n × (rigid + mechanisms): rigid motions first, then mechanisms
  /// Smallest pivot that was counted as a constraint, relative to the largest; 1 where there is none. Below about 1e-6
  /// the body is nearly a mechanism.
  double weakest_constraint = 1.0;
};

/// Not yet orthonormal. @throws ComputationError if more than 300 parts hang together only by nodes and edges
NullSpace find_null_space(const TetMesh& mesh, std::span<const Index> fixed_nodes);

}  // namespace limber::internal
