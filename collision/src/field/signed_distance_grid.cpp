#include "field/signed_distance_grid.h"

#include <algorithm>
#include <cmath>

#include "limber/mesh/closest_point.h"
#include "limber/mesh/surface_locator.h"
#include "tuning.h"

namespace limber::internal {
namespace {

// Which side of a closed surface at rest a point is on.
class RestSides {
 public:
  explicit RestSides(const CollisionSurface& surface)
      : surface_(surface), at_vertices_(static_cast<std::size_t>(surface.vertices()), Vec3::Zero()) {
    for (Index t = 0; t < surface.triangles(); ++t) {
      const TrianglePoints x = corners(t);
      const Vec3 n = unit_normal(x);
      normals_.push_back(n);
      for (std::size_t c = 0; c < 3; ++c) {
        const Vec3 u = x[(c + 1) % 3] - x[c], v = x[(c + 2) % 3] - x[c];
        at_vertices_[static_cast<std::size_t>(surface.triangle(t)[c])] += std::atan2(u.cross(v).norm(), u.dot(v)) * n;
      }
    }
  }

  TrianglePoints corners(Index t) const {
    const Triangle& v = surface_.triangle(t);
    return {surface_.rest(v[0]), surface_.rest(v[1]), surface_.rest(v[2])};
  }
  // @param t the triangle nearest to p
  double signed_distance(const Vec3& p, Index t) const {
    const SurfaceFoot foot = closest_on_triangle(p, corners(t));
    const Vec3 out = p - foot.point;
    return std::copysign(out.norm(), out.dot(normal_at(t, foot.feature)));
  }
  const Vec3& at_vertex(Index v) const { return at_vertices_[static_cast<std::size_t>(v)]; }

 private:
  Vec3 normal_at(Index t, const Feature& feature) const {
    const Vec3& n = normals_[static_cast<std::size_t>(t)];
    if (feature.kind == Feature::Kind::kVertex) return at_vertex(surface_.triangle(t)[feature.index]);
    if (feature.kind == Feature::Kind::kFace) return n;
    const Index other = surface_.neighbour(t, feature.index);
    return other < 0 ? n : Vec3(n + normals_[static_cast<std::size_t>(other)]);
  }

