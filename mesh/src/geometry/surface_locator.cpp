#include "limber/mesh/surface_locator.h"

#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "limber/core/error.h"
#include "limber/mesh/closest_point.h"
#include "limber/mesh/corner_tree.h"

namespace limber {

struct SurfaceLocator::Tree : CornerTree<3> {};

SurfaceLocator::SurfaceLocator(std::span<const Vec3> vertices, std::span<const Triangle> triangles) {
  if (triangles.empty()) throw InvalidArgument("SurfaceLocator: the surface has no triangles");
  std::vector<TrianglePoints> all;
  all.reserve(triangles.size());
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    TrianglePoints corners;
    for (std::size_t i = 0; i < 3; ++i) {
      const auto v = static_cast<std::size_t>(triangles[t][i]);
      if (triangles[t][i] < 0 || v >= vertices.size())
        throw InvalidArgument("SurfaceLocator: triangle " + std::to_string(t) + " names vertex " +
                              std::to_string(triangles[t][i]) + ", expected 0 to " + std::to_string(vertices.size()) +
                              " exclusive");
      corners[i] = vertices[v];
    }
    all.push_back(corners);
  }
  auto tree = std::make_unique<Tree>();
  tree->build(all);
  tree_ = std::move(tree);
}

SurfaceLocator::~SurfaceLocator() = default;
SurfaceLocator::SurfaceLocator(SurfaceLocator&&) noexcept = default;
SurfaceLocator& SurfaceLocator::operator=(SurfaceLocator&&) noexcept = default;

SurfaceLocation SurfaceLocator::nearest(const Vec3& p) const {
  SurfaceLocation found;
  double least = std::numeric_limits<double>::infinity();  // squared distance
  tree_->search(
      p, [&] { return least; }, [](std::size_t) { return true; },
      [&](Index i) {
        const SurfaceFoot foot = closest_on_triangle(p, tree_->corners(i));
        const double squared = (foot.point - p).squaredNorm();
        const Index triangle = tree_->element(i);
        if (std::pair(squared, triangle) >= std::pair(least, found.triangle)) return;
        least = squared;
        found = {triangle, foot.weight, 0.0};
      });
  found.distance = std::sqrt(least);
  return found;
}

}  // namespace limber
