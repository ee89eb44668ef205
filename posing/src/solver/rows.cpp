#include "solver/rows.h"

#include <cmath>
#include <numbers>

#include "limber/core/cross_matrix.h"

namespace limber::internal {
namespace {

/// Pose of b relative to a in the joint's frame, and what its derivatives need.
struct Relative {
  Relative(const PoseStructure& structure, const BodyJoint& joint, const BodyPoses& poses)
      : axes(joint.joint.frame.axes), size(structure.size) {
    const auto a = static_cast<std::size_t>(joint.a), b = static_cast<std::size_t>(joint.b);
    arm_a = joint.joint.frame.origin - structure.bodies[a].centre;
    arm_b = joint.joint.frame.origin - structure.bodies[b].centre;
    turn = to_matrix(poses[a].q.conjugate() * poses[b].q);
    between = poses[a].q.conjugate() * Vec3(poses[b].p - poses[a].p);
    Q = axes.transpose() * turn * axes;
    t = axes.transpose() * (between + turn * arm_b - arm_a);
  }

  /// A row of the derivatives ∂c/∂Q and ∂c/∂t.
  Row row(const BodyJoint& joint, double value, const Mat3& dQ, const Vec3& dt) const {
    Vec3 turn_a = Vec3::Zero(), turn_b = Vec3::Zero();  // in the joint's frame
    for (int k = 0; k < 3; ++k) {
      turn_a += dQ.col(k).cross(Q.col(k));
      turn_b += dQ.row(k).transpose().cross(Q.row(k).transpose());
    }
    const Vec3 force = axes * dt;  // along a's axes at rest
    Row out;
    out.a = joint.a, out.b = joint.b, out.value = value;
    // t moves by force·(R_aᵀ(δy_b − δy_a) − ω_a × (what a sees of y_b − y_a)); together a's arm reaches to y_b.
    const Vec3 reach = arm_a + axes * t;
    out.J_a << axes * turn_a - reach.cross(force), -force;
    const Vec3 force_b = turn.transpose() * force;
    out.J_b << axes * turn_b + arm_b.cross(force_b), force_b;
    out.arm_a = reach, out.arm_b = arm_b;
    out.dQ = dQ, out.dt = dt;
    return out;
  }

  Mat3 axes, turn, Q;
  Vec3 arm_a, arm_b, between, t;
  double size;
};

double near_angle(double angle, double near) {
  constexpr double kTurn = 2.0 * std::numbers::pi;
  return angle + kTurn * std::round((near - angle) / kTurn);
}

Mat3 entry(int row, int column) {
  Mat3 out = Mat3::Zero();
  out(row, column) = 1.0;
  return out;
}

/// Writes the rows of one joint.
class RowWriter {
 public:
  RowWriter(const PoseStructure& structure, const BodyJoint& joint, const BodyPoses& poses, double turn, JointRows& out)
      : at_(structure, joint, poses), joint_(joint), turn_(turn), out_(out) {}

  void write() {
    const JointLimits& l = joint_.joint.limits;
    switch (joint_.joint.type) {
      case JointType::kBall:
        hold_places({0, 1, 2});
        ball_limits(l);
        break;
      case JointType::kRevolute:
        hold_places({0, 1, 2});
        hold_axis(0);
        coordinate(angle(0), l.rotation, true);
        break;
      case JointType::kCylindrical:
        hold_places({1, 2});
        hold_axis(0);
        if (joint_.joint.pitch != 0.0) hold_pitch();
        coordinate(angle(0), l.rotation, true);
        coordinate(place(0), l.translation[0], false);
        break;
      case JointType::kPrismatic:
        hold_places({1, 2});
        hold_attitude();
        coordinate(place(0), l.translation[0], false);
        break;
      case JointType::kPlanar:
        hold_places({2});
        hold_axis(2);
        coordinate(place(0), l.translation[0], false);
        coordinate(place(1), l.translation[1], false);
        coordinate(angle(2), l.rotation, true);
        break;
      case JointType::kFixed:  // its bodies are one
        break;
    }
  }

