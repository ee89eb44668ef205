#include "penalty_energy.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace limber::internal {
namespace {

using Derivative3 = Eigen::Matrix<double, 3, 24>;

/// A vector with its derivative.
struct Dual3 {
  Vec3 v = Vec3::Zero();
  Derivative3 d = Derivative3::Zero();
};

Dual3 operator-(const Dual3& x, const Dual3& y) { return {x.v - y.v, x.d - y.d}; }

PairResidual dot(const Dual3& x, const Dual3& y) {
  return {x.v.dot(y.v), x.v.transpose() * y.d + y.v.transpose() * x.d};
}
PairResidual operator-(const PairResidual& x, double y) { return {x.value - y, x.derivative}; }
PairResidual operator*(double f, const PairResidual& x) { return {f * x.value, f * x.derivative}; }
PairResidual operator-(const PairResidual& x, const PairResidual& y) {
  return {x.value - y.value, x.derivative - y.derivative};
}
PairResidual length(const Dual3& x) {
  const double n = x.v.norm();
  return {n, n > 0.0 ? Eigen::Matrix<double, 1, 24>(x.v.transpose() * x.d / n) : Eigen::Matrix<double, 1, 24>::Zero()};
}
PairResidual angle_of(const PairResidual& s, const PairResidual& c) {
  const double n = s.value * s.value + c.value * c.value;
  return {std::atan2(s.value, c.value), (c.value * s.derivative - s.value * c.derivative) / n};
}
PairResidual root_of_squares(const PairResidual& x, const PairResidual& y) {
  const double n = std::hypot(x.value, y.value);
  if (!(n > 0.0)) return {};
  return {n, (x.value * x.derivative + y.value * y.derivative) / n};
}

/// Two bodies and the joint between them, in duals.
class JointEnergy {
 public:
  JointEnergy(const PoseStructure& structure, const BodyJoint& joint, const BodyMap& a, const BodyMap& b,
              const std::array<Vec3, 8>& corners, double turn)
      : joint_(joint), corners_(corners), turn_(turn), size_(structure.size) {
    centre_[0] = structure.bodies[static_cast<std::size_t>(joint.a)].centre;
    centre_[1] = structure.bodies[static_cast<std::size_t>(joint.b)].centre;
    map_ = {a, b};
    const JointFrame& f = joint.joint.frame;
    for (int k = 0; k < 3; ++k) {
      axis_a_[static_cast<std::size_t>(k)] = direction(0, f.axes.col(k));
      axis_b_[static_cast<std::size_t>(k)] = direction(1, f.axes.col(k));
    }
    anchor_ = point(0, f.origin);
  }

  std::vector<PairResidual> residuals() {
    switch (joint_.joint.type) {
      case JointType::kBall:
        each_corner([&](const Vec3& v, const Dual3& r) { add(length(r) - (v - origin()).norm()); });
        break;
      case JointType::kRevolute:
        same_axis(0), same_place(0), same_distance();
        break;
      case JointType::kCylindrical:
        same_axis(0), same_distance();
        if (joint_.joint.pitch != 0.0) add(translation(0) - joint_.joint.pitch * angle(0));
        break;
      case JointType::kPrismatic:
        same_axis(0), same_axis(1), same_axis(2), same_place(1), same_place(2);
        break;
      case JointType::kPlanar:
        same_axis(2), same_place(2);
        break;
      case JointType::kFixed:
        break;
    }
    limits();
    return std::move(out_);
  }

 private:
  const Vec3& origin() const { return joint_.joint.frame.origin; }
  Vec3 axis(int k) const { return joint_.joint.frame.axes.col(k); }

  Dual3 point(int body, const Vec3& x) const {
    const auto i = static_cast<std::size_t>(body);
    const Vec3 s = x - centre_[i];
    Dual3 out{map_[i].A * s + map_[i].p, Derivative3::Zero()};
    for (int k = 0; k < 3; ++k) out.d.block<3, 3>(0, 12 * body + 3 * k) = s[k] * Mat3::Identity();
    out.d.block<3, 3>(0, 12 * body + 9).setIdentity();
    return out;
  }
  /// Unit: A X / |A X|.
  Dual3 direction(int body, const Vec3& x) const {
    const Vec3 v = map_[static_cast<std::size_t>(body)].A * x;
    const double n = v.norm();
    const Vec3 u = v / n;
    const Mat3 across = (Mat3::Identity() - u * u.transpose()) / n;
    Dual3 out{u, Derivative3::Zero()};
    for (int k = 0; k < 3; ++k) out.d.block<3, 3>(0, 12 * body + 3 * k) = x[k] * across;
    return out;
  }

  void add(const PairResidual& r) { out_.push_back(r); }
  template <class Visit>
  void each_corner(Visit&& visit) {
    for (const Vec3& v : corners_) visit(v, point(1, v) - anchor_);
  }

