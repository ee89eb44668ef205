// Poses that go over to other cells.
#pragma once

#include <span>

#include "solver/pose_solver.h"

namespace limber::internal {

/// The cell of a part whose box is nearest to a point at rest; of equal ones the first. @pre the part has a cell
const PlacedCell& cell_nearest(const PoseStructure& structure, Index part, const Vec3& p);

/// Best places of new bodies: each takes the motion of the old cells that lie where its own are, exactly if they move
/// as one, else nearest in the mean square of their corners. Joints keep their turns. @param was per new part the old
/// one
Pose transferred(const PoseStructure& from, const Pose& pose, const PoseStructure& to, std::span<const Index> was);

/// The rotation that is nearest to a matrix: U diag(1, 1, det UVᵀ) Vᵀ of its singular value decomposition.
Mat3 nearest_rotation(const Mat3& m);

inline const Triangle& surface_triangle(const JointedModel& model, Index t) {
  return model.surface.triangles[static_cast<std::size_t>(t)];
}

}  // namespace limber::internal
