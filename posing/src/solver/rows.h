// Joints and limits as rows: functions of two bodies' poses with their derivatives.
//
// Bodies move by twists ξ = (ω, v) in their own frames: R ← R exp[ω], p ← p + R v to first order. A joint's relative
// pose in its frame J (axes X, anchor arms s_a, s_b at rest) is
//   Q = Xᵀ R_aᵀ R_b X,   t = Xᵀ R_aᵀ (p_b + R_b s_b − p_a − R_a s_a)
// and each row is a function c(Q, t), so that with D = ∂c/∂Q and τ = ∂c/∂t
//   ∂c/∂ω_a = X Σ_l D_l × Q_l …,  derived in docs/derivations/posing.md.
#pragma once

#include <vector>

#include "structure.h"

namespace limber::internal {

using Twist = Eigen::Matrix<double, 6, 1>;  // ω, v

/// The part of a turn in the second derivative of an energy of points y = p + R s with gradients e:
///   Σ ½ (s eᵀ + e sᵀ) − (s·e) 1, the curvature of the points' arcs: negative where what is turned is pressed.
Mat3 turning_stiffness(const Mat3& moment);

/// Second derivatives by two bodies' twists (ω_a, v_a, ω_b, v_b).
using PairMatrix = Eigen::Matrix<double, 12, 12>;
using PairVector = Eigen::Matrix<double, 12, 1>;

/// One scalar equation between two bodies (b only: a = −1) that is linearised.
struct Row {
  Index a = -1, b = -1;
  Index joint = -1;  // of the structure
  Twist J_a = Twist::Zero(), J_b = Twist::Zero();
  double value = 0.0;
  Vec3 arm_a = Vec3::Zero(), arm_b = Vec3::Zero();  // where its force acts, from the bodies' centres, in their frames
  Mat3 dQ = Mat3::Zero();                           // ∂c/∂Q, ∂c/∂t, in the joint's frame
  Vec3 dt = Vec3::Zero();
  // A row that is curved in Q adds bend · (across · twists)² to its second derivative.
  double bend = 0.0;
  PairVector across = PairVector::Zero();
};

/// A coordinate of a joint, with its limits.
struct CoordinateRow {
  Row row{};
  Interval limit{};
  bool angle = false;  ///< rad; otherwise of the model's size
};

/// Rows that hold a joint, and its freedoms. Lengths are told in units of `size`.
struct JointRows {
  std::vector<Row> constraints{};
  std::vector<CoordinateRow> coordinates{};
};

/// The second derivative of a sum of a joint's rows, of Q and t to second order in the twists. Left out are ½ f·(ω × v)
/// of either body with the force f on it, which add up to nothing where forces balance, and what c itself is curved in
/// Q.
/// @param dQ, dt ∂c/∂Q and ∂c/∂t, of one row or the sum of several
PairMatrix joint_curvature(const PoseStructure& structure, const BodyJoint& joint, const BodyPoses& poses,
                           const Mat3& dQ, const Vec3& dt);

/// @param turn the joint's angle about its axis before, near which the angle is told (it does not jump at ±π)
void append_joint_rows(const PoseStructure& structure, const BodyJoint& joint, const BodyPoses& poses, double turn,
                       JointRows& out);

/// The angle about the axis that turns (x; planar: z), told near `near`; 0 for types without.
double joint_turn(const PoseStructure& structure, const BodyJoint& joint, const BodyPoses& poses, double near);

/// All coordinates of a joint, rotation before translations, in rad and the model's unit; a ball: its cone angle.
std::vector<double> joint_coordinates(const PoseStructure& structure, const BodyJoint& joint, const BodyPoses& poses,
                                      double turn);

/// A body's pose moved by a twist in its own frame: along the screw, so that bodies that move by the same twist in the
/// world stay in place relative to each other.
RigidTransform moved(const RigidTransform& X, const Twist& twist);

}  // namespace limber::internal
