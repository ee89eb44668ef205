#include "local_size.h"

#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Simple_cartesian.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace limber::internal {
namespace {

using Kernel = CGAL::Simple_cartesian<double>;  // a thickness needs no exact predicates
using Triangles = std::vector<Kernel::Triangle_3>;
using Tree =
    CGAL::AABB_tree<CGAL::AABB_traits<Kernel, CGAL::AABB_triangle_primitive<Kernel, Triangles::const_iterator>>>;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kFacing = -0.5;  // cosine of the least angle between the normals of two triangles that face each other
constexpr double kGrowth = 0.5;
constexpr std::size_t kLeafSize = 8;
constexpr int kMostSubdivisions = 200;  // of one edge
// Nodes per h² of boundary and per h³ of volume, measured: docs/tetrahedralisation.md.
constexpr double kNodesPerArea = 2.5;
constexpr double kNodesPerVolume = 0.6;

Vec3 unit_normal(const std::array<Vec3, 3>& t) { return (t[1] - t[0]).cross(t[2] - t[0]).normalized(); }

/// Distances at which rays from a point meet triangles that face it.
class FacingTriangles {
 public:
  explicit FacingTriangles(const SurfaceMesh& surface) {
    for (const Triangle& t : surface.triangles) {
      std::array<Vec3, 3> corners;
      for (int a = 0; a < 3; ++a) corners[a] = surface.vertices[t[a]];
      triangles_.emplace_back(point(corners[0]), point(corners[1]), point(corners[2]));
      corners_.push_back(corners);
      normals_.push_back(unit_normal(corners));
    }
    tree_.insert(triangles_.cbegin(), triangles_.cend());
    tree_.build();
  }

  const std::array<Vec3, 3>& corners(std::size_t triangle) const { return corners_[triangle]; }

  /// @return +∞ beyond `farthest`
  double nearest(std::size_t from, const Vec3& p, const Vec3& direction, double farthest) const {
    double nearest = kInfinity;
    std::vector<Tree::Primitive_id> hit;
    tree_.all_intersected_primitives(Kernel::Segment_3(point(p), point(p + farthest * direction)),
                                     std::back_inserter(hit));
    for (const auto& h : hit) {
      const auto i = static_cast<std::size_t>(h - triangles_.cbegin());
      const double facing = normals_[i].dot(normals_[from]);
      if (i == from || !(facing < kFacing)) continue;
      const double t = normals_[i].dot(corners_[i][0] - p) / normals_[i].dot(direction);
      if (t > 0.0) nearest = std::min(nearest, t);
    }
    return nearest;
  }

  const Vec3& normal(std::size_t triangle) const { return normals_[triangle]; }

 private:
  static Kernel::Point_3 point(const Vec3& p) { return {p.x(), p.y(), p.z()}; }

  Triangles triangles_;
  std::vector<std::array<Vec3, 3>> corners_;
  std::vector<Vec3> normals_;
  Tree tree_;
};

/// Calls visit(middle) for the middles of n² equal triangles that make up one.
template <class Visit>
void for_each_patch(const std::array<Vec3, 3>& t, int n, const Visit& visit) {
  for (int i = 0; i < n; ++i)
    for (int j = 0; i + j < n; ++j)
      for (const double third : {1.0 / 3.0, 2.0 / 3.0}) {
        if (third > 0.5 && i + j + 1 >= n) continue;  // the last of a row has no downward neighbour
        const double u = (i + third) / n, v = (j + third) / n;
        visit(Vec3(t[0] + u * (t[1] - t[0]) + v * (t[2] - t[0])));
      }
}

int subdivisions(const std::array<Vec3, 3>& t, double spacing) {
  const double longest = std::max({(t[1] - t[0]).norm(), (t[2] - t[1]).norm(), (t[0] - t[2]).norm()});
  return static_cast<int>(std::clamp(std::ceil(longest / spacing), 1.0, double{kMostSubdivisions}));
}

}  // namespace

std::vector<ThicknessSample> sample_thickness(const SurfaceMesh& surface, double spacing, double farthest) {
  const FacingTriangles facing(surface);
  std::vector<ThicknessSample> samples;
  for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
    const auto& t = facing.corners(i);
    const int n = subdivisions(t, spacing);
    const double area = 0.5 * (t[1] - t[0]).cross(t[2] - t[0]).norm() / (n * n);
    for_each_patch(t, n, [&](const Vec3& p) {
      const double inside = facing.nearest(i, p, -facing.normal(i), farthest);
      const double outside = facing.nearest(i, p, facing.normal(i), std::min(farthest, inside));
      samples.push_back({p, area, std::min(inside, outside)});
    });
  }
  return samples;
}

SizeField::SizeField(std::span<const ThicknessSample> samples, double largest, double smallest) : largest_(largest) {
  for (const ThicknessSample& s : samples)
    if (const double size = std::max(s.thickness, smallest); size < largest) sources_.push_back({s.position, size});
  if (!sources_.empty()) add_node(0, sources_.size());
}

std::size_t SizeField::add_node(std::size_t first, std::size_t count) {
  Node node{.low = sources_[first].position, .high = sources_[first].position, .least = largest_};
  for (std::size_t i = first; i < first + count; ++i) {
    node.low = node.low.cwiseMin(sources_[i].position);
    node.high = node.high.cwiseMax(sources_[i].position);
    node.least = std::min(node.least, sources_[i].size);
  }
  node.first = first;
  const std::size_t index = nodes_.size();
  nodes_.push_back(node);
  if (count <= kLeafSize) {
    nodes_[index].count = count;
    return index;
  }
  Eigen::Index axis = 0;
  (node.high - node.low).maxCoeff(&axis);
  const auto begin = sources_.begin() + static_cast<std::ptrdiff_t>(first);
  const std::size_t half = count / 2;
  std::nth_element(begin, begin + static_cast<std::ptrdiff_t>(half), begin + static_cast<std::ptrdiff_t>(count),
                   [axis](const Source& a, const Source& b) { return a.position[axis] < b.position[axis]; });
  add_node(first, half);
  nodes_[index].second_child = add_node(first + half, count - half);
  return index;
}

double SizeField::operator()(const Vec3& x) const {
  double size = largest_;
  if (nodes_.empty()) return size;
  const auto bound = [&](const Node& n) {
    return n.least + kGrowth * (n.low - x).cwiseMax(x - n.high).cwiseMax(Vec3::Zero()).norm();
  };
  std::array<std::size_t, 128> stack;
  std::size_t waiting = 0;
  stack[waiting++] = 0;
  while (waiting > 0) {
    const std::size_t at = stack[--waiting];
    const Node& node = nodes_[at];
    if (bound(node) >= size) continue;
    for (std::size_t i = node.first; i < node.first + node.count; ++i)
      size = std::min(size, sources_[i].size + kGrowth * (sources_[i].position - x).norm());
    if (node.count > 0) continue;
    std::size_t near = at + 1, far = node.second_child;
    if (bound(nodes_[far]) < bound(nodes_[near])) std::swap(near, far);
    stack[waiting++] = far;
    stack[waiting++] = near;
  }
  return size;
}

double expected_nodes(std::span<const ThicknessSample> samples, double volume, double largest, double smallest) {
  double on_boundary = 0.0;
  for (const ThicknessSample& s : samples)
    on_boundary += s.area / std::pow(std::clamp(s.thickness, smallest, largest), 2);
  return kNodesPerVolume * volume / std::pow(largest, 3) + kNodesPerArea * on_boundary;
}

}  // namespace limber::internal
