/// @file limber/collision/collision_surface.h
/// What touches, of one geometry: triangles, their neighbours, the rows of U, and a tree over them. Nothing in it
/// changes; all bodies of one geometry share it. Where a body is and how it is bent is DeformedSurface's part.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "limber/collision/aabb.h"
#include "limber/collision/tree_node.h"
#include "limber/core/aligned_array.h"
#include "limber/core/types.h"
#include "limber/dynamics/body_shape.h"
#include "limber/dynamics/skin_extent.h"
#include "limber/model/modal_model.h"
#include "limber/model/shape.h"

namespace limber {

namespace internal {
class BoxReader;
}

/// An undirected edge between two (canonical) vertices.
struct SurfaceEdge {
  std::array<Index, 2> vertices{-1, -1};  ///< ascending; equal where a triangle has two corners at one place
  Index first_triangle = 0;               ///< see CollisionSurface::edge_triangles()
  Index triangle_count = 0;               ///< 1: boundary; 2: inside a surface; more: not a manifold. 0: equal vertices

  bool boundary() const { return triangle_count == 1; }
};

struct CollisionSurfaceOptions {
  int leaf_triangles = 4;  ///< most triangles of a leaf, 1 to 64
  bool skin = false;       ///< the body bends by its model's modal skin
};

/// Immutable, checked, shared through std::shared_ptr<const CollisionSurface>.
///
/// A vertex of the body is at p_BP = r + Σ_i z_i u_i(r), r in double, u in float as the asset stores it, or where its
/// modal skin has it (skin_pose.h); all else that collision/ says about a deformed body is meant to the last bits of
/// that. Vertices at equal places with equal shapes (a seam of a render surface) are one: canonical_vertex() is the
/// lowest of them, and triangles name that one only.
///
class CollisionSurface {
 public:
  /// The model's collision surface, k modes. @throws InvalidArgument also for a model that is not touchable, and for a
  /// skin that the model has not
  explicit CollisionSurface(std::shared_ptr<const ModalModel> model, const CollisionSurfaceOptions& options = {});
  /// Rigid surfaces: no modes. @throws InvalidArgument what validate(Shape) throws, or where the options are out of
  /// range or a coordinate is beyond 1e30 m; the same above.
  explicit CollisionSurface(const TriangleMesh& mesh, const CollisionSurfaceOptions& options = {});
  explicit CollisionSurface(const HeightField& field, const CollisionSurfaceOptions& options = {});
  explicit CollisionSurface(const Box& box, const CollisionSurfaceOptions& options = {});

  /// Null for a rigid surface.
  const std::shared_ptr<const ModalModel>& model() const { return model_; }
  /// Null for one that bends by its modes alone.
  const ModalSkin* skin() const { return skin_ ? &*model_->data().skin : nullptr; }
  const SkinInfluences& influences(Index vertex) const {
    return skin_influences(*model_, SurfacePoint::Surface::kCollision)[static_cast<std::size_t>(vertex)];
  }
  const SkinExtent* skin_extent() const { return skin_ ? &skin_->extent : nullptr; }
  Index modes() const { return modes_; }
  Index vertices() const { return static_cast<Index>(rest_.size()); }
  Index triangles() const { return static_cast<Index>(triangles_.size()); }

  const Vec3& rest(Index vertex) const { return rest_[static_cast<std::size_t>(vertex)]; }
  const Aabb& rest_bounds() const { return rest_bounds_; }
  /// modes() floats (and zeros up to VertexRows::stride()): u along a body axis per unit amplitude; null for k = 0.
  const float* row(Index vertex, int axis) const {
    return modes_ > 0 ? model_->collision_rows().row(vertex, axis) : nullptr;
  }
  /// Largest |u_i| of any vertex, rounded up, kg^−½: no vertex moves by more than Σ_i |z_i| of these. With a skin
  /// largest |Ũ_i|: what moves vertices beside their handles.
  double largest_shape(Index mode) const { return bounds_.largest_shape[static_cast<std::size_t>(mode)]; }

  // -- Topology ------------------------------------------------------------------------------------------------------
  /// Canonical vertices, counter-clockwise seen from outside. Triangle t is triangle t of the asset or shape.
  const Triangle& triangle(Index t) const { return triangles_[static_cast<std::size_t>(t)]; }
  Index canonical_vertex(Index v) const { return topology_.canonical[static_cast<std::size_t>(v)]; }
  Index edges() const { return static_cast<Index>(topology_.edges.size()); }
  const SurfaceEdge& edge(Index e) const { return topology_.edges[static_cast<std::size_t>(e)]; }
  /// Triangles that share an edge, ascending.
  std::span<const Index> edge_triangles(Index e) const {
    return std::span(topology_.edge_triangles)
        .subspan(static_cast<std::size_t>(edge(e).first_triangle), static_cast<std::size_t>(edge(e).triangle_count));
  }
  /// The edge from corner `corner` to the next one of a triangle.
  Index edge_of(Index t, int corner) const {
    return topology_.triangle_edges[static_cast<std::size_t>(t)][static_cast<std::size_t>(corner)];
  }
  /// The other triangle at edge_of(t, corner); −1 where there is none, or more than one.
  Index neighbour(Index t, int corner) const;
  /// Triangles that have a canonical vertex as a corner, ascending; none for any other vertex.
  std::span<const Index> vertex_triangles(Index v) const { return topology_.vertex_triangles[v]; }
  /// Canonical vertices joined to one by an edge, ascending.
  std::span<const Index> vertex_neighbours(Index v) const { return topology_.vertex_neighbours[v]; }
  /// The lowest vertex of each part that hangs together by edges, ascending.
  std::span<const Index> component_vertices() const { return topology_.component_vertices; }
  /// Bounds a solid: as many triangles run through an edge one way as the other. They are two, or more where parts of
  /// the solid meet in an edge, as simplification may leave them.
  bool closed() const { return topology_.closed; }
  /// Whether two triangles have a (canonical) vertex in common.
  bool adjacent(Index t, Index u) const;

