#include "solver/pose_energy.h"

#include <Eigen/Eigenvalues>

namespace limber::internal {

std::vector<Mat3> rotations_of(const BodyPoses& poses) {
  std::vector<Mat3> out;
  out.reserve(poses.size());
  for (const RigidTransform& X : poses) out.push_back(to_matrix(X.q));
  return out;
}

double strain_energy(const PoseStructure& structure, const BodyPoses& poses, const std::vector<Mat3>& R) {
  double twice = 0.0;
  for (const StrainLink& link : structure.links) {
    const auto a = static_cast<std::size_t>(link.a), b = static_cast<std::size_t>(link.b);
    const Vec3 gap = poses[a].p + R[a] * link.arm_a - poses[b].p - R[b] * link.arm_b;
    twice += link.weight * gap.squaredNorm() + ((R[a] - R[b]) * link.spread).squaredNorm();
  }
  return 0.5 * twice;
}

double handle_energy(const std::vector<HandleTerm>& handles, const BodyPoses& poses, const std::vector<Mat3>& R) {
  double out = 0.0;
  for (const HandleTerm& h : handles) {
    const auto b = static_cast<std::size_t>(h.body);
    out += 0.5 * h.weight * (poses[b].p + R[b] * h.arm - h.target).squaredNorm();
  }
  return out;
}

BodyLoads loads(const PoseStructure& structure, const std::vector<HandleTerm>& handles, const BodyPoses& poses,
                const std::vector<Mat3>& R) {
  BodyLoads out{std::vector<Twist>(poses.size(), Twist::Zero()), std::vector<Mat3>(poses.size(), Mat3::Zero())};
  const auto add = [&](std::size_t body, const Vec3& arm, const Vec3& force) {
    const Vec3 own = R[body].transpose() * force;
    out.gradient[body].head<3>() += arm.cross(own);
    out.gradient[body].tail<3>() += own;
    out.moments[body] += arm * own.transpose();
  };
  for (const StrainLink& link : structure.links) {
    const auto a = static_cast<std::size_t>(link.a), b = static_cast<std::size_t>(link.b);
    const Vec3 force = link.weight * (poses[a].p + R[a] * link.arm_a - poses[b].p - R[b] * link.arm_b);
    add(a, link.arm_a, force);
    add(b, link.arm_b, -force);
    // The spread is pairs of opposite forces: M = L (R_aᵀ (R_a − R_b) L)ᵀ and its axial vector.
    const Mat3 D = R[a] - R[b], second = link.spread * link.spread.transpose();
    const auto add_couple = [&](std::size_t body, const Mat3& moment) {
      out.moments[body] += moment;
      out.gradient[body].head<3>() +=
          Vec3(moment(1, 2) - moment(2, 1), moment(2, 0) - moment(0, 2), moment(0, 1) - moment(1, 0));
    };
    add_couple(a, second * D.transpose() * R[a]);
    add_couple(b, -second * D.transpose() * R[b]);
  }
  for (const HandleTerm& h : handles) {
    const auto b = static_cast<std::size_t>(h.body);
    add(b, h.arm, h.weight * (poses[b].p + R[b] * h.arm - h.target));
  }
  return out;
}

Mat3 positive_part(const Mat3& symmetric) {
  Eigen::SelfAdjointEigenSolver<Mat3> split;
  split.computeDirect(symmetric);
  if (split.eigenvalues()[0] >= 0.0) return symmetric;
  return split.eigenvectors() * split.eigenvalues().cwiseMax(0.0).asDiagonal() * split.eigenvectors().transpose();
}

}  // namespace limber::internal
