/// @file limber/model/joint_spec.h
/// A joint between two parts: its type, place, limits and actuation. Shared by
/// detection, posing, dynamics, assets and the joints file (docs/formats/joints.md).
///
/// A joint has a right-handed frame J. Part b moves, part a stays; where the parts are as read (the reference pose), J
/// is the same in both, all coordinates are 0. Lengths are in m (or the file's own unit before it is scaled), angles in
/// rad.
///
///   type         freedoms of b relative to a, along and about the axes of J
///   ball         three rotations about the origin
///   revolute     rotation about x through the origin
///   cylindrical  rotation about x and translation along x; with a pitch (a screw) the two go together
///   prismatic    translation along x
///   planar       translations along x and y, rotation about z
///   fixed        none
///
/// Source: [X09] Table 1; the screw is missing there.
#pragma once

#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string_view>
#include <tuple>
#include <type_traits>

#include "limber/core/rigid_transform.h"
#include "limber/core/types.h"

namespace limber {

enum class JointType { kBall, kRevolute, kCylindrical, kPrismatic, kPlanar, kFixed };

/// Text of a type in files and messages: "ball", "revolute", "cylindrical", "prismatic", "planar", "fixed".
std::string_view to_string(JointType type);
std::optional<JointType> joint_type_of(std::string_view text);

/// Rotational and translational freedoms a type leaves.
struct JointFreedoms {
  int rotations = 0, translations = 0;
  int count() const { return rotations + translations; }
};
JointFreedoms freedoms(JointType type);
/// Whether a coordinate, 0 to freedoms(type).count() − 1, is an angle: rotations come first, but for planar joints.
bool is_rotation(JointType type, int coordinate);

/// A closed interval; an end that is infinite is open.
struct Interval {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();

  bool open() const { return low == -std::numeric_limits<double>::infinity() && high == -low; }
  bool bounded() const { return std::isfinite(low) && std::isfinite(high); }  ///< at both ends
  double width() const { return high - low; }
  friend bool operator==(const Interval&, const Interval&) = default;
};

/// How far each freedom goes; members that the type does not have stay open.
struct JointLimits {
  Interval rotation{};                    ///< revolute, cylindrical: about x; planar: about z; rad
  std::array<Interval, 2> translation{};  ///< prismatic, cylindrical: [0] along x; planar: along x and y; m
  double cone = std::numeric_limits<double>::infinity();  ///< ball: largest angle of b's x axis from a's, rad
  /// ball: intrinsic x-y-z Euler angles, rad
  std::array<Interval, 3> euler{};

  friend bool operator==(const JointLimits&, const JointLimits&) = default;
};

template <class Self>
requires std::is_same_v<std::remove_const_t<Self>, Interval>
auto state_fields(Self& s) { return std::tie(s.low, s.high); }

template <class Self>
requires std::is_same_v<std::remove_const_t<Self>, JointLimits>
auto state_fields(Self& s) { return std::tie(s.rotation, s.translation, s.cone, s.euler); }

/// Frame J: a point and three orthonormal, right-handed axes (columns x, y, z).
struct JointFrame {
  Vec3 origin = Vec3::Zero();
  Mat3 axes = Mat3::Identity();

  friend bool operator==(const JointFrame&, const JointFrame&) = default;
};

struct JointSpec {
  JointType type = JointType::kFixed;
  JointFrame frame{};
  JointLimits limits{};
  double pitch = 0.0;  ///< cylindrical: advance along x per radian about x, m/rad; 0: no screw

  /// @throws InvalidArgument if the axes are not orthonormal and right-handed to 1e-6, a number is NaN, or low > high
  void validate() const;
  /// The joint carried along: its frame by X.
  JointSpec moved_by(const RigidTransform& X) const;

  friend bool operator==(const JointSpec&, const JointSpec&) = default;
};

/// Actuation of one coordinate. Forces are N or N·m, velocities m/s or rad/s.
struct JointActuation {
  double motor_velocity = 0.0;
  double motor_max_force = 0.0;  ///< ≥ 0; 0: no motor
  double drive_target = 0.0;     ///< m or rad
  double drive_stiffness = 0.0;  ///< k, N/m or N·m/rad; ≥ 0; 0: no drive
  double drive_damping = 0.0;    ///< c, N·s/m or N·m·s/rad; ≥ 0; without a stiffness: a damper
  double friction = 0.0;         ///< ≥ 0
  void validate() const;         ///< @throws InvalidArgument naming the field and its value

  friend bool operator==(const JointActuation&, const JointActuation&) = default;
};

template <class Self>
requires std::is_same_v<std::remove_const_t<Self>, JointActuation>
auto state_fields(Self& s) {
  return std::tie(s.motor_velocity, s.motor_max_force, s.drive_target, s.drive_stiffness, s.drive_damping, s.friction);
}

}  // namespace limber