  const CollisionSurface& surface_;
  std::vector<Vec3> normals_, at_vertices_;
};

Aabb grown_by_cells(const Aabb& box, int cells) {
  // A cell is 1 / (cells − 4) of the longest side, so that two of them beyond either end make up `cells`.
  return box.grown(2.0 * (box.high - box.low).maxCoeff() / (cells - 4));
}

}  // namespace

RegularGrid::RegularGrid(const Aabb& box, int cells, int least_cells) {
  const Vec3 size = box.high - box.low;
  const double cell = size.maxCoeff() / cells;
  for (int axis = 0; axis < 3; ++axis) {
    const auto fit = static_cast<int>(std::ceil(size[axis] / cell * (1.0 - 1e-12)));
    const int along = std::max(fit, least_cells);
    cell_[axis] = fit < least_cells ? size[axis] / along : cell;
    origin_[axis] = 0.5 * (box.low[axis] + box.high[axis] - along * cell_[axis]);
    count_[static_cast<std::size_t>(axis)] = along + 1;
  }
}

GridView RegularGrid::view() const {
  GridView v{};
  for (int axis = 0; axis < 3; ++axis) {
    v.origin[axis] = static_cast<float>(origin_[axis]);
    v.inverse[axis] = static_cast<float>(1.0 / cell_[axis]);
    // Single precision tells a thousandth of a cell from the last node for up to some thousand cells.
    v.last[axis] = static_cast<float>(count_[static_cast<std::size_t>(axis)] - 1) - 1e-3f;
  }
  v.stride[0] = count_[1] * count_[2], v.stride[1] = count_[2];
  return v;
}

std::array<Index, 3> RegularGrid::nearest_node(const Vec3f& p) const {
  std::array<Index, 3> node;
  for (int axis = 0; axis < 3; ++axis) {
    const double along = (static_cast<double>(p[axis]) - origin_[axis]) / cell_[axis];
    const auto last = static_cast<double>(count_[static_cast<std::size_t>(axis)] - 1);
    node[static_cast<std::size_t>(axis)] = static_cast<Index>(std::clamp(along, 0.0, last) + 0.5);
  }
  return node;
}

std::array<Index, 3> RegularGrid::cell_of(const Vec3f& p) const {
  std::array<Index, 3> node;
  for (int axis = 0; axis < 3; ++axis) {
    const double along = (static_cast<double>(p[axis]) - origin_[axis]) / cell_[axis];
    const Index last = count_[static_cast<std::size_t>(axis)] - 2;
    node[static_cast<std::size_t>(axis)] = static_cast<Index>(std::clamp(along, 0.0, static_cast<double>(last)));
  }
  return node;
}

std::array<Index, 8> SignedDistanceGrid::triangles_about(const Vec3f& rest) const {
  const std::size_t lowest = grid_.number(grid_.cell_of(rest));
  const auto z = std::size_t{1}, y = static_cast<std::size_t>(grid_.count()[2]),
             x = y * static_cast<std::size_t>(grid_.count()[1]);
  const auto at = [&](std::size_t offset) { return nearest_[lowest + offset]; };
  return {at(0), at(z), at(y), at(y + z), at(x), at(x + z), at(x + y), at(x + y + z)};
}

SurfaceLocator locator_of(const CollisionSurface& surface) {
  std::vector<Vec3> vertices;
  std::vector<Triangle> triangles;
  for (Index v = 0; v < surface.vertices(); ++v) vertices.push_back(surface.rest(v));
  for (Index t = 0; t < surface.triangles(); ++t) triangles.push_back(surface.triangle(t));
  return {vertices, triangles};
}

SignedDistanceGrid::SignedDistanceGrid(const CollisionSurface& surface)
    : grid_(grown_by_cells(surface.rest_bounds(), collision_tuning().field.cells), collision_tuning().field.cells, 1) {
  const SurfaceLocator locator = locator_of(surface);
  const RestSides sides(surface);
  std::vector<double> distances(grid_.nodes());
  nearest_.resize(grid_.nodes());
  std::array<Index, 3> node;
  std::size_t i = 0;
  for (node[0] = 0; node[0] < grid_.count()[0]; ++node[0])
    for (node[1] = 0; node[1] < grid_.count()[1]; ++node[1])
      for (node[2] = 0; node[2] < grid_.count()[2]; ++node[2], ++i) {
        const Vec3 p = grid_.position(node);
        nearest_[i] = locator.nearest(p).triangle;
        distances[i] = sides.signed_distance(p, nearest_[i]);
      }
  double largest = 0.0;
  for (const double d : distances) largest = std::max(largest, std::abs(d));
  constexpr double kLargestNumber = 32767.0;
  unit_ = static_cast<float>(largest / kLargestNumber);
  const auto number = [&](std::size_t n) {
    const double d = distances[std::min(n, distances.size() - 1)];
    return static_cast<std::int32_t>(
        std::lround(std::clamp(d / static_cast<double>(unit_), -kLargestNumber, kLargestNumber)));
  };
  for (std::size_t n = 0; n < distances.size(); ++n)
    nodes_.push_back(static_cast<std::int32_t>((static_cast<std::uint32_t>(number(n)) & 0xffffu) |
                                               static_cast<std::uint32_t>(number(n + 1)) << 16));
}

DistanceView SignedDistanceGrid::view() const {
  DistanceView view;
  view.kind = DistanceView::Kind::kGrid;
  view.grid = grid_.view();
  view.nodes = nodes_.data();
  view.unit = unit_;
  return view;
}

double resolved_area(const CollisionSurface& surface, double cell) {
  const SurfaceLocator locator = locator_of(surface);
  const RestSides sides(surface);
  double area = 0.0, resolved = 0.0;
  for (Index v = 0; v < surface.vertices(); ++v) {
    const Vec3& n = sides.at_vertex(v);
    if (n.isZero()) continue;
    double around = 0.0, depth = 0.0;
    for (const Index t : surface.vertex_triangles(v)) {
      const TrianglePoints x = sides.corners(t);
      around += (x[1] - x[0]).cross(x[2] - x[0]).norm() / 6.0;
    }
    for (int step = 1; step <= 8 && depth < cell; ++step) {
      const Vec3 p = surface.rest(v) - 0.5 * step * cell / n.norm() * n;
      depth = std::max(depth, -sides.signed_distance(p, locator.nearest(p).triangle));
    }
    area += around;
    if (depth >= cell) resolved += around;
  }
  return area > 0.0 ? resolved / area : 0.0;
}

}  // namespace limber::internal
