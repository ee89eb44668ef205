#include <Eigen/QR>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "limber/articulation/detect_joints.h"
#include "limber/core/disjoint_sets.h"
#include "limber/core/error.h"
#include "tuning.h"
#include "types/bridges.h"
#include "types/couplings.h"

namespace limber {
namespace {

using Row = Eigen::Matrix<double, 6, 1>;
using Rows = Eigen::Matrix<double, Eigen::Dynamic, 6>;

/// How a component's motion is written: (length · ω, velocity of the centre). A length and a centre of its own keep
/// small parts of a large assembly well scaled.
struct OwnMotion {
  Vec3 centre = Vec3::Zero();
  double length = 1.0;
};

/// axis · ω
Row turn_row(const Vec3& axis, const OwnMotion& own) {
  Row row;
  row << axis / own.length, Vec3::Zero();
  return row;
}

/// axis · (v + ω × origin), of the point at the joint's origin.
Row shift_row(const Vec3& axis, const JointSpec& joint, const OwnMotion& own) {
  Row row;
  row << ((joint.frame.origin - own.centre) / own.length).cross(axis), axis;
  return row;
}

/// Centres are the means of the origins of a component's joints.
std::vector<OwnMotion> own_motions(const Assembly& assembly, const std::vector<DetectedJoint>& joints) {
  std::vector<OwnMotion> out(assembly.components.size());
  std::vector<double> joints_at(out.size(), 0.0);
  for (std::size_t c = 0; c < out.size(); ++c)
    if (assembly.components[c].diagonal > 0.0) out[c].length = assembly.components[c].diagonal;
  for (const DetectedJoint& j : joints)
    for (const Index part : {j.a, j.b}) {
      const auto c = static_cast<std::size_t>(part);
      out[c].centre += (j.joint.frame.origin - out[c].centre) / ++joints_at[c];
    }
  return out;
}

/// The rows that a joint gives to the motion of one of its components: r_b·ξ_b = r_a·ξ_a for what the joint holds.
/// @param row_length by which rows without a length are multiplied
Rows held_motions(const JointSpec& joint, const OwnMotion& own, double row_length) {
  const Mat3& axes = joint.frame.axes;
  std::vector<Row> rows;
  const auto no_turn = [&](int axis) { rows.push_back(row_length * turn_row(axes.col(axis), own)); };
  const auto no_shift = [&](int axis) { rows.push_back(shift_row(axes.col(axis), joint, own)); };
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
    rows.back() -= joint.pitch * turn_row(axes.col(0), own);
  }
  Rows out(rows.size(), 6);
  for (std::size_t i = 0; i < rows.size(); ++i) out.row(static_cast<Eigen::Index>(i)) = rows[i];
  return out;
}

/// A component's part of the speed of an axis.
Row axis_row(const JointSpec& joint, bool turns, const OwnMotion& own) {
  const Vec3 axis = joint.frame.axes.col(0);
  return turns ? turn_row(axis, own) : shift_row(axis, joint, own);
}

Index freedom_count(const JointSpec& joint) { return freedoms(joint.type).count() - (joint.pitch != 0.0 ? 1 : 0); }

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

/// Components that joints and couplings hold together know nothing of others: each set has rows and columns of its own.
class ConstraintRank {
 public:
  ConstraintRank(const Assembly& assembly, const std::vector<DetectedJoint>& joints,
                 std::span<const JointCoupling> couplings)
      : joints_(joints), couplings_(couplings), sets_(assembly.components.size()), own_(own_motions(assembly, joints)) {
    for (const DetectedJoint& j : joints) sets_.join(j.a, j.b);
    for (const JointCoupling& c : couplings) sets_.join(joints[c.first.joint].a, joints[c.second.joint].a);
    std::vector<Index> columns(own_.size(), 0);
    for (std::size_t c = 0; c < own_.size(); ++c) column_.push_back(6 * columns[root(static_cast<Index>(c))]++);
    sets_of_rows_.resize(own_.size());
    for (std::size_t c = 0; c < own_.size(); ++c) sets_of_rows_[c].columns = 6 * columns[c];
  }

  Index rank() {
    for (const DetectedJoint& j : joints_) add(j);
    for (const JointCoupling& c : couplings_) add(c);
    Index rank = 0;
    for (const SetOfRows& set : sets_of_rows_) {
      if (set.rows == 0) continue;
      Eigen::SparseMatrix<double> A(set.rows, set.columns);
      A.setFromTriplets(set.entries.begin(), set.entries.end());
      rank += rank_of(A);
    }
    return rank;
  }

 private:
  struct SetOfRows {
    std::vector<Eigen::Triplet<double>> entries;
    Index rows = 0, columns = 0;
  };
  OwnMotion& own(Index c) { return own_[static_cast<std::size_t>(c)]; }
  std::size_t root(Index c) { return static_cast<std::size_t>(sets_.root(c)); }

