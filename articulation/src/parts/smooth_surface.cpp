#include "parts/smooth_surface.h"

#include <algorithm>
#include <cmath>

namespace limber::internal {
namespace {

/// Per vertex the corners (3 · triangle + k) that name it, one list behind the other.
struct Corners {
  std::vector<std::size_t> begin;
  std::vector<std::size_t> corner;
};

Corners corners_of_vertices(const SurfaceMesh& mesh) {
  Corners out;
  out.begin.assign(mesh.vertices.size() + 1, 0);
  for (const Triangle& t : mesh.triangles)
    for (const Index v : t) ++out.begin[static_cast<std::size_t>(v) + 1];
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) out.begin[v + 1] += out.begin[v];
  out.corner.resize(out.begin.back());
  auto next = out.begin;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) out.corner[next[static_cast<std::size_t>(mesh.triangles[t][k])]++] = 3 * t + k;
  return out;
}

double corner_angle(const SurfaceMesh& mesh, std::size_t corner) {
  const Triangle& t = mesh.triangles[corner / 3];
  const auto at = [&](std::size_t k) -> const Vec3& { return mesh.vertices[static_cast<std::size_t>(t[k % 3])]; };
  const Vec3 &p = at(corner), u = at(corner % 3 + 1) - p, v = at(corner % 3 + 2) - p;
  return std::atan2(u.cross(v).norm(), u.dot(v));
}

}  // namespace

SmoothSurface::SmoothSurface(const SurfaceMesh& surface, double crease_angle, std::span<const Triangle> caps)
    : mesh_(surface), tree_(surface, caps), corner_normals_(surface.triangles.size()) {
  const Corners corners = corners_of_vertices(mesh_);
  std::vector<double> angle(3 * mesh_.triangles.size());
  for (std::size_t c = 0; c < angle.size(); ++c) angle[c] = corner_angle(mesh_, c);
  const double least_cosine = std::cos(crease_angle);
  for (std::size_t t = 0; t < mesh_.triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3& own = tree_.normal(static_cast<Index>(t));
      const auto v = static_cast<std::size_t>(mesh_.triangles[t][k]);
      Vec3 sum = Vec3::Zero();
      for (std::size_t i = corners.begin[v]; i < corners.begin[v + 1]; ++i) {
        const std::size_t c = corners.corner[i];
        const Vec3& other = tree_.normal(static_cast<Index>(c / 3));
        if (own.dot(other) >= least_cosine) sum += angle[c] * other;
      }
      corner_normals_[t][k] = sum.squaredNorm() > 0.0 ? Vec3(sum.normalized()) : own;
    }
}

Vec3 SmoothSurface::point(Index triangle, const Vec3& barycentric) const {
  const Triangle& t = mesh_.triangles[static_cast<std::size_t>(triangle)];
  Vec3 out = Vec3::Zero();
  for (int k = 0; k < 3; ++k) out += barycentric[k] * mesh_.vertices[static_cast<std::size_t>(t[k])];
  return out;
}

Vec3 SmoothSurface::normal(Index triangle, const Vec3& barycentric) const {
  const auto& n = corner_normals_[static_cast<std::size_t>(triangle)];
  return (barycentric[0] * n[0] + barycentric[1] * n[1] + barycentric[2] * n[2]).normalized();
}

double SmoothSurface::area(Index triangle) const {
  const Triangle& t = mesh_.triangles[static_cast<std::size_t>(triangle)];
  const auto at = [&](int k) -> const Vec3& { return mesh_.vertices[static_cast<std::size_t>(t[k])]; };
  return 0.5 * (at(1) - at(0)).cross(at(2) - at(0)).norm();
}

double SmoothSurface::chord_error(Index triangle) const {
  const Triangle& t = mesh_.triangles[static_cast<std::size_t>(triangle)];
  const auto& n = corner_normals_[static_cast<std::size_t>(triangle)];
  double most = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t l = (k + 1) % 3;
    const Vec3 edge = mesh_.vertices[static_cast<std::size_t>(t[l])] - mesh_.vertices[static_cast<std::size_t>(t[k])];
    most = std::max(most, std::abs(edge.dot(n[l] - n[k])) / 8.0);
  }
  return most;
}

}  // namespace limber::internal
