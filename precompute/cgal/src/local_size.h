// How small cells must be where a body, or a gap beside it, is thin.
#pragma once

#include <span>
#include <vector>

#include "limber/mesh/surface_mesh.h"

namespace limber::internal {

/// A patch of a surface and how far the surface is from itself there.
struct ThicknessSample {
  Vec3 position;
  double area = 0.0;       ///< of the patch, m²
  double thickness = 0.0;  ///< m; of the body or of the gap outside it, whichever is less; > 0, may be +∞
};

/// Patches of side about `spacing`. The thickness of a patch is the length of the shortest segment along its normal,
/// into the body or out of it, that ends on a triangle which faces the patch (normals more than 120° apart: the sides
/// of a wedge or the neighbours across an edge do not face each other); +∞ beyond `farthest`.
/// @param surface closed, oriented, without self-intersections
std::vector<ThicknessSample> sample_thickness(const SurfaceMesh& surface, double spacing, double farthest);

/// The largest cell that may lie at a point, m:
///
///   h(x) = min( h₀, minₛ max(tₛ, h₁) + g |x − xₛ| )                                                               (1)
///
/// over samples s of thickness tₛ, with growth g per metre of distance: h is Lipschitz, which Delaunay refinement asks
/// of a sizing field, and one cell fits across whatever is thicker than h₁.
class SizeField {
 public:
  /// @param largest h₀ > 0 @param smallest h₁ > 0
  SizeField(std::span<const ThicknessSample> samples, double largest, double smallest);
  double operator()(const Vec3& x) const;

 private:
  struct Source {
    Vec3 position;
    double size;
  };
  struct Node {
    Vec3 low, high;
    double least = 0.0;  ///< size of all sources below
    std::size_t second_child = 0, first = 0, count = 0;
  };
  std::size_t add_node(std::size_t first, std::size_t count);

  double largest_;
  std::vector<Source> sources_;  ///< smaller than h₀ only
  std::vector<Node> nodes_;      ///< in depth-first order: an inner node's first child follows it
};

/// Nodes that a mesh with cells of size (1) has, by its boundary and its volume.
double expected_nodes(std::span<const ThicknessSample> samples, double volume, double largest, double smallest);

}  // namespace limber::internal