  /// Entries of a component in the last row of its set.
  void put(SetOfRows& set, Index component, const Row& row) {
    for (Index k = 0; k < 6; ++k)
      set.entries.emplace_back(set.rows - 1, column_[static_cast<std::size_t>(component)] + k, row[k]);
  }

  void add(const DetectedJoint& j) {
    const double row_length = std::sqrt(own(j.a).length * own(j.b).length);
    const Rows of_a = held_motions(j.joint, own(j.a), row_length), of_b = held_motions(j.joint, own(j.b), row_length);
    SetOfRows& set = sets_of_rows_[root(j.a)];
    for (Eigen::Index r = 0; r < of_b.rows(); ++r) {
      ++set.rows;
      put(set, j.b, of_b.row(r));
      put(set, j.a, -of_a.row(r));
    }
  }

  Row row(const JointAxis& axis, Index component) {
    return axis_row(joints_[axis.joint].joint, axis.turns, own(component));
  }

  /// The second axis' speed is the ratio times the first's; the row has the norm 1.
  void add(const JointCoupling& c) {
    SetOfRows& set = sets_of_rows_[root(joints_[c.first.joint].a)];
    ++set.rows;
    const std::pair<JointAxis, double> sides[] = {{c.second, 1.0}, {c.first, -c.ratio}};
    double square = 0.0;
    for (const auto& side : sides)
      for (const Index part : {joints_[side.first.joint].a, joints_[side.first.joint].b})
        square += (side.second * row(side.first, part)).squaredNorm();
    const double scale = 1.0 / std::sqrt(square);
    for (const auto& side : sides) {
      const DetectedJoint& j = joints_[side.first.joint];
      put(set, j.b, scale * side.second * row(side.first, j.b));
      put(set, j.a, -scale * side.second * row(side.first, j.a));
    }
  }

  const std::vector<DetectedJoint>& joints_;
  std::span<const JointCoupling> couplings_;
  DisjointSets sets_;
  std::vector<OwnMotion> own_;           ///< per component
  std::vector<Index> column_;            ///< per component, in its set
  std::vector<SetOfRows> sets_of_rows_;  ///< at the root of each set
};

/// Joints that closed chains hold besides, those of chains that share parts together.
std::vector<std::vector<std::size_t>> closed_chains(Index components, const std::vector<DetectedJoint>& joints) {
  std::vector<std::pair<Index, Index>> edges;
  for (const DetectedJoint& j : joints) edges.emplace_back(j.a, j.b);
  const std::vector<bool> is_bridge = internal::find_bridges(components, edges);
  DisjointSets sets(static_cast<std::size_t>(components));
  for (std::size_t j = 0; j < joints.size(); ++j)
    if (!is_bridge[j]) sets.join(joints[j].a, joints[j].b);
  std::map<Index, std::vector<std::size_t>> chains;
  for (std::size_t j = 0; j < joints.size(); ++j)
    if (!is_bridge[j]) chains[sets.root(joints[j].a)].push_back(j);
  std::vector<std::vector<std::size_t>> out;
  for (auto& [root, chain] : chains) out.push_back(std::move(chain));
  return out;
}

/// A basis, in columns.
Eigen::MatrixXd null_space(Eigen::MatrixXd A) {
  Eigen::VectorXd scale = A.colwise().norm();
  for (double& s : scale) s = s > 0.0 ? 1.0 / s : 1.0;
  A = A * scale.asDiagonal();
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr;
  qr.setThreshold(internal::tuning().types.frames.independent);
  qr.compute(A);
  const Eigen::Index rank = qr.rank(), free = A.cols() - rank;
  Eigen::MatrixXd basis(A.cols(), free);
  basis.topRows(rank) = -qr.matrixR()
                             .topLeftCorner(rank, rank)
                             .triangularView<Eigen::Upper>()
                             .solve(qr.matrixR().topRightCorner(rank, free));
  basis.bottomRows(free).setIdentity();
  return scale.asDiagonal() * (qr.colsPermutation() * basis);
}

/// The motions of the parts of closed chains.
class ChainMotions {
 public:
  ChainMotions(const std::vector<DetectedJoint>& joints, const std::vector<OwnMotion>& own,
               const std::vector<std::size_t>& chain)
      : joints_(joints), own_(own), chain_(chain) {
    for (const std::size_t j : chain)
      for (const Index part : {joints[j].a, joints[j].b}) column_.try_emplace(part, 6 * std::ssize(column_));
  }

  std::vector<JointCoupling> couplings() {
    if (6 * column_.size() > internal::tuning().types.frames.dense_columns) return {};
    motions_ = null_space(constraints());
    std::vector<std::pair<JointAxis, Eigen::RowVectorXd>> axes;
    double fastest = 0.0;
    for (const std::size_t j : chain_)
      for (const bool turns : {true, false})
        if (has_axis(joints_[j].joint, turns)) {
          axes.emplace_back(JointAxis{j, turns}, speeds({j, turns}));
          fastest = std::max(fastest, axes.back().second.norm() * unit({j, turns}));
        }
    const double least = internal::tuning().types.frames.independent;
    std::erase_if(axes, [&](const auto& axis) { return axis.second.norm() * unit(axis.first) <= least * fastest; });
    return along_with_each_other(axes);
  }

