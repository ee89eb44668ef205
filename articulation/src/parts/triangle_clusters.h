/// @file triangle_clusters.h
/// Boxes around triangles that lie together, for questions that most of a surface does not matter to. Private to the
/// articulation module.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <span>
#include <vector>

#include "limber/mesh/surface_mesh.h"

namespace limber::internal {

/// The triangles of a surface along a space-filling curve (Morton's), eight to a box, eight boxes to the next.
class TriangleClusters {
 public:
  /// @param caps numbered after the surface's own triangles, over its vertices
  explicit TriangleClusters(const SurfaceMesh& surface, std::span<const Triangle> caps = {});

  /// Calls use(triangles) for the smallest clusters in boxes that may_matter(box) lets through on every level.
  template <class MayMatter, class Use>
  void visit(MayMatter&& may_matter, Use&& use) const {
    if (!order_.empty()) visit_box(levels_.size() - 1, 0, may_matter, use);
  }

 private:
  static constexpr std::size_t kWidth = 8;

  template <class MayMatter, class Use>
  void visit_box(std::size_t level, std::size_t number, MayMatter& may_matter, Use& use) const {
    if (!may_matter(levels_[level][number])) return;
    const std::size_t first = kWidth * number;
    if (level == 0) return use(std::span(order_).subspan(first, std::min(kWidth, order_.size() - first)));
    const std::size_t end = std::min(first + kWidth, levels_[level - 1].size());
    for (std::size_t i = first; i < end; ++i) visit_box(level - 1, i, may_matter, use);
  }

  std::vector<Index> order_;                              ///< along the curve
  std::vector<std::vector<Eigen::AlignedBox3d>> levels_;  ///< smallest first; the last has one box
};

}  // namespace limber::internal
