#include "bake/simplify_surface.h"

#include <meshoptimizer.h>

namespace limber::internal {
namespace {

/// meshoptimizer's floats would cost a surface far from the origin its digits.
std::vector<float> centred_positions(const SurfaceMesh& surface) {
  Eigen::AlignedBox3d box;
  for (const Vec3& x : surface.vertices) box.extend(x);
  const Vec3 center = box.center();
  std::vector<float> positions;
  positions.reserve(3 * surface.vertices.size());
  for (const Vec3& x : surface.vertices)
    for (int axis = 0; axis < 3; ++axis) positions.push_back(static_cast<float>(x[axis] - center[axis]));
  return positions;
}

}  // namespace

SimplifiedSurface simplify_surface(const SurfaceMesh& surface, std::size_t triangles) {
  constexpr float kAnyError = 1.0f;  // of the surface's extent: only the count limits
  const std::vector<float> positions = centred_positions(surface);
  std::vector<unsigned> indices;
  indices.reserve(3 * surface.triangles.size());
  for (const Triangle& t : surface.triangles)
    for (const Index v : t) indices.push_back(static_cast<unsigned>(v));

  std::vector<unsigned> kept(indices.size());
  float error = 0.0f;
  const std::size_t vertices = surface.vertices.size(), stride = 3 * sizeof(float);
  kept.resize(meshopt_simplify(kept.data(), indices.data(), indices.size(), positions.data(), vertices, stride,
                               3 * triangles, kAnyError, 0u, &error));

  SimplifiedSurface out;
  out.error = static_cast<double>(error * meshopt_simplifyScale(positions.data(), vertices, stride));
  std::vector<Index> new_index(vertices, -1);
  for (std::size_t corner = 0; corner < kept.size(); corner += 3) {
    Triangle t{};
    for (std::size_t a = 0; a < 3; ++a) {
      Index& index = new_index[kept[corner + a]];
      if (index < 0) {
        index = static_cast<Index>(out.vertex_of.size());
        out.vertex_of.push_back(static_cast<Index>(kept[corner + a]));
        out.surface.vertices.push_back(surface.vertices[kept[corner + a]]);
      }
      t[a] = index;
    }
    out.surface.triangles.push_back(t);
  }
  return out;
}

}  // namespace limber::internal