 private:
  const OwnMotion& own(Index part) const { return own_[static_cast<std::size_t>(part)]; }

  /// A length, by which turns are compared with slides.
  double unit(const JointAxis& axis) const {
    const DetectedJoint& j = joints_[axis.joint];
    return axis.turns ? std::sqrt(own(j.a).length * own(j.b).length) : 1.0;
  }

  Eigen::MatrixXd constraints() const {
    std::vector<Eigen::RowVectorXd> rows;
    for (const std::size_t at : chain_) {
      const DetectedJoint& j = joints_[at];
      const double row_length = unit({at, true});
      const Rows of_a = held_motions(j.joint, own(j.a), row_length), of_b = held_motions(j.joint, own(j.b), row_length);
      for (Eigen::Index r = 0; r < of_b.rows(); ++r) {
        rows.emplace_back(Eigen::RowVectorXd::Zero(6 * std::ssize(column_)));
        rows.back().segment<6>(column_.at(j.b)) += of_b.row(r);
        rows.back().segment<6>(column_.at(j.a)) -= of_a.row(r);
      }
    }
    Eigen::MatrixXd out(std::ssize(rows), 6 * std::ssize(column_));
    for (std::size_t r = 0; r < rows.size(); ++r) out.row(static_cast<Eigen::Index>(r)) = rows[r];
    return out;
  }

  /// Of an axis in each motion.
  Eigen::RowVectorXd speeds(const JointAxis& axis) const {
    const DetectedJoint& j = joints_[axis.joint];
    return axis_row(j.joint, axis.turns, own(j.b)).transpose() * motions_.middleRows<6>(column_.at(j.b)) -
           axis_row(j.joint, axis.turns, own(j.a)).transpose() * motions_.middleRows<6>(column_.at(j.a));
  }

  /// Axes whose speeds are the same but for a factor in all motions.
  static std::vector<JointCoupling> along_with_each_other(
      const std::vector<std::pair<JointAxis, Eigen::RowVectorXd>>& axes) {
    const double same = internal::tuning().types.frames.independent;
    std::vector<JointCoupling> out;
    std::vector<std::size_t> leaders;
    for (std::size_t i = 0; i < axes.size(); ++i) {
      const auto ratio = [&](std::size_t leader) {
        return axes[i].second.dot(axes[leader].second) / axes[leader].second.squaredNorm();
      };
      const auto leader = std::find_if(leaders.begin(), leaders.end(), [&](std::size_t l) {
        return (axes[i].second - ratio(l) * axes[l].second).norm() <= same * axes[i].second.norm();
      });
      if (leader == leaders.end())
        leaders.push_back(i);
      else
        out.push_back({axes[*leader].first, axes[i].first, ratio(*leader), false});
    }
    return out;
  }

  const std::vector<DetectedJoint>& joints_;
  const std::vector<OwnMotion>& own_;
  const std::vector<std::size_t>& chain_;
  std::map<Index, Eigen::Index> column_;  ///< per part
  Eigen::MatrixXd motions_;               ///< in columns
};

}  // namespace

std::vector<JointCoupling> chain_couplings(const Assembly& assembly, const std::vector<DetectedJoint>& joints) {
  const std::vector<OwnMotion> own = own_motions(assembly, joints);
  std::vector<JointCoupling> out;
  for (const auto& chain : closed_chains(static_cast<Index>(assembly.components.size()), joints))
    for (const JointCoupling& c : ChainMotions(joints, own, chain).couplings()) out.push_back(c);
  return out;
}

bool has_axis(const JointSpec& joint, bool turns) {
  const bool cylindrical = joint.type == JointType::kCylindrical;
  if (turns) return cylindrical || joint.type == JointType::kRevolute;
  return (cylindrical && joint.pitch == 0.0) || joint.type == JointType::kPrismatic;
}

namespace internal {

void check_couplings(const std::vector<DetectedJoint>& joints, std::span<const JointCoupling> couplings) {
  for (const JointCoupling& c : couplings)
    for (const JointAxis& axis : {c.first, c.second})
      if (axis.joint >= joints.size() || !has_axis(joints[axis.joint].joint, axis.turns))
        throw InvalidArgument("JointCoupling: joint " + std::to_string(axis.joint) + " of " +
                              std::to_string(joints.size()) + " does not " +
                              (axis.turns ? "turn about" : "slide along") + " x by itself");
}

}  // namespace internal

Kinematics overall_kinematics(const Assembly& assembly, const std::vector<DetectedJoint>& joints,
                              std::span<const JointCoupling> couplings) {
  internal::check_couplings(joints, couplings);
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
  out.kutzbach = freedom_sum - 6 * out.loops - static_cast<Index>(couplings.size());
  out.mobility = 6 * (count - out.groups) - ConstraintRank(assembly, joints, couplings).rank();
  return out;
}

}  // namespace limber
