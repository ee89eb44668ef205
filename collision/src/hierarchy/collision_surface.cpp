#include "limber/collision/collision_surface.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <tuple>
#include <utility>

#include "hierarchy/bounds_kernels.h"
#include "limber/core/disjoint_sets.h"
#include "limber/core/error.h"

namespace limber {
namespace {

std::vector<Triangle> grid_triangles(Index columns, Index rows) {
  std::vector<Triangle> triangles;
  for (Index j = 0; j + 1 < rows; ++j)
    for (Index i = 0; i + 1 < columns; ++i) {
      const Index v = j * columns + i;
      triangles.push_back({v, v + 1, v + columns + 1});
      triangles.push_back({v, v + columns + 1, v + columns});
    }
  return triangles;
}

}  // namespace

/// Of pairs (key, item): the items of each key, ascending and without repetition.
CollisionSurface::Lists<Index> CollisionSurface::lists(std::vector<std::pair<Index, Index>> pairs, Index keys) {
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  Lists<Index> result;
  result.items.reserve(pairs.size());
  result.start.assign(static_cast<std::size_t>(keys) + 1, 0);
  for (const auto& [key, item] : pairs) {
    result.items.push_back(item);
    ++result.start[static_cast<std::size_t>(key) + 1];
  }
  for (std::size_t i = 1; i < result.start.size(); ++i) result.start[i] += result.start[i - 1];
  return result;
}

CollisionSurface::CollisionSurface(std::shared_ptr<const ModalModel> model, const CollisionSurfaceOptions& options)
    : model_(std::move(model)) {
  if (!model_) throw InvalidArgument("CollisionSurface: the model is null, expected one");
  if (!model_->data().touchable)
    throw InvalidArgument("CollisionSurface: \"" + model_->name() + "\" is not touchable, expected a model that is");
  modes_ = model_->modes();
  const ModalSurface& surface = model_->collision();
  for (const Vec3f& r : surface.rest) rest_.push_back(r.cast<double>());
  if (options.skin && !model_->data().skin)
    throw InvalidArgument("CollisionSurface: model \"" + model_->name() + "\" has no modal skin, expected one");
  if (options.skin && modes_ > 0) {
    skin_.emplace(*model_);
    find_undeformed_rows();
  }
  scale_modes();
  build(surface.triangles, options);
}

CollisionSurface::Skin::Skin(const ModalModel& model) : extent(model) {}

void CollisionSurface::scale_modes() {
  for (Index m = 0; m < modes_; ++m) {
    double largest = 0.0;
    for (Index v = 0; v < vertices(); ++v) {
      const auto u = [&](int axis) { return static_cast<double>(bounded_row(v, axis)[m]); };
      largest = std::max(largest, Vec3(u(0), u(1), u(2)).norm());
    }
    bounds_.largest_shape.push_back(largest * (1.0 + 1e-15));
    bounds_.scale.push_back(largest > 0.0 ? std::exp2(std::ceil(std::log2(largest))) : 1.0);
  }
  double positive = 1.0;
  for (const double lambda : model_->data().eigenvalues)
    if (lambda > 0.0) {
      positive = lambda;  // ascending: the first is the least
      break;
    }
  for (const double lambda : model_->data().eigenvalues) bounds_.weights.push_back(lambda > 0.0 ? lambda : positive);
}

/// Ũ of every vertex, from what the skin makes of unit amplitudes.
void CollisionSurface::find_undeformed_rows() {
  const ModalSurface& surface = model_->collision();
  const auto k = static_cast<std::size_t>(modes_);
  skin_->undeformed.resize(3 * k * rest_.size());
  SkinPose pose(*model_->data().skin);
  std::vector<double> unit(k, 0.0);
  for (std::size_t m = 0; m < k; ++m) {
    unit[m] = 1.0;
    pose.set(unit);
    for (std::size_t v = 0; v < rest_.size(); ++v) {
      const auto at = static_cast<Index>(v);
      const Vec3 u = surface.basis.shape(at, static_cast<Index>(m)).cast<double>();
      const Vec3 own = pose.undeformed_part(influences(at), rest_[v], u) - rest_[v];
      for (std::size_t axis = 0; axis < 3; ++axis)
        skin_->undeformed[(3 * v + axis) * k + m] = static_cast<float>(own[static_cast<Index>(axis)]);
    }
    unit[m] = 0.0;
  }
}

CollisionSurface::CollisionSurface(const TriangleMesh& mesh, const CollisionSurfaceOptions& options)
    : rest_(mesh.vertices) {
  validate(Shape(mesh));
  build(mesh.triangles, options);
}

CollisionSurface::CollisionSurface(const HeightField& field, const CollisionSurfaceOptions& options) {
  validate(Shape(field));
  for (Index j = 0; j < field.rows; ++j)
    for (Index i = 0; i < field.columns; ++i)
      rest_.emplace_back(i * field.spacing_x, j * field.spacing_y,
                         field.heights[static_cast<std::size_t>(j) * static_cast<std::size_t>(field.columns) +
                                       static_cast<std::size_t>(i)]);
  build(grid_triangles(field.columns, field.rows), options);
}

CollisionSurface::CollisionSurface(const Box& box, const CollisionSurfaceOptions& options) {
  validate(Shape(box));
  const Vec3& h = box.half_extents;
  for (int i = 0; i < 8; ++i)
    rest_.emplace_back(i & 1 ? h.x() : -h.x(), i & 2 ? h.y() : -h.y(), i & 4 ? h.z() : -h.z());
  build({{0, 2, 3},
         {0, 3, 1},
         {4, 5, 7},
         {4, 7, 6},
         {0, 1, 5},
         {0, 5, 4},
         {2, 6, 7},
         {2, 7, 3},
         {0, 4, 6},
         {0, 6, 2},
         {1, 3, 7},
         {1, 7, 5}},
        options);
}

void CollisionSurface::build(std::vector<Triangle> triangles, const CollisionSurfaceOptions& options) {
  if (options.leaf_triangles < 1 || options.leaf_triangles > 64)
    throw InvalidArgument("CollisionSurface: leaf_triangles is " + std::to_string(options.leaf_triangles) +
                          ", expected 1 to 64");
  triangles_ = std::move(triangles);
  check_range();
  find_canonical_vertices();
  build_edges();
  build_vertex_adjacency();
  build_tree(options.leaf_triangles);
  build_bounds();
}

void CollisionSurface::check_range() const {
  for (std::size_t v = 0; v < rest_.size(); ++v)
    if (!(rest_[v].cwiseAbs().maxCoeff() <= internal::kFarthest))
      throw InvalidArgument("CollisionSurface: vertex " + std::to_string(v) + " lies beyond 1e30 m, expected nearer");
}

void CollisionSurface::find_canonical_vertices() {
  const auto before = [&](Index a, Index b) {
    const Vec3 &r = rest(a), &s = rest(b);
    for (int axis = 0; axis < 3; ++axis)
      if (r[axis] != s[axis]) return r[axis] < s[axis];
    if (modes_ > 0)
      for (int axis = 0; axis < 3; ++axis) {
        const float *u = row(a, axis), *w = row(b, axis);
        const auto [p, q] = std::mismatch(u, u + modes_, w);
        if (p != u + modes_) return *p < *q;
      }
    return false;
  };
  std::vector<Index> order(rest_.size());
  for (std::size_t v = 0; v < order.size(); ++v) order[v] = static_cast<Index>(v);
  std::sort(order.begin(), order.end(), [&](Index a, Index b) { return before(a, b) || (!before(b, a) && a < b); });
  topology_.canonical.resize(rest_.size());
  for (std::size_t i = 0, first = 0; i < order.size(); ++i) {
    if (before(order[first], order[i])) first = i;
    topology_.canonical[static_cast<std::size_t>(order[i])] = order[first];  // the first of equals is the lowest
  }
  for (Triangle& t : triangles_)
    for (Index& v : t) v = canonical_vertex(v);
}

void CollisionSurface::build_edges() {
  struct HalfEdge {
    std::array<Index, 2> vertices;
    Index triangle;
    int corner;
    bool reversed;
  };
  std::vector<HalfEdge> half_edges;
  for (Index t = 0; t < triangles(); ++t)
    for (int corner = 0; corner < 3; ++corner) {
      const Index a = triangle(t)[static_cast<std::size_t>(corner)],
                  b = triangle(t)[static_cast<std::size_t>((corner + 1) % 3)];
      half_edges.push_back({{std::min(a, b), std::max(a, b)}, t, corner, b < a});
    }
  std::sort(half_edges.begin(), half_edges.end(), [](const HalfEdge& x, const HalfEdge& y) {
    return std::tie(x.vertices, x.triangle, x.corner) < std::tie(y.vertices, y.triangle, y.corner);
  });
  topology_.triangle_edges.resize(triangles_.size());
  topology_.closed = true;
  for (std::size_t first = 0, last; first < half_edges.size(); first = last) {
    SurfaceEdge edge{.vertices = half_edges[first].vertices,
                     .first_triangle = static_cast<Index>(topology_.edge_triangles.size())};
    Index reversed = 0;
    for (last = first; last < half_edges.size() && half_edges[last].vertices == edge.vertices; ++last) {
      const HalfEdge& half = half_edges[last];
      topology_.triangle_edges[static_cast<std::size_t>(half.triangle)][static_cast<std::size_t>(half.corner)] =
          edges();
      const auto& [a, b, c] = triangle(half.triangle);
      if (a == b || b == c || c == a) continue;  // a needle without inside connects nothing
      topology_.edge_triangles.push_back(half.triangle);
      ++edge.triangle_count;
      reversed += half.reversed ? 1 : 0;
    }
    if (edge.triangle_count != 2 * reversed) topology_.closed = false;
    topology_.edges.push_back(edge);
  }
}

void CollisionSurface::build_vertex_adjacency() {
  std::vector<std::pair<Index, Index>> of_triangles, of_vertices;
  DisjointSets parts(rest_.size());
  for (Index t = 0; t < triangles(); ++t)
    for (const Index v : triangle(t)) of_triangles.emplace_back(v, t);
  for (const SurfaceEdge& e : topology_.edges)
    if (e.vertices[0] != e.vertices[1]) {
      of_vertices.emplace_back(e.vertices[0], e.vertices[1]);
      of_vertices.emplace_back(e.vertices[1], e.vertices[0]);
      parts.join(e.vertices[0], e.vertices[1]);
    }
  topology_.vertex_triangles = lists(std::move(of_triangles), vertices());
  topology_.vertex_neighbours = lists(std::move(of_vertices), vertices());
  for (Index v = 0; v < vertices(); ++v)
    if (parts.root(v) == v && !vertex_neighbours(v).empty()) topology_.component_vertices.push_back(v);
}

Index CollisionSurface::neighbour(Index t, int corner) const {
  const std::span<const Index> both = edge_triangles(edge_of(t, corner));
  if (both.size() != 2) return -1;
  if (both[0] == t) return both[1];
  return both[1] == t ? both[0] : -1;
}

bool CollisionSurface::adjacent(Index t, Index u) const {
  for (const Index v : triangle(t))
    for (const Index w : triangle(u))
      if (v == w) return true;
  return false;
}

}  // namespace limber
