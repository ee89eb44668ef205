/// @file shells.h
/// Closed shells by formulae: what assemblies.h draws its parts with.
#pragma once

#include <Eigen/Core>
#include <numbers>
#include <vector>

#include "limber/core/types.h"

namespace limber::assemblies {

inline constexpr double kPi = std::numbers::pi;
inline constexpr double kDegree = kPi / 180.0;  ///< rad

using Loop = std::vector<Eigen::Vector2d>;  ///< counter-clockwise

struct Shell {
  std::vector<Vec3> vertices;
  std::vector<Triangle> triangles;
  std::vector<char> idle;  ///< per triangle: bears nothing, may be left out

  /// Moves x to R x + t.
  Shell placed(const Mat3& R, const Vec3& t) const;
};

/// A loop (r, z) turned about the z axis; r ≥ 0. Sides from vertex i to i + 1 with idle[i] set are idle.
Shell lathe(const Loop& profile, int segments, double phase = 0.0, const std::vector<char>& idle = {});

/// A loop with holes (all counter-clockwise), from z0 to z1.
Shell extrusion(const Loop& outline, const std::vector<Loop>& holes, double z0, double z1);

Shell box(const Vec3& low, const Vec3& high);

/// A sphere about the origin with `segments` around and half as many from pole to pole.
Shell sphere(double radius, int segments, double phase = 0.0);

/// A rod with a thread of triangular section, radius r ± depth/2, or a nut around it with the outer radius `outer`.
/// Advances 2π·pitch per turn (left-handed where pitch < 0), z from z0 to z1; edges follow the helices of crest and
/// root.
Shell thread(double radius, double depth, double pitch, double z0, double z1, int segments, double phase, bool nut,
             double outer = 0.0);

Loop circle(double radius, int segments, double phase = 0.0, const Eigen::Vector2d& centre = {0.0, 0.0});
Loop rectangle(double x0, double y0, double x1, double y1);
/// Two half circles of the same radius about two centres on the x axis, and what lies between.
Loop stadium(double radius, double x0, double x1, int segments);

}  // namespace limber::assemblies
