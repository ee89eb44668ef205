#include "solver/pose_starts.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "limber/core/disjoint_sets.h"

namespace limber::internal {
namespace {

constexpr double kPi = std::numbers::pi;

/// Numbers of 0 to 1, one after the other.
class Spread {
 public:
  explicit Spread(int number) : number_(number) {}
  double next() {
    do ++prime_;
    while (!is_prime(prime_));
    const double at = number_ * std::sqrt(static_cast<double>(prime_));
    return at - std::floor(at);
  }
  /// @param most where the interval is open
  double within(const Interval& interval, double most) {
    const double low = std::max(interval.low, -most), high = std::min(interval.high, most), part = next();
    return low < high ? low + part * (high - low) : std::clamp(0.0, interval.low, interval.high);
  }

 private:
  static bool is_prime(int n) {
    for (int d = 2; d * d <= n; ++d)
      if (n % d == 0) return false;
    return true;
  }
  int number_, prime_ = 1;
};

/// A joint's turn, as a rotation vector in its frame, and slide; a ball's twist about x comes before its turn.
struct Coordinates {
  Vec3 turn = Vec3::Zero(), slide = Vec3::Zero();
  double twist = 0.0;
};

Coordinates coordinates(const JointSpec& joint, double size, Spread& spread) {
  const JointLimits& l = joint.limits;
  Coordinates out;
  switch (joint.type) {
    case JointType::kBall: {
      const double swing = std::min(l.cone, kPi) * std::sqrt(spread.next()), to = 2.0 * kPi * spread.next();
      out.turn = {0.0, swing * std::cos(to), swing * std::sin(to)};
      out.twist = spread.within(l.euler[0], kPi);
      break;
    }
    case JointType::kRevolute:
      out.turn.x() = spread.within(l.rotation, kPi);
      break;
    case JointType::kCylindrical:
      out.turn.x() = spread.within(l.rotation, kPi);
      out.slide.x() = joint.pitch != 0.0 ? joint.pitch * out.turn.x() : spread.within(l.translation[0], size);
      break;
    case JointType::kPrismatic:
      out.slide.x() = spread.within(l.translation[0], size);
      break;
    case JointType::kPlanar:
      out.slide = {spread.within(l.translation[0], size), spread.within(l.translation[1], size), 0.0};
      out.turn.z() = spread.within(l.rotation, kPi);
      break;
    case JointType::kFixed:
      break;
  }
  return out;
}

/// The motion of b relative to a, from rest.
RigidTransform motion_of(const JointSpec& joint, const Coordinates& at) {
  const Mat3& axes = joint.frame.axes;
  const Quaternion q =
      quaternion_from_rotation_vector(axes * at.turn) * quaternion_from_rotation_vector(at.twist * axes.col(0));
  return {q, joint.frame.origin - q * joint.frame.origin + axes * at.slide};
}

/// What a body's pose makes of places at rest.
RigidTransform from_rest(const PoseBody& body, const RigidTransform& pose) {
  return {pose.q, pose.p - pose.q * body.centre};
}

}  // namespace

PoseStarts::PoseStarts(const PoseStructure& structure) : structure_(&structure) {
  const std::size_t count = structure.bodies.size();
  DisjointSets together(count);
  for (const StrainLink& link : structure.links) together.join(link.a, link.b);
  Index pinned = -1;
  for (std::size_t b = 0; b < count; ++b) {
    if (!structure.bodies[b].pinned) continue;
    if (pinned >= 0) together.join(pinned, static_cast<Index>(b));
    pinned = static_cast<Index>(b);
  }
  std::map<Index, std::vector<std::size_t>> members;
  for (std::size_t b = 0; b < count; ++b) members[together.root(static_cast<Index>(b))].push_back(b);
  std::vector<bool> stands(count, false);
  const auto root = [&](Index b) { return static_cast<std::size_t>(together.root(b)); };
  if (pinned >= 0) stands[root(pinned)] = true;
  // Each time the first joint that leads on; where none does, the next chain begins at a body of its own.
  for (;;) {
    const auto leads = [&](const BodyJoint& j) { return stands[root(j.a)] != stands[root(j.b)]; };
    const auto joint = std::find_if(structure.joints.begin(), structure.joints.end(), leads);
    if (joint != structure.joints.end()) {
      const bool b_stands = stands[root(joint->b)];
      const std::size_t placed = root(b_stands ? joint->a : joint->b);
      stands[placed] = true;
      order_.push_back({static_cast<std::size_t>(joint - structure.joints.begin()), b_stands,
                        members.at(static_cast<Index>(placed))});
      continue;
    }
    const auto other = std::find_if(structure.joints.begin(), structure.joints.end(),
                                    [&](const BodyJoint& j) { return !stands[root(j.a)]; });
    if (other == structure.joints.end()) return;
    stands[root(other->a)] = true;
  }
}

Pose PoseStarts::start(const Pose& from, int number) const {
  Pose out = from;
  Spread spread(number);
  for (const Placing& placing : order_) {
    const BodyJoint& joint = structure_->joints[placing.joint];
    const auto a = static_cast<std::size_t>(joint.a), b = static_cast<std::size_t>(joint.b);
    const Coordinates at = coordinates(joint.joint, structure_->size, spread);
    const RigidTransform motion = motion_of(joint.joint, at);
    const auto now = [&](std::size_t body) { return from_rest(structure_->bodies[body], out.bodies[body]); };
    const RigidTransform moves =
        placing.b_stands ? now(b) * motion.inverse() * now(a).inverse() : now(a) * motion * now(b).inverse();
    for (const std::size_t body : placing.bodies)
      out.bodies[body] = {normalized(moves.q * out.bodies[body].q), moves * out.bodies[body].p};
    out.turns[placing.joint] = joint.joint.type == JointType::kPlanar ? at.turn.z() : at.turn.x();
  }
  return out;
}

}  // namespace limber::internal