  /// The angle about axis k: atan2 of the entries that a turn about it has.
  Row angle(int k) const {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    const double s = at_.Q(j, i), c = at_.Q(i, i), n = s * s + c * c;
    return at_.row(joint_, near_angle(std::atan2(s, c), turn_), (c * entry(j, i) - s * entry(i, i)) / n, Vec3::Zero());
  }

 private:
  Row place(int k) const { return at_.row(joint_, at_.t[k] / at_.size, Mat3::Zero(), Vec3::Unit(k) / at_.size); }

  void hold_places(std::initializer_list<int> axes) {
    for (const int k : axes) out_.constraints.push_back(place(k));
  }
  /// b's axis k along a's: its components across vanish.
  void hold_axis(int k) {
    for (const int i : {(k + 1) % 3, (k + 2) % 3})
      out_.constraints.push_back(at_.row(joint_, at_.Q(i, k), entry(i, k), Vec3::Zero()));
  }
  /// No turn: the axial vector of Q, its sine times its axis.
  void hold_attitude() {
    for (int k = 0; k < 3; ++k) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      out_.constraints.push_back(
          at_.row(joint_, 0.5 * (at_.Q(j, i) - at_.Q(i, j)), 0.5 * (entry(j, i) - entry(i, j)), Vec3::Zero()));
    }
  }
  /// A screw: x = pitch · angle.
  void hold_pitch() {
    Row row = place(0);
    const Row turn = angle(0);
    const double pitch = joint_.joint.pitch / at_.size;
    row.value -= pitch * turn.value;
    row.J_a -= pitch * turn.J_a;
    row.J_b -= pitch * turn.J_b;
    row.dQ -= pitch * turn.dQ;
    out_.constraints.push_back(row);
  }

  void coordinate(Row row, const Interval& limit, bool is_angle) {
    const double unit = is_angle ? 1.0 : at_.size;
    out_.coordinates.push_back({row, {limit.low / unit, limit.high / unit}, is_angle});
  }

  void ball_limits(const JointLimits& l) {
    const Mat3& Q = at_.Q;
    if (std::isfinite(l.cone)) {
      // atan2 of sine and cosine of the angle between the x axes, so that it has a slope also where the cosine has
      // none.
      const double c = Q(0, 0), s = std::hypot(Q(1, 0), Q(2, 0)), n = s * s + c * c;
      Mat3 ds = Mat3::Zero();
      ds(1, 0) = s > 0.0 ? Q(1, 0) / s : 1.0;
      ds(2, 0) = s > 0.0 ? Q(2, 0) / s : 0.0;
      Row row = at_.row(joint_, std::atan2(s, c), (c * ds - s * entry(0, 0)) / n, Vec3::Zero());
      if (s > 0.0) {  // round the cone
        const Row round = at_.row(joint_, 0.0, (Q(1, 0) * entry(2, 0) - Q(2, 0) * entry(1, 0)) / s, Vec3::Zero());
        row.bend = c / (n * s);
        row.across << round.J_a, round.J_b;
      }
      coordinate(row, {-std::numbers::pi, l.cone}, true);
    }
    // Q = R_x(α) R_y(β) R_z(γ)
    const auto ratio = [&](double s, double c, const Mat3& ds, const Mat3& dc, const Interval& limit) {
      if (limit.open()) return;
      coordinate(at_.row(joint_, std::atan2(s, c), (c * ds - s * dc) / (s * s + c * c), Vec3::Zero()), limit, true);
    };
    ratio(-Q(1, 2), Q(2, 2), -entry(1, 2), entry(2, 2), l.euler[0]);
    const double rest = std::hypot(Q(0, 0), Q(0, 1));
    if (rest > 0.0)
      ratio(Q(0, 2), rest, entry(0, 2), (Q(0, 0) * entry(0, 0) + Q(0, 1) * entry(0, 1)) / rest, l.euler[1]);
    ratio(-Q(0, 1), Q(0, 0), -entry(0, 1), entry(0, 0), l.euler[2]);
  }