  // -- Tree ----------------------------------------------------------------------------------------------------------
  /// Node 0 is the root. The tree is balanced: no deeper than kMaxDepth.
  std::span<const TreeNode> nodes() const { return tree_.nodes; }
  const TreeNode& node(Index n) const { return tree_.nodes[static_cast<std::size_t>(n)]; }
  static constexpr int kMaxDepth = 32;
  /// Triangles below a node.
  std::span<const Index> node_triangles(Index n) const {
    return std::span(tree_.triangle_order)
        .subspan(static_cast<std::size_t>(node(n).first), static_cast<std::size_t>(node(n).count));
  }

 private:
  friend class DeformedSurface;
  friend class internal::BoxReader;

  /// One list per key, one behind the other in `items`.
  template <class Item>
  struct Lists {
    std::vector<Item> items;
    std::vector<std::size_t> start;  // of each key's list, and the end of the last
    std::span<const Item> operator[](Index key) const {
      const auto k = static_cast<std::size_t>(key);
      return std::span(items).subspan(start[k], start[k + 1] - start[k]);
    }
  };
  static Lists<Index> lists(std::vector<std::pair<Index, Index>> pairs, Index keys);

  struct Topology {
    std::vector<Index> canonical;
    std::vector<SurfaceEdge> edges;
    std::vector<Index> edge_triangles;
    std::vector<std::array<Index, 3>> triangle_edges;
    Lists<Index> vertex_triangles, vertex_neighbours;
    std::vector<Index> component_vertices;
    bool closed = false;
  };

  struct Tree {
    std::vector<TreeNode> nodes;
    std::vector<Index> triangle_order;  ///< nodes' ranges are of it
  };

  /// What a body that bends by a modal skin has beside.
  struct Skin {
    explicit Skin(const ModalModel& model);
    std::vector<float> undeformed;  ///< Ũ, [vertex][axis][mode]
    SkinExtent extent;
    Lists<std::uint8_t> node_handles;  ///< that the vertices below a node hang on
  };

  /// Bounds of a node as a function of the amplitudes, see docs/collision.md; with a skin those of r + Ũ z, for the
  /// node's handles to turn and carry:
  ///   center = c + C z,  half extents = h + min(Σ_i d_i |z_i|, e ‖z‖_w)         per axis
  /// rounded so that the box, evaluated in single precision, encloses the vertices evaluated in double.
  struct Bounds {
    std::vector<double> largest_shape;
    std::vector<double> weights;    ///< w of the norm ‖z‖_w² = Σ w_i z_i²: λ_i where positive
    std::vector<double> scale;      ///< of each mode, a power of two: C and d are stored divided by it
    std::size_t stride = 0;         ///< of the rows of C and d: modes, padded
    AlignedArray<float> constants;  ///< per node c, h, e
    /// Per node six rows, C x, y, z, d x, y, z, as half floats: the boxes of a large body are bound by reading them.
    AlignedArray<std::uint16_t> coefficients;
  };

  void build(std::vector<Triangle> triangles, const CollisionSurfaceOptions& options);
  void check_range() const;
  void find_canonical_vertices();
  void build_edges();
  void build_vertex_adjacency();
  void build_tree(int leaf_triangles);
  void scale_modes();
  void build_bounds();
  void bound_node(std::size_t n, int axis, std::span<const Index> below);
  void list_handles(std::span<const Index> below);
  void find_undeformed_rows();
  const float* bounded_row(Index vertex, int axis) const {
    if (!skin_) return row(vertex, axis);
    const std::size_t at = 3 * static_cast<std::size_t>(vertex) + static_cast<std::size_t>(axis);
    return skin_->undeformed.data() + at * static_cast<std::size_t>(modes_);
  }

  std::shared_ptr<const ModalModel> model_;
  Index modes_ = 0;
  std::vector<Vec3> rest_;
  Aabb rest_bounds_;
  double rest_radius_ = 0.0;  ///< largest distance of a vertex from the origin, m
  std::vector<Triangle> triangles_;
  Topology topology_;
  Tree tree_;
  Bounds bounds_;
  std::optional<Skin> skin_;
};

}  // namespace limber
