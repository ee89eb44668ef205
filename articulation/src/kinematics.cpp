#include <Eigen/QR>

#include "limber/articulation/detect_joints.h"
#include "limber/core/disjoint_sets.h"

namespace limber {
namespace {

using Rows = Eigen::Matrix<double, Eigen::Dynamic, 6>;

/// Rows r with r·ξ = 0 for the relative motions ξ = (ω, velocity of the input's origin) that a joint leaves. Lengths in
/// units of `length`, so that rotations and translations weigh alike.
Rows held_motions(const JointSpec& joint, const Vec3& centre, double length) {
  const Mat3& axes = joint.frame.axes;
  const Vec3 origin = (joint.frame.origin - centre) / length;
  std::vector<Eigen::Matrix<double, 6, 1>> rows;
  const auto no_turn = [&](int axis) {
    rows.emplace_back();
    rows.back() << axes.col(axis), Vec3::Zero();
  };
  const auto no_shift = [&](int axis) {  // axis · (v + ω × origin) = 0
    rows.emplace_back();
    rows.back() << origin.cross(axes.col(axis)), axes.col(axis);
  };
  const JointType type = joint.type;
  const bool ball = type == JointType::kBall, planar = type == JointType::kPlanar;
  const bool turns_about_x = ball || type == JointType::kRevolute || type == JointType::kCylindrical;
  const bool slides_along_x = planar || type == JointType::kPrismatic || type == JointType::kCylindrical;
  if (!turns_about_x) no_turn(0);
  if (!ball) no_turn(1);
  if (!ball && !planar) no_turn(2);
  if (!slides_along_x) no_shift(0);
  if (!planar) no_shift(1);
  no_shift(2);
  if (joint.pitch != 0.0) {  // the advance follows the turn
    no_shift(0);
    rows.back().head<3>() -= joint.pitch / length * axes.col(0);
  }
  Rows out(rows.size(), 6);
  for (std::size_t i = 0; i < rows.size(); ++i) out.row(static_cast<Eigen::Index>(i)) = rows[i];
  return out;
}

Index freedom_count(const JointSpec& joint) {
  const JointFreedoms free = freedoms(joint.type);
  return free.rotations + free.translations - (joint.pitch != 0.0 ? 1 : 0);
}

}  // namespace

Kinematics overall_kinematics(const Assembly& assembly, const std::vector<DetectedJoint>& joints) {
  const auto count = static_cast<Index>(assembly.components.size());
  Kinematics out;
  DisjointSets sets(static_cast<std::size_t>(count));
  Index freedom_sum = 0, row_count = 0;
  for (const DetectedJoint& j : joints) {
    sets.join(j.a, j.b);
    freedom_sum += freedom_count(j.joint);
    row_count += 6 - freedom_count(j.joint);
  }
  for (Index c = 0; c < count; ++c)
    if (sets.root(c) == c) ++out.groups;
  out.loops = static_cast<Index>(joints.size()) - count + out.groups;
  out.kutzbach = freedom_sum - 6 * out.loops;

  Eigen::AlignedBox3d box;
  for (const DetectedJoint& j : joints) box.extend(j.joint.frame.origin);
  const Vec3 centre = joints.empty() ? Vec3::Zero() : Vec3(box.center());
  const double length = joints.empty() || box.diagonal().norm() == 0.0 ? 1.0 : box.diagonal().norm();
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(row_count, 6 * count);
  Index row = 0;
  for (const DetectedJoint& j : joints) {
    const Rows held = held_motions(j.joint, centre, length);
    A.block(row, 6 * j.b, held.rows(), 6) = held;
    A.block(row, 6 * j.a, held.rows(), 6) = -held;
    row += static_cast<Index>(held.rows());
  }
  Index rank = 0;
  if (row_count > 0) {
    Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(A);
    // Axes are known to about a degree: what is dependent in the drawing is so to that accuracy only.
    qr.setThreshold(1e-3);
    rank = static_cast<Index>(qr.rank());
  }
  out.mobility = 6 * (count - out.groups) - rank;
  return out;
}

}  // namespace limber