  void same_axis(int k) {
    const Dual3 r = axis_a_[static_cast<std::size_t>(k)] - axis_b_[static_cast<std::size_t>(k)];
    for (int i = 0; i < 3; ++i) add({r.v[i], r.d.row(i)});
  }
  void same_place(int k) {
    each_corner([&](const Vec3& v, const Dual3& r) {
      add(dot(axis_a_[static_cast<std::size_t>(k)], r) - axis(k).dot(v - origin()));
    });
  }
  /// From the axis x.
  void same_distance() {
    each_corner([&](const Vec3& v, const Dual3& r) {
      const PairResidual along = dot(axis_a_[0], r);
      const Dual3 across{r.v - along.value * axis_a_[0].v,
                         r.d - along.value * axis_a_[0].d - axis_a_[0].v * along.derivative};
      const Vec3 rest = v - origin();
      add(length(across) - (rest - axis(0).dot(rest) * axis(0)).norm());
    });
  }

  PairResidual entry(int i, int j) const {
    return dot(axis_a_[static_cast<std::size_t>(i)], axis_b_[static_cast<std::size_t>(j)]);
  }
  PairResidual translation(int k) const {
    return dot(axis_a_[static_cast<std::size_t>(k)], point(1, origin()) - anchor_);
  }
  PairResidual angle(int k) const {
    PairResidual out = angle_of(entry((k + 2) % 3, (k + 1) % 3), entry((k + 1) % 3, (k + 1) % 3));
    constexpr double kTurn = 2.0 * std::numbers::pi;
    out.value += kTurn * std::round((turn_ - out.value) / kTurn);
    return out;
  }

  void keep_within(const PairResidual& q, const Interval& limit, double unit) {
    if (limit.open()) return;
    PairResidual out{0.0, {}};
    out.derivative.setZero();
    if (q.value > limit.high) out = q - limit.high;
    if (q.value < limit.low) out = q - limit.low;
    add(unit * out);
  }

  void limits() {
    const JointLimits& l = joint_.joint.limits;
    switch (joint_.joint.type) {
      case JointType::kBall:
        keep_within(angle_of(root_of_squares(entry(1, 0), entry(2, 0)), entry(0, 0)),
                    {-std::numeric_limits<double>::infinity(), l.cone}, size_);
        keep_within(angle_of(-1.0 * entry(1, 2), entry(2, 2)), l.euler[0], size_);
        keep_within(angle_of(entry(0, 2), root_of_squares(entry(0, 0), entry(0, 1))), l.euler[1], size_);
        keep_within(angle_of(-1.0 * entry(0, 1), entry(0, 0)), l.euler[2], size_);
        break;
      case JointType::kRevolute:
        keep_within(angle(0), l.rotation, size_);
        break;
      case JointType::kCylindrical:
        keep_within(angle(0), l.rotation, size_);
        keep_within(translation(0), l.translation[0], 1.0);
        break;
      case JointType::kPrismatic:
        keep_within(translation(0), l.translation[0], 1.0);
        break;
      case JointType::kPlanar:
        keep_within(angle(2), l.rotation, size_);
        keep_within(translation(0), l.translation[0], 1.0);
        keep_within(translation(1), l.translation[1], 1.0);
        break;
      case JointType::kFixed:
        break;
    }
  }

  const BodyJoint& joint_;
  const std::array<Vec3, 8>& corners_;
  double turn_, size_;
  std::array<Vec3, 2> centre_;
  std::array<BodyMap, 2> map_;
  std::array<Dual3, 3> axis_a_, axis_b_;
  Dual3 anchor_;
  std::vector<PairResidual> out_;
};

}  // namespace

Eigen::Matrix<double, 6, 1> rigidity_residuals(const Mat3& A) {
  const Mat3 G = A.transpose() * A;
  Eigen::Matrix<double, 6, 1> out;
  out << G(0, 0) - 1.0, G(1, 1) - 1.0, G(2, 2) - 1.0, G(0, 1), G(1, 2), G(2, 0);
  return out;
}

std::vector<PairResidual> joint_residuals(const PoseStructure& structure, const BodyJoint& joint, const BodyMap& a,
                                          const BodyMap& b, const std::array<Vec3, 8>& corners, double turn) {
  return JointEnergy(structure, joint, a, b, corners, turn).residuals();
}

/// Collects residuals with their derivatives by body.
class PenaltyEnergy::Writer {
 public:
  Writer(const PenaltyEnergy& energy, bool derivatives) : energy_(energy), derivatives_(derivatives) {}

  void add(double value) { values_.push_back(value); }
  /// Of the residual added last. @param first of the twelve
  void derive(Index body, Index unknown, double d) {
    if (const Index at = energy_.dof(body); derivatives_ && at >= 0)
      entries_.emplace_back(static_cast<int>(values_.size()) - 1, at + unknown, d);
  }
  /// f · (A s), component k.
  void derive_turned(Index body, int k, const Vec3& s, double f) {
    for (int c = 0; c < 3; ++c) derive(body, 3 * c + k, f * s[c]);
  }

  Eigen::VectorXd values(Jacobian* J) const {
    const auto rows = static_cast<Eigen::Index>(values_.size());
    if (J != nullptr) {
      J->resize(rows, energy_.dofs());
      J->setFromTriplets(entries_.begin(), entries_.end());
    }
    return Eigen::Map<const Eigen::VectorXd>(values_.data(), rows);
  }

