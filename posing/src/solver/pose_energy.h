// The energy of a pose and its derivatives.
#pragma once

#include <vector>

#include "solver/rows.h"

namespace limber::internal {

/// A point of a body that is drawn to a place: ½ weight |R s + p − target|².
struct HandleTerm {
  Index body = 0;
  Vec3 arm = Vec3::Zero();  // s: from the body's centre, at rest
  Vec3 target = Vec3::Zero();
  double weight = 0.0;
};

std::vector<Mat3> rotations_of(const BodyPoses& poses);

double strain_energy(const PoseStructure& structure, const BodyPoses& poses, const std::vector<Mat3>& R);
double handle_energy(const std::vector<HandleTerm>& handles, const BodyPoses& poses, const std::vector<Mat3>& R);

/// First derivatives of the energy by body, in its own frame.
struct BodyLoads {
  std::vector<Twist> gradient{};
  std::vector<Mat3> moments{};  ///< Σ arm · forceᵀ over the points on which forces act
};
BodyLoads loads(const PoseStructure& structure, const std::vector<HandleTerm>& handles, const BodyPoses& poses,
                const std::vector<Mat3>& R);

Mat3 positive_part(const Mat3& symmetric);

}  // namespace limber::internal
