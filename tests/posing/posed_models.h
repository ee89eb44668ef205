// Models that are posed: the drawn assemblies with their true joints, and bars.
#pragma once

#include <map>
#include <numeric>

#include "assemblies.h"
#include "limber/posing/posing_session.h"
#include "shapes.h"
#include "structure.h"
#include "true_joints.h"

namespace limber::testing {

/// With the regions that joints influence, which take longest to find: once for all tests.
inline const JointedModel& assembly_model(const std::string& name, bool swapped = false) {
  static std::map<std::pair<std::string, bool>, JointedModel> made;
  auto found = made.find({name, swapped});
  if (found == made.end()) {
    const assemblies::MadeAssembly a = assemblies::make(name, {.segments = 8, .swapped = swapped});
    found = made.emplace(std::pair(name, swapped), jointed_model(a.surface, assemblies::true_joints(a), name)).first;
  }
  return found->second;
}

/// Without them, for parts that stay rigid.
inline JointedModel rigid_assembly(const std::string& name) {
  const assemblies::MadeAssembly a = assemblies::make(name, {.segments = 8});
  JointedModel out;
  out.surface = a.surface.surface;
  for (const SurfaceGroup& g : a.surface.groups) {
    out.parts.push_back({g.name, std::vector<Index>(static_cast<std::size_t>(g.count))});
    std::iota(out.parts.back().triangles.begin(), out.parts.back().triangles.end(), g.first);
  }
  for (const JointRecord& j : assemblies::true_joints(a).joints) out.joints.push_back({j.a, j.b, j.joint, {}});
  return out;
}

/// One part without joints.
inline JointedModel single_part(const SurfaceMesh& surface) {
  JointedModel model;
  model.surface = surface;
  model.parts.push_back({"part", {}});
  for (std::size_t t = 0; t < surface.triangles.size(); ++t) model.parts[0].triangles.push_back(static_cast<Index>(t));
  return model;
}

/// A bar along x from 0 to `length`, square, its section around the x axis; walls of `rings` rectangles along x.
inline SurfaceMesh bar_surface(double length, double width, Index rings) {
  SurfaceMesh s;
  for (Index i = 0; i <= rings; ++i)
    for (const auto& [y, z] : {std::pair(-1, -1), std::pair(1, -1), std::pair(1, 1), std::pair(-1, 1)})
      s.vertices.emplace_back(length * i / rings, 0.5 * width * y, 0.5 * width * z);
  for (Index i = 0; i < rings; ++i)
    for (Index k = 0; k < 4; ++k) {
      const Index a = 4 * i + k, b = 4 * i + (k + 1) % 4;
      s.triangles.push_back({a, b + 4, b});
      s.triangles.push_back({a, a + 4, b + 4});
    }
  const Index e = 4 * rings;
  for (const Triangle& t : {Triangle{0, 1, 2}, Triangle{0, 2, 3}, Triangle{e, e + 2, e + 1}, Triangle{e, e + 3, e + 2}})
    s.triangles.push_back(t);
  return s;
}

/// The cell of a part that is furthest from a point, by a corner; the corner.
inline Vec3 furthest_point(const JointedModel& model, Index part, const Vec3& from) {
  Vec3 best = from;
  for (const Index t : model.parts[static_cast<std::size_t>(part)].triangles)
    for (const Index v : model.surface.triangles[static_cast<std::size_t>(t)])
      if (const Vec3& p = model.surface.vertices[static_cast<std::size_t>(v)]; (p - from).norm() > (best - from).norm())
        best = p;
  return best;
}

inline double size_of(const JointedModel& model) {
  Eigen::AlignedBox3d box;
  for (const Vec3& p : model.surface.vertices) box.extend(p);
  return box.diagonal().norm();
}

inline std::vector<Vec3> vertices_of(const PosingSession& session) {
  std::vector<Vec3> out(session.model().surface.vertices.size());
  session.reconstruct(out);
  return out;
}

/// The largest distance of two vertices of equal number.
inline double largest_distance(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  double out = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) out = std::max(out, (a[i] - b[i]).norm());
  return out;
}

}  // namespace limber::testing
