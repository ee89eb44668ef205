// The fixed structure while handles are dragged: cells, the bodies that move as one, the strain links between them, and
// the joints that hold bodies.
#pragma once

#include <vector>

#include "limber/core/rigid_transform.h"
#include "limber/posing/cells.h"
#include "limber/posing/jointed_model.h"
#include "limber/posing/posing_options.h"

namespace limber::internal {

/// One or more cells that share a transformation: a rigid part, a joint's region of influence, a cell.
struct PoseBody {
  Vec3 centre = Vec3::Zero();   ///< of its cells' volume, at rest
  double volume = 0.0;          ///< of its cells
  double radius_squared = 0.0;  ///< mean |s|² of its cells' volume about the centre
  bool pinned = false;
};

/// The strain energy between two bodies, ½ Σ_q w_q |T_a x_q − T_b x_q|² over points x_q of what they share. With the
/// mean x̄ of the points and spread Σ w (x − x̄)(x − x̄)ᵀ = L Lᵀ it is, exactly,
///   ½ weight |T_a x̄ − T_b x̄|² + ½ Σ_k |(R_a − R_b) L_k|²
struct StrainLink {
  Index a = 0, b = 0;                               // bodies, a < b
  double weight = 0.0;                              // Σ w_q
  Vec3 arm_a = Vec3::Zero(), arm_b = Vec3::Zero();  // x̄ from either centre, at rest
  Mat3 spread = Mat3::Zero();                       // columns L_k
};

struct BodyJoint {
  Index a = 0, b = 0;     // bodies, different
  Index model_joint = 0;  // of JointedModel::joints
  Index part_a = 0;
  JointSpec joint{};
};

struct PlacedCell {
  Index grid = 0;  // of PoseStructure::grids
  Cell cell{};
  Index part = 0, body = 0;
};

struct PoseStructure {
  std::vector<CellGrid> grids;       // one per group
  std::vector<Index> group_of_part;  // parts that share vertices
  std::vector<PlacedCell> cells;     // of all grids, one grid after another
  std::vector<PoseBody> bodies;      // in the order of their first cells
  std::vector<StrainLink> links;     // ascending by (a, b)
  std::vector<BodyJoint> joints;     // without those that became one body
  double size = 0.0;                 // diagonal of the model's bounding box
};

/// @param options, pinned one per part. @pre model.validate() holds. @throws InvalidArgument
PoseStructure build_structure(const JointedModel& model, const std::vector<PartOptions>& options,
                              const std::vector<bool>& pinned, StrainWeights weights);

/// Place of a body: the place of its centre, and its turn from rest.
using BodyPoses = std::vector<RigidTransform>;

/// All bodies at rest.
BodyPoses rest_poses(const PoseStructure& structure);

}  // namespace limber::internal
