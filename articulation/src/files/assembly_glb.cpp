#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "limber/articulation/robot_files.h"
#include "limber/core/error.h"
#include "limber/model/glb.h"
#include "limber/model/pose_keys.h"

namespace limber {
namespace {

/// Linear colours of joints, by type.
constexpr std::array<std::array<float, 4>, 6> kJoints{{{0.95f, 0.10f, 0.60f, 1.0f},
                                                       {0.95f, 0.05f, 0.02f, 1.0f},
                                                       {0.95f, 0.45f, 0.00f, 1.0f},
                                                       {0.05f, 0.70f, 0.10f, 1.0f},
                                                       {0.05f, 0.30f, 0.95f, 1.0f},
                                                       {0.10f, 0.10f, 0.10f, 1.0f}}};

std::vector<float> narrow(const std::vector<Vec3>& points, const Vec3& origin, double scale) {
  std::vector<float> out;
  out.reserve(3 * points.size());
  for (const Vec3& p : points)
    for (int i = 0; i < 3; ++i) out.push_back(static_cast<float>(scale * p[i] - origin[i]));
  return out;
}

Vec3 middle_of(const SurfaceMesh& surface) {
  Vec3 low = surface.vertices.front(), high = low;
  for (const Vec3& p : surface.vertices) low = low.cwiseMin(p), high = high.cwiseMax(p);
  return 0.5 * (low + high);
}

int add_surface(GlbBuilder& glb, const std::string& name, const SurfaceMesh& surface, const Vec3& origin, double scale,
                int material) {
  const int position = glb.add_vertex_vectors(narrow(surface.vertices, origin, scale));
  const int triangles = glb.add_triangles(surface.triangles);
  return glb.add_mesh({.name = name, .position = position, .triangles = triangles, .material = material});
}

/// An arrow along x of length 2, its middle at 0.
SurfaceMesh arrow() {
  constexpr int kSides = 12;
  constexpr double kProfile[][2] = {{-1.0, 0.0}, {-1.0, 0.02}, {0.85, 0.02}, {0.85, 0.05}, {1.0, 0.0}};
  SurfaceMesh s;
  for (const auto& [x, r] : kProfile)
    for (int i = 0; i < kSides; ++i) {
      const double angle = 2.0 * std::numbers::pi * i / kSides;
      s.vertices.emplace_back(x, r * std::cos(angle), r * std::sin(angle));
    }
  for (Index ring = 0; ring + 1 < 5; ++ring)
    for (Index i = 0; i < kSides; ++i) {
      const Index next = (i + 1) % kSides, a = kSides * ring + i, b = kSides * ring + next;
      if (ring > 0) s.triangles.push_back({a, b, a + kSides});
      if (ring < 3) s.triangles.push_back({b, b + kSides, a + kSides});
    }
  return s;
}

/// The columns of the frame that tell of a type's freedoms.
std::vector<int> axes_shown(JointType type) {
  switch (type) {
    case JointType::kBall:
      return {0, 1, 2};
    case JointType::kPlanar:
      return {2};
    case JointType::kFixed:
      return {};
    default:
      return {0};
  }
}

/// A rotation that takes x to a unit vector.
Quaternion from_x(const Vec3& axis) {
  const Vec3 across = Vec3::UnitX().cross(axis);
  const double sine = across.norm();
  const Vec3 about = sine > 0.0 ? Vec3(across / sine) : Vec3::UnitZ();
  return quaternion_from_rotation_vector(std::atan2(sine, axis.x()) * about);
}

}  // namespace

std::string assembly_glb(const Assembly& assembly, const std::vector<DetectedJoint>& joints, double metres_per_unit) {
  if (!(metres_per_unit > 0.0))
    throw InvalidArgument("assembly_glb: metres_per_unit is " + std::to_string(metres_per_unit) + ", expected > 0");
  GlbBuilder glb;
  std::vector<int> parts, kinds;
  for (const auto& c : kPartColors)
    parts.push_back(glb.add_material({.name = "part", .base_color = c, .double_sided = true}));
  for (std::size_t t = 0; t < kJoints.size(); ++t)
    kinds.push_back(
        glb.add_material({.name = std::string(to_string(static_cast<JointType>(t))), .base_color = kJoints[t]}));
  for (std::size_t i = 0; i < assembly.components.size(); ++i) {
    const Component& c = assembly.components[i];
    const Vec3 origin = metres_per_unit * middle_of(c.surface);
    const int mesh = add_surface(glb, c.name, c.surface, origin, metres_per_unit, parts[i % parts.size()]);
    glb.add_node(
        {.name = c.name, .mesh = mesh, .translation = origin, .extras = nlohmann::json{{"component", i}}.dump()});
  }
  const SurfaceMesh pointer = arrow();
  std::array<int, 6> meshes;
  meshes.fill(-1);
  for (std::size_t i = 0; i < joints.size(); ++i) {
    const DetectedJoint& j = joints[i];
    j.joint.validate();
    const auto type = static_cast<std::size_t>(j.joint.type);
    const Component &a = assembly.components.at(static_cast<std::size_t>(j.a)),
                    &b = assembly.components.at(static_cast<std::size_t>(j.b));
    for (const int axis : axes_shown(j.joint.type)) {
      if (meshes[type] < 0)
        meshes[type] = add_surface(glb, std::string(to_string(j.joint.type)), pointer, Vec3::Zero(), 1.0, kinds[type]);
      glb.add_node({.name = std::string(to_string(j.joint.type)) + ": " + a.name + " - " + b.name,
                    .mesh = meshes[type],
                    .translation = Vec3(metres_per_unit * j.joint.frame.origin),
                    .rotation = from_x(j.joint.frame.axes.col(axis)),
                    .scale = 0.6 * metres_per_unit * std::min(a.diagonal, b.diagonal),
                    .extras = nlohmann::json{{"joint", i}, {"a", j.a}, {"b", j.b}}.dump()});
    }
  }
  return glb.bytes();
}

}  // namespace limber
