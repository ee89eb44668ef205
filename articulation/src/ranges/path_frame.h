/// @file path_frame.h
/// Coordinates of a one-parameter motion. Private to the articulation module.
///
/// x runs along the axis and θ about it. An orbit is a point of the *orbit plane*: (r, x) for rotations, (y, z) for
/// translations. A screw's orbits are told apart by r and x − pitch θ.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <span>
#include <utility>

#include "limber/articulation/free_motion.h"
#include "ranges/orbit_box_tree.h"

namespace limber::internal {

/// An orbit and where on it t = 0 lies.
struct Orbit {
  std::array<double, 2> plane{};  ///< rotation, screw: r and x; translation: y and z
  double phase = 0.0;             ///< rotation, screw: θ; translation: x
};

/// Within (−π, π]. @pre |angle| < 4π
double wrapped(double angle);

/// Smallest distance from the x axis over a triangle.
double least_radius(const Vec3& a, const Vec3& b, const Vec3& c);

class PathFrame {
 public:
  explicit PathFrame(const MotionPath& path);
  Vec3 to_path(const Vec3& p) const { return axes_.transpose() * (p - origin_); }
  Vec3 from_path(const Vec3& p) const { return axes_ * p + origin_; }
  Vec3 moved(const Vec3& p, double t) const;  ///< φ_t(p), path coordinates
  Orbit orbit_of(const Vec3& p) const;        ///< p in path coordinates
  OrbitBox plane_point(const Vec3& p) const;  ///< p in path coordinates: its place in the orbit plane, no screw's
  OrbitBox box_of(const Orbit& orbit) const;  ///< a point
  OrbitBox box_of(std::span<const Vec3, 3> corners) const;  ///< of the orbits that meet a triangle; no screw's
  /// The box in path coordinates around one in the input's: its centre and half its sizes.
  std::pair<Vec3, Vec3> box_of(const Eigen::AlignedBox3d& box) const;
  /// Holds the orbits that meet a box, given in the input's coordinates; a screw's along x from −1e300 to 1e300.
  OrbitBox box_around(const Eigen::AlignedBox3d& box) const;
  double speed(const Orbit& orbit) const;  ///< length per unit of t
  Vec3 velocity(const Vec3& p) const;      ///< of p per unit of t, path coordinates
  Vec3 direction(const Vec3& p) const;     ///< of motion at p, path coordinates, unit; 0 on the axis of a rotation
  MotionPath::Kind kind() const { return kind_; }
  double pitch() const { return pitch_; }

 private:
  double start_of_helix(const Orbit& orbit) const;

  MotionPath::Kind kind_;
  double pitch_;
  Vec3 origin_;
  Mat3 axes_;  ///< columns x, y, z
};

}  // namespace limber::internal
