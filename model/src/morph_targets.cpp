#include "limber/model/morph_targets.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "limber/core/error.h"

namespace limber {
namespace {

constexpr double kVisibleFraction = 0.1;  // of the bounding box's diagonal
constexpr float kSmallestNormal = std::numeric_limits<float>::min();
/// If the area vectors of a vertex cancel to this part of their sum, the normal's direction is round-off.
constexpr double kNoArea = 1e-6;

Vec3 vector_at(std::span<const float> xyz, Index vertex) {
  const float* p = xyz.data() + 3 * static_cast<std::size_t>(vertex);
  return {p[0], p[1], p[2]};
}

void put(std::vector<float>& xyz, std::size_t vertex, const Vec3& v) {
  for (int a = 0; a < 3; ++a) xyz[3 * vertex + static_cast<std::size_t>(a)] = static_cast<float>(v[a]);
}

void check_triangles(std::span<const float> positions, std::span<const Triangle> triangles, const char* where) {
  const std::size_t vertices = positions.size() / 3;
  for (const Triangle& t : triangles)
    for (const Index i : t)
      if (i < 0 || static_cast<std::size_t>(i) >= vertices)
        throw InvalidArgument(std::string(where) + ": a triangle names vertex " + std::to_string(i) + " of " +
                              std::to_string(vertices));
}

/// Per vertex the sum of its triangles' area vectors (twice over), and of their sizes.
struct AreaVectors {
  std::vector<Vec3> sum;
  std::vector<double> size;
  bool none(std::size_t v) const { return !(sum[v].norm() > kNoArea * size[v]); }
};

AreaVectors area_vectors(std::span<const float> positions, std::span<const Triangle> triangles) {
  AreaVectors out{std::vector<Vec3>(positions.size() / 3, Vec3::Zero()), std::vector<double>(positions.size() / 3)};
  for (const Triangle& t : triangles) {
    const Vec3 a = vector_at(positions, t[0]);
    const Vec3 area = (vector_at(positions, t[1]) - a).cross(vector_at(positions, t[2]) - a);
    for (const Index i : t)
      out.sum[static_cast<std::size_t>(i)] += area, out.size[static_cast<std::size_t>(i)] += area.norm();
  }
  return out;
}

/// Numbers that float32 would hold with fewer digits are 0.
float whole_digits(float x) { return std::abs(x) >= kSmallestNormal ? x : 0.0f; }

double largest_displacement(const ModalSurface& surface, Index mode) {
  double square = 0.0;
  for (Index v = 0; v < surface.vertices(); ++v)
    square = std::max(square, surface.basis.shape(v, mode).unaryExpr(&whole_digits).cast<double>().squaredNorm());
  return std::sqrt(square);
}

double diagonal(const ModalSurface& surface) {
  Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (const Vec3f& p : surface.rest) low = low.cwiseMin(p.cast<double>()), high = high.cwiseMax(p.cast<double>());
  return surface.rest.empty() ? 0.0 : (high - low).norm();
}

}  // namespace

std::string mode_target_name(Index mode, Index modes, double frequency_hz) {
  const int digits = std::max<int>(2, static_cast<int>(std::to_string(std::max(modes - 1, Index{0})).size()));
  char text[64];
  std::snprintf(text, sizeof text, frequency_hz < 999.5 ? "mode%0*d_%.3gHz" : "mode%0*d_%.0fHz", digits,
                static_cast<int>(mode), frequency_hz);
  return text;
}

double visible_mode_scale(const ModalSurface& surface, Index mode) {
  const double largest = largest_displacement(surface, mode), size = diagonal(surface);
  if (!(largest > 0.0 && size > 0.0)) return 1.0;
  return std::exp2(std::round(std::log2(kVisibleFraction * size / largest)));
}

std::vector<float> rest_positions(const ModalSurface& surface) {
  std::vector<float> out;
  out.reserve(3 * surface.rest.size());
  for (const Vec3f& p : surface.rest) out.insert(out.end(), {p.x(), p.y(), p.z()});
  return out;
}

std::vector<float> mode_displacements(const ModalSurface& surface, Index mode, double scale) {
  std::vector<float> out;
  out.reserve(3 * surface.rest.size());
  for (Index v = 0; v < surface.vertices(); ++v) {
    const Vec3f shape = surface.basis.shape(v, mode);
    for (int a = 0; a < 3; ++a) {
      const auto scaled = static_cast<float>(scale * static_cast<double>(whole_digits(shape[a])));
      out.push_back(whole_digits(scaled));
    }
  }
  return out;
}

std::vector<float> unit_normals(std::span<const float> positions, std::span<const Triangle> triangles) {
  check_triangles(positions, triangles, "unit_normals");
  const AreaVectors area = area_vectors(positions, triangles);
  std::vector<float> out(positions.size());
  for (std::size_t v = 0; v < area.sum.size(); ++v)
    put(out, v, area.none(v) ? Vec3(Vec3::UnitZ()) : Vec3(area.sum[v].normalized()));
  return out;
}

std::vector<float> normal_changes(std::span<const float> positions, std::span<const float> displacements,
                                  std::span<const Triangle> triangles) {
  check_triangles(positions, triangles, "normal_changes");
  if (displacements.size() != positions.size())
    throw InvalidArgument("normal_changes: there are " + std::to_string(displacements.size()) +
                          " displacements, expected as many as positions, " + std::to_string(positions.size()));
  const AreaVectors area = area_vectors(positions, triangles);
  std::vector<Vec3> change(area.sum.size(), Vec3::Zero());
  for (const Triangle& t : triangles) {
    // d(e₁ × e₂) = de₁ × e₂ + e₁ × de₂
    const Vec3 a = vector_at(positions, t[0]), da = vector_at(displacements, t[0]);
    const Vec3 e1 = vector_at(positions, t[1]) - a, e2 = vector_at(positions, t[2]) - a;
    const Vec3 d1 = vector_at(displacements, t[1]) - da, d2 = vector_at(displacements, t[2]) - da;
    const Vec3 d = d1.cross(e2) + e1.cross(d2);
    for (const Index i : t) change[static_cast<std::size_t>(i)] += d;
  }
  std::vector<float> out(positions.size());
  for (std::size_t v = 0; v < change.size(); ++v) {
    if (area.none(v)) continue;
    const double size = area.sum[v].norm();
    const Vec3 n = area.sum[v] / size;
    put(out, v, (change[v] - n * n.dot(change[v])) / size);
  }
  return out;
}

}  // namespace limber
