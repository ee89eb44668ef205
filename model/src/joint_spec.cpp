#include "limber/model/joint_spec.h"

#include <cmath>
#include <limits>
#include <string>

#include "limber/core/error.h"

namespace limber {
namespace {

constexpr std::array<std::string_view, 6> kNames = {"ball", "revolute", "cylindrical", "prismatic", "planar", "fixed"};

void require_reachable(const Interval& interval, const char* what) {
  constexpr double kOpen = std::numeric_limits<double>::infinity();
  if (!(interval.low <= interval.high) || interval.low == kOpen || interval.high == -kOpen)  // false for NaN too
    throw InvalidArgument(std::string("JointSpec: limits of ") + what + " are " + std::to_string(interval.low) +
                          " to " + std::to_string(interval.high) +
                          ", expected the lower one first, and no end that is never reached");
}

}  // namespace

std::string_view to_string(JointType type) { return kNames[static_cast<std::size_t>(type)]; }

std::optional<JointType> joint_type_of(std::string_view text) {
  for (std::size_t i = 0; i < kNames.size(); ++i)
    if (kNames[i] == text) return static_cast<JointType>(i);
  return std::nullopt;
}

JointFreedoms freedoms(JointType type) {
  switch (type) {
    case JointType::kBall:
      return {3, 0};
    case JointType::kRevolute:
      return {1, 0};
    case JointType::kCylindrical:
      return {1, 1};
    case JointType::kPrismatic:
      return {0, 1};
    case JointType::kPlanar:
      return {1, 2};
    case JointType::kFixed:
      break;
  }
  return {0, 0};
}

bool is_rotation(JointType type, int coordinate) {
  return type == JointType::kPlanar ? coordinate == 2 : coordinate < freedoms(type).rotations;
}

void JointSpec::validate() const {
  constexpr double kTolerance = 1e-6;
  if (!frame.origin.allFinite()) throw InvalidArgument("JointSpec: the frame's origin is not finite");
  if (!frame.axes.allFinite() ||
      !((frame.axes.transpose() * frame.axes - Mat3::Identity()).cwiseAbs().maxCoeff() <= kTolerance) ||
      !(frame.axes.determinant() > 0.0))
    throw InvalidArgument("JointSpec: the frame's axes are not orthonormal and right-handed");
  require_reachable(limits.rotation, "the rotation");
  for (const Interval& along : limits.translation) require_reachable(along, "the translation");
  for (const Interval& angle : limits.euler) require_reachable(angle, "the Euler angles");
  if (!(limits.cone >= 0.0)) throw InvalidArgument("JointSpec: the cone's half-angle is negative or not a number");
  if (!std::isfinite(pitch)) throw InvalidArgument("JointSpec: the pitch is not finite");
}

JointSpec JointSpec::moved_by(const RigidTransform& X) const {
  JointSpec moved = *this;
  moved.frame = {.origin = X * frame.origin, .axes = to_matrix(X.q) * frame.axes};
  return moved;
}

void JointActuation::validate() const {
  const auto number = [](double value, const char* name, double least) {
    if (!(value >= least && std::isfinite(value)))
      throw InvalidArgument(std::string("JointActuation: ") + name + " is " + std::to_string(value) +
                            ", expected a finite number" + (least == 0.0 ? " of at least 0" : ""));
  };
  constexpr double kAny = -std::numeric_limits<double>::max();
  number(motor_velocity, "motor_velocity", kAny);
  number(motor_max_force, "motor_max_force", 0.0);
  number(drive_target, "drive_target", kAny);
  number(drive_stiffness, "drive_stiffness", 0.0);
  number(drive_damping, "drive_damping", 0.0);
  number(friction, "friction", 0.0);
}

}  // namespace limber
