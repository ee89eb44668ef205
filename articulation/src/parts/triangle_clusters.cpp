#include "parts/triangle_clusters.h"

#include <cstdint>
#include <utility>

namespace limber::internal {
namespace {

/// The lowest 21 bits with two zeros between each and the next.
std::uint64_t spread_bits(std::uint64_t x) {
  x &= 0x1fffff;
  x = (x | x << 32) & 0x1f00000000ffff;
  x = (x | x << 16) & 0x1f0000ff0000ff;
  x = (x | x << 8) & 0x100f00f00f00f00f;
  x = (x | x << 4) & 0x10c30c30c30c30c3;
  return (x | x << 2) & 0x1249249249249249;
}

/// Place of a point along the curve through a box.
std::uint64_t along_curve(const Vec3& p, const Eigen::AlignedBox3d& box) {
  constexpr double kCells = 2097151.0;  // 2²¹ − 1
  std::uint64_t place = 0;
  for (int k = 0; k < 3; ++k) {
    const double width = box.sizes()[k];
    const double part = width > 0.0 ? std::clamp((p[k] - box.min()[k]) / width, 0.0, 1.0) : 0.0;
    place |= spread_bits(static_cast<std::uint64_t>(kCells * part)) << k;
  }
  return place;
}

}  // namespace

TriangleClusters::TriangleClusters(const SurfaceMesh& surface, std::span<const Triangle> caps) {
  std::vector<Eigen::AlignedBox3d> boxes;
  Eigen::AlignedBox3d all;
  for (const auto triangles : {std::span(surface.triangles), caps})
    for (const Triangle& t : triangles) {
      Eigen::AlignedBox3d& box = boxes.emplace_back();
      for (const Index v : t) box.extend(surface.vertices[static_cast<std::size_t>(v)]);
      all.extend(box);
    }
  std::vector<std::pair<std::uint64_t, Index>> places;
  for (const auto& box : boxes) places.emplace_back(along_curve(box.center(), all), static_cast<Index>(places.size()));
  std::sort(places.begin(), places.end());
  std::vector<Eigen::AlignedBox3d> level;
  for (const auto& [place, number] : places)
    order_.push_back(number), level.push_back(boxes[static_cast<std::size_t>(number)]);
  while (levels_.empty() || level.size() > 1) {
    std::vector<Eigen::AlignedBox3d> next((level.size() + kWidth - 1) / kWidth);
    for (std::size_t i = 0; i < level.size(); ++i) next[i / kWidth].extend(level[i]);
    levels_.push_back(next);
    level = std::move(next);
  }
}

}  // namespace limber::internal