  Relative at_;
  const BodyJoint& joint_;
  double turn_;
  JointRows& out_;
};

}  // namespace

Mat3 turning_stiffness(const Mat3& moment) {
  return 0.5 * (moment + moment.transpose()) - moment.trace() * Mat3::Identity();
}

void append_joint_rows(const PoseStructure& structure, const BodyJoint& joint, const BodyPoses& poses, double turn,
                       JointRows& out) {
  RowWriter(structure, joint, poses, turn, out).write();
}

PairMatrix joint_curvature(const PoseStructure& structure, const BodyJoint& joint, const BodyPoses& poses,
                           const Mat3& dQ, const Vec3& dt) {
  const Relative at(structure, joint, poses);
  const Mat3 D = at.axes * dQ * at.axes.transpose();
  const Vec3 force = at.axes * dt, force_b = at.turn.transpose() * force, reach = at.arm_a + at.axes * at.t;
  PairMatrix out = PairMatrix::Zero();
  out.block<3, 3>(0, 0) = turning_stiffness(reach * force.transpose() + at.turn * D.transpose());
  out.block<3, 3>(6, 6) = turning_stiffness(at.arm_b * force_b.transpose() + D.transpose() * at.turn);
  const Mat3 F = cross_matrix(force);
  out.block<3, 3>(0, 3) = -F;
  out.block<3, 3>(0, 9) = F * at.turn;
  out.block<3, 3>(0, 6) = -F * at.turn * cross_matrix(at.arm_b);
  for (int i = 0; i < 3; ++i)  // −D : [a] T [b]
    for (int j = 0; j < 3; ++j)
      out(i, 6 + j) -= D.cwiseProduct(cross_matrix(Vec3::Unit(i)) * at.turn * cross_matrix(Vec3::Unit(j))).sum();
  out.block<9, 3>(3, 0) = out.block<3, 9>(0, 3).transpose();
  return out;
}

double joint_turn(const PoseStructure& structure, const BodyJoint& joint, const BodyPoses& poses, double near) {
  const JointType type = joint.joint.type;
  if (type != JointType::kRevolute && type != JointType::kCylindrical && type != JointType::kPlanar) return 0.0;
  JointRows unused;
  return RowWriter(structure, joint, poses, near, unused).angle(type == JointType::kPlanar ? 2 : 0).value;
}

std::vector<double> joint_coordinates(const PoseStructure& structure, const BodyJoint& joint, const BodyPoses& poses,
                                      double turn) {
  const Relative at(structure, joint, poses);
  switch (joint.joint.type) {
    case JointType::kBall:
      return {std::atan2(std::hypot(at.Q(1, 0), at.Q(2, 0)), at.Q(0, 0))};
    case JointType::kRevolute:
      return {joint_turn(structure, joint, poses, turn)};
    case JointType::kCylindrical:
      return {joint_turn(structure, joint, poses, turn), at.t[0]};
    case JointType::kPrismatic:
      return {at.t[0]};
    case JointType::kPlanar:
      return {joint_turn(structure, joint, poses, turn), at.t[0], at.t[1]};
    case JointType::kFixed:
      break;
  }
  return {};
}

RigidTransform moved(const RigidTransform& X, const Twist& twist) {
  const Vec3 w = twist.head<3>(), v = twist.tail<3>();
  const double a = w.norm();
  // (1 − cos a)/a² and (a − sin a)/a³; below 1e-3 their series are exact to round-off.
  const double half = a > 0.0 ? std::sin(0.5 * a) / a : 0.5;
  const double first = 2.0 * half * half;
  const double second = a > 1e-3 ? (a - std::sin(a)) / (a * a * a) : (1.0 - a * a / 20.0) / 6.0;
  const Vec3 wv = w.cross(v);
  return {normalized(X.q * quaternion_from_rotation_vector(w)),
          X.p + X.q * Vec3(v + first * wv + second * w.cross(wv))};
}

}  // namespace limber::internal
