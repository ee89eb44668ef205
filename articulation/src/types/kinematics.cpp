#include <Eigen/QR>
#include <Eigen/SparseCholesky>
#include <cmath>
#include <vector>

#include "limber/articulation/detect_joints.h"
#include "limber/core/disjoint_sets.h"
#include "tuning.h"

namespace limber {
namespace {

using Rows = Eigen::Matrix<double, Eigen::Dynamic, 6>;

/// How a component's motion is written: (length · ω, velocity of the centre). A length and a centre of its own keep
/// small parts of a large assembly well scaled.
struct OwnMotion {
  Vec3 centre = Vec3::Zero();
  double length = 1.0;
};

/// The rows that a joint gives to the motion of one of its components: r_b·ξ_b = r_a·ξ_a for what the joint holds.
/// @param row_length by which rows without a length are multiplied
Rows held_motions(const JointSpec& joint, const OwnMotion& own, double row_length) {
  const Mat3& axes = joint.frame.axes;
  const Vec3 origin = (joint.frame.origin - own.centre) / own.length;
  std::vector<Eigen::Matrix<double, 6, 1>> rows;
  const auto no_turn = [&](int axis) {
    rows.emplace_back();
    rows.back() << row_length / own.length * axes.col(axis), Vec3::Zero();
  };
  const auto no_shift = [&](int axis) {  // axis · (v + ω × origin)
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
    rows.back().head<3>() -= joint.pitch / own.length * axes.col(0);
  }
  Rows out(rows.size(), 6);
  for (std::size_t i = 0; i < rows.size(); ++i) out.row(static_cast<Eigen::Index>(i)) = rows[i];
  return out;
}

Index freedom_count(const JointSpec& joint) {
  const JointFreedoms free = freedoms(joint.type);
  return free.rotations + free.translations - (joint.pitch != 0.0 ? 1 : 0);
}

/// The rank, columns of one norm. Few columns take a pivoted QR; many take the pivots of AᵀA = L D Lᵀ in an order of
/// little fill-in: without pivoting these are the squares of QR's, and a little on the diagonal keeps dependent columns
/// from dividing by 0.
Index rank_of(Eigen::SparseMatrix<double> A) {
  const internal::TypesTuning& t = internal::tuning().types;
  for (Eigen::Index c = 0; c < A.cols(); ++c)
    if (const double norm = A.col(c).norm(); norm > 0.0) A.col(c) *= 1.0 / norm;
  if (A.cols() <= static_cast<Eigen::Index>(t.frames.dense_columns)) {
    Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr{Eigen::MatrixXd(A)};
    qr.setThreshold(t.frames.independent);
    return static_cast<Index>(qr.rank());
  }
  constexpr double kKeepAway = 1e-12;  // above the round-off of AᵀA
  Eigen::SparseMatrix<double> normal = A.transpose() * A, unit(A.cols(), A.cols());
  unit.setIdentity();
  normal += kKeepAway * unit;
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor(normal);
  return static_cast<Index>((factor.vectorD().array() > t.frames.independent * t.frames.independent).count());
}

}  // namespace

Kinematics overall_kinematics(const Assembly& assembly, const std::vector<DetectedJoint>& joints) {
  const auto count = static_cast<Index>(assembly.components.size());
  Kinematics out;
  DisjointSets sets(static_cast<std::size_t>(count));
  Index freedom_sum = 0;
  for (const DetectedJoint& j : joints) {
    sets.join(j.a, j.b);
    freedom_sum += freedom_count(j.joint);
  }
  for (Index c = 0; c < count; ++c)
    if (sets.root(c) == c) ++out.groups;
  out.loops = static_cast<Index>(joints.size()) - count + out.groups;
  out.kutzbach = freedom_sum - 6 * out.loops;

  std::vector<OwnMotion> own(static_cast<std::size_t>(count));
  std::vector<double> joints_at(static_cast<std::size_t>(count), 0.0);
  for (std::size_t c = 0; c < own.size(); ++c)
    if (assembly.components[c].diagonal > 0.0) own[c].length = assembly.components[c].diagonal;
  for (const DetectedJoint& j : joints)
    for (const auto c : {static_cast<std::size_t>(j.a), static_cast<std::size_t>(j.b)})
      own[c].centre += (j.joint.frame.origin - own[c].centre) / ++joints_at[c];  // running mean
  // Groups know nothing of each other: each has rows and columns of its own.
  std::vector<Index> place(static_cast<std::size_t>(count), -1), columns(static_cast<std::size_t>(count), 0);
  for (Index c = 0; c < count; ++c)
    place[static_cast<std::size_t>(c)] = columns[static_cast<std::size_t>(sets.root(c))]++;
  std::vector<std::vector<const DetectedJoint*>> of_group(static_cast<std::size_t>(count));
  for (const DetectedJoint& j : joints) of_group[static_cast<std::size_t>(sets.root(j.a))].push_back(&j);
  Index rank = 0;
  for (std::size_t g = 0; g < of_group.size(); ++g) {
    std::vector<Eigen::Triplet<double>> entries;
    Index row = 0;
    for (const DetectedJoint* j : of_group[g]) {
      const auto a = static_cast<std::size_t>(j->a), b = static_cast<std::size_t>(j->b);
      const double row_length = std::sqrt(own[a].length * own[b].length);
      const Rows of_a = held_motions(j->joint, own[a], row_length), of_b = held_motions(j->joint, own[b], row_length);
      for (Index r = 0; r < static_cast<Index>(of_b.rows()); ++r, ++row)
        for (Index k = 0; k < 6; ++k) {
          entries.emplace_back(row, 6 * place[b] + k, of_b(r, k));
          entries.emplace_back(row, 6 * place[a] + k, -of_a(r, k));
        }
    }
    if (row == 0) continue;
    Eigen::SparseMatrix<double> A(row, 6 * columns[g]);
    A.setFromTriplets(entries.begin(), entries.end());
    rank += rank_of(A);
  }
  out.mobility = 6 * (count - out.groups) - rank;
  return out;
}

}  // namespace limber
