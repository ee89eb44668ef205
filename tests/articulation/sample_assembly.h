// Components and joints of assemblies that tests draw.
#pragma once

#include <Eigen/Geometry>
#include <string>

#include "limber/articulation/range_of_motion.h"
#include "parts.h"

namespace limber::testing {

inline Component component_of(const std::string& name, const SurfaceMesh& surface) {
  Component c{.name = name, .faces = {}, .triangles = {}, .surface = surface};
  c.closed = surface_quality(surface).closed_manifold();
  Eigen::AlignedBox3d box;
  for (const Vec3& p : surface.vertices) box.extend(p);
  c.diagonal = box.diagonal().norm();
  return c;
}

inline DetectedJoint joint_of(Index a, Index b, JointType type, const Vec3& x = Vec3::UnitX(),
                              const Vec3& origin = Vec3::Zero()) {
  DetectedJoint j;
  j.a = a, j.b = b;
  j.joint.type = type;
  j.joint.frame.origin = origin;
  const auto [u, v] = parts::across(x);
  j.joint.frame.axes << x, u, v;
  return j;
}

}  // namespace limber::testing