 private:
  const PenaltyEnergy& energy_;
  bool derivatives_;
  std::vector<double> values_;
  std::vector<Eigen::Triplet<double>> entries_;
};

PenaltyEnergy::PenaltyEnergy(const PoseStructure& structure, const PenaltyWeights& weights,
                             std::vector<HandleTerm> handles)
    : structure_(&structure), weights_(weights), handles_(std::move(handles)), dof_(structure.bodies.size(), -1) {
  for (std::size_t b = 0; b < structure.bodies.size(); ++b)
    if (!structure.bodies[b].pinned) {
      dof_[b] = dofs_;
      dofs_ += 12;
    }
  for (const BodyJoint& joint : structure.joints) corners_.push_back(corners_at(joint));
}

/// Of the cell of b that is nearest to the joint.
std::array<Vec3, 8> PenaltyEnergy::corners_at(const BodyJoint& joint) const {
  const PlacedCell* best = nullptr;
  const auto distance = [&](const PlacedCell& c) { return (c.cell.centre - joint.joint.frame.origin).norm(); };
  for (const PlacedCell& c : structure_->cells)
    if (c.body == joint.b && (best == nullptr || distance(c) < distance(*best))) best = &c;
  const Mat3& axes = structure_->grids[static_cast<std::size_t>(best->grid)].axes;
  std::array<Vec3, 8> out;
  for (std::size_t i = 0; i < 8; ++i)
    out[i] =
        best->cell.centre + axes * best->cell.half.cwiseProduct(Vec3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1));
  return out;
}

void PenaltyEnergy::set_targets(const std::vector<Vec3>& targets) {
  for (std::size_t i = 0; i < handles_.size(); ++i) handles_[i].target = targets[i];
}

Eigen::VectorXd PenaltyEnergy::residuals(const std::vector<BodyMap>& maps, const std::vector<double>& turns,
                                         Jacobian* J) const {
  Writer out(*this, J != nullptr);
  const double rigid = std::sqrt(weights_.rigidity) * structure_->size;
  for (std::size_t b = 0; b < maps.size(); ++b) {
    if (dof_[b] < 0) continue;
    const auto body = static_cast<Index>(b);
    const Eigen::Matrix<double, 6, 1> r = rigidity_residuals(maps[b].A);
    constexpr int kPairs[6][2] = {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {1, 2}, {2, 0}};
    for (int i = 0; i < 6; ++i) {
      const auto [p, q] = kPairs[i];
      out.add(rigid * r[i]);
      for (int k = 0; k < 3; ++k) {
        out.derive(body, 3 * p + k, rigid * maps[b].A(k, q));
        out.derive(body, 3 * q + k, rigid * maps[b].A(k, p));
      }
    }
  }
  for (const StrainLink& link : structure_->links) {
    const BodyMap &a = maps[static_cast<std::size_t>(link.a)], &b = maps[static_cast<std::size_t>(link.b)];
    const double w = std::sqrt(link.weight);
    const Vec3 gap = w * (a.A * link.arm_a + a.p - b.A * link.arm_b - b.p);
    for (int k = 0; k < 3; ++k) {
      out.add(gap[k]);
      out.derive_turned(link.a, k, link.arm_a, w), out.derive(link.a, 9 + k, w);
      out.derive_turned(link.b, k, link.arm_b, -w), out.derive(link.b, 9 + k, -w);
    }
    for (int l = 0; l < 3; ++l)
      for (int k = 0; k < 3; ++k) {
        out.add((a.A.row(k) - b.A.row(k)).dot(link.spread.col(l)));
        out.derive_turned(link.a, k, link.spread.col(l), 1.0);
        out.derive_turned(link.b, k, link.spread.col(l), -1.0);
      }
  }
  for (const HandleTerm& h : handles_) {
    const BodyMap& map = maps[static_cast<std::size_t>(h.body)];
    const double w = std::sqrt(h.weight);
    const Vec3 error = w * (map.A * h.arm + map.p - h.target);
    for (int k = 0; k < 3; ++k) {
      out.add(error[k]);
      out.derive_turned(h.body, k, h.arm, w), out.derive(h.body, 9 + k, w);
    }
  }
  const double joint_weight = std::sqrt(weights_.joints);
  for (std::size_t j = 0; j < structure_->joints.size(); ++j) {
    const BodyJoint& joint = structure_->joints[j];
    for (const PairResidual& r : joint_residuals(*structure_, joint, maps[static_cast<std::size_t>(joint.a)],
                                                 maps[static_cast<std::size_t>(joint.b)], corners_[j], turns[j])) {
      out.add(joint_weight * r.value);
      for (Index u = 0; u < 12; ++u) {
        out.derive(joint.a, u, joint_weight * r.derivative[u]);
        out.derive(joint.b, u, joint_weight * r.derivative[12 + u]);
      }
    }
  }
  return out.values(J);
}

}  // namespace limber::internal
