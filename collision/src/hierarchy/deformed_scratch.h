// What a DeformedSurface keeps, for the files that walk its tree box by box.
#pragma once

#include <optional>
#include <vector>

#include "hierarchy/bounds_kernels.h"
#include "limber/collision/deformed_surface.h"

namespace limber {

struct DeformedSurface::Scratch {
  struct Vertex {
    Vec3 p;
    std::uint32_t stamp = 0;
  };

  /// Of a surface with a skin.
  struct Skinned {
    std::optional<SkinPose> pose{};
    double flexed = 0.0;   ///< no |Ũ z| is larger, m
    double carried = 0.0;  ///< size of what handles add to a vertex, for round-off, m
    std::vector<double> rates{};
  };

  std::uint32_t stamp = 0;  ///< of this state

  AlignedArray<internal::NodeBox> boxes;
  AlignedArray<internal::NodeBox>
      triangle_boxes;  ///< in the tree's order; rounded to nearest, so to be grown by who uses them
  std::vector<Vertex> vertices;
  AlignedArray<double> z;  ///< padded with zeros to the rows' stride, as are the next
  AlignedArray<float> amplitudes, magnitudes;
  float norm = 0.0f;
  double farthest = 0.0;
  Skinned skinned{};
};

namespace internal {

/// Direct access to the boxes of one state.
class BoxReader {
 public:
  explicit BoxReader(DeformedSurface& surface) : surface_(surface), scratch_(*surface.scratch_) {}

  const NodeBox& operator()(Index node) {
    const NodeBox& box = scratch_.boxes[static_cast<std::size_t>(node)];
    if (box.stamp != scratch_.stamp) surface_.make_box(node);
    return box;
  }
  /// Both, in a row. @param child the first of two
  const NodeBox* siblings(Index child) { return &(*this)(child); }
  /// Of the triangles of a leaf, in their order there.
  const NodeBox* triangle_boxes(Index leaf) {
    const NodeBox* boxes = scratch_.triangle_boxes.data() + surface().node(leaf).first;
    if (boxes->stamp != scratch_.stamp) surface_.make_triangle_boxes(leaf);
    return boxes;
  }
  const CollisionSurface& surface() const { return *surface_.surface_; }
  double farthest() const { return scratch_.farthest; }  ///< no vertex is moved by more, m
  /// c ± h: the box at rest.
  Aabb rest_box(Index node) const {
    const float* c = surface().bounds_.constants.data() + static_cast<std::size_t>(node) * kNodeConstants;
    const Vec3 center(c[0], c[1], c[2]), half(c[4], c[5], c[6]);
    return {center - half, center + half};
  }

 private:
  DeformedSurface& surface_;
  DeformedSurface::Scratch& scratch_;
};

}  // namespace internal
}  // namespace limber
