// The tree of a CollisionSurface and the bounds of its nodes as functions of the amplitudes; see docs/collision.md.
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include "hierarchy/bounds_kernels.h"
#include "limber/collision/collision_surface.h"

namespace limber {

using internal::kBoundsLanes;
using internal::kNodeConstants;

namespace {

constexpr double kSingleRoundOff = 0x1p-24;
/// What single precision may lose to underflow, per term, with flush-to-zero.
constexpr double kUnderflow = 0x1p-126;

/// Relative error of a sum of k + 1 rounded products of rounded factors, in any order; a few terms to spare.
double sum_error(Index modes) {
  const double n = static_cast<double>(modes) + 16.0;
  return n * kSingleRoundOff / (1.0 - n * kSingleRoundOff);
}

float nearest_above(double x) {
  const float f = static_cast<float>(x);
  return static_cast<double>(f) < x ? std::nextafter(f, std::numeric_limits<float>::infinity()) : f;
}

/// Bits of the least half float that is not less. @pre 0 ≤ x ≤ 60000
std::uint16_t half_rounded_up(double x) {
  Eigen::half h(static_cast<float>(x));
  if (static_cast<double>(static_cast<float>(h)) < x)
    ++h.x;  // the next one up: positive numbers ascend with their bits
  return h.x;
}

}  // namespace

void CollisionSurface::build_tree(int leaf_triangles) {
  std::vector<Vec3> centers;
  for (const auto& [a, b, c] : triangles_) centers.push_back((rest(a) + rest(b) + rest(c)) / 3.0);
  tree_.triangle_order.resize(triangles_.size());
  std::iota(tree_.triangle_order.begin(), tree_.triangle_order.end(), 0);
  tree_.nodes.push_back({.child = -1, .first = 0, .count = triangles()});
  std::vector<Index> open{0};
  while (!open.empty()) {
    const auto n = static_cast<std::size_t>(open.back());
    open.pop_back();
    const auto [child, first, count] = tree_.nodes[n];
    if (count <= leaf_triangles) continue;
    const auto begin = tree_.triangle_order.begin() + first;
    Aabb box;
    for (auto t = begin; t != begin + count; ++t) box.include(centers[static_cast<std::size_t>(*t)]);
    int axis = 0;
    box.half_extents().maxCoeff(&axis);
    // Halves of whole leaves, so that most leaves are full.
    const Index leaves = (count + leaf_triangles - 1) / leaf_triangles;
    const Index left = (leaves + 1) / 2 * leaf_triangles;
    std::nth_element(begin, begin + left, begin + count, [&](Index t, Index u) {
      const double x = centers[static_cast<std::size_t>(t)][axis], y = centers[static_cast<std::size_t>(u)][axis];
      return x != y ? x < y : t < u;
    });
    tree_.nodes[n].child = static_cast<Index>(tree_.nodes.size());
    tree_.nodes.push_back({.child = -1, .first = first, .count = left});
    tree_.nodes.push_back({.child = -1, .first = first + left, .count = count - left});
    open.push_back(tree_.nodes[n].child + 1);
    open.push_back(tree_.nodes[n].child);
  }
  for (const TreeNode& node : tree_.nodes)  // ascending within a leaf, whatever nth_element left
    if (node.leaf())
      std::sort(tree_.triangle_order.begin() + node.first, tree_.triangle_order.begin() + node.first + node.count);
  for (const Vec3& r : rest_) {
    rest_bounds_.include(r);
    rest_radius_ = std::max(rest_radius_, r.norm());
  }
}

void CollisionSurface::build_bounds() {
  const auto k = static_cast<std::size_t>(modes_);
  bounds_.stride = (k + kBoundsLanes - 1) / kBoundsLanes * kBoundsLanes;
  bounds_.constants = AlignedArray<float>(tree_.nodes.size() * kNodeConstants);
  bounds_.coefficients = AlignedArray<std::uint16_t>(tree_.nodes.size() * 6 * bounds_.stride);
  std::vector<Index> below;
  std::vector<std::size_t> seen(rest_.size(), tree_.nodes.size());
  for (std::size_t n = 0; n < tree_.nodes.size(); ++n) {
    below.clear();
    for (const Index t : node_triangles(static_cast<Index>(n)))
      for (const Index v : triangle(t))
        if (std::exchange(seen[static_cast<std::size_t>(v)], n) != n) below.push_back(v);
    for (int axis = 0; axis < 3; ++axis) bound_node(n, axis, below);
    if (skin_) list_handles(below);
  }
}

/// Those of the next node.
void CollisionSurface::list_handles(std::span<const Index> below) {
  Lists<std::uint8_t>& lists = skin_->node_handles;
  if (lists.start.empty()) lists.start.push_back(0);
  std::array<bool, ModalSkin::kMaxHandles + 1> named{};
  for (const Index v : below)
    for (std::size_t i = 0; i < SkinInfluences::kMost; ++i)
      if (influences(v).weight[i] > 0.0f) named[influences(v).handle[i]] = true;
  for (std::size_t h = 0; h < named.size(); ++h)
    if (named[h]) lists.items.push_back(static_cast<std::uint8_t>(h));
  lists.start.push_back(lists.items.size());
}

/// c, h, C and d are the middles and half ranges of the vertices' rest positions and of their rows; e is the largest
/// ‖(u − C) w^−½‖. The rounding of c + C z is at most error · (|c| + Σ|C_i||z_i|), which h, d and e take up; their own
/// sums are grown by (1 + error).
void CollisionSurface::bound_node(std::size_t n, int axis, std::span<const Index> below) {
  const auto k = static_cast<std::size_t>(modes_);
  const double error = sum_error(modes_);
  std::uint16_t* const C = bounds_.coefficients.data() + (n * 6 + static_cast<std::size_t>(axis)) * bounds_.stride;
  std::uint16_t* const d = C + 3 * bounds_.stride;
  std::vector<double> middle(k);
  double underflow = (static_cast<double>(modes_) + 8.0) * kUnderflow, center_energy = 0.0, energy = 0.0;

  double least = std::numeric_limits<double>::infinity(), greatest = -least;
  for (const Index v : below) least = std::min(least, rest(v)[axis]), greatest = std::max(greatest, rest(v)[axis]);
  const float c = static_cast<float>(0.5 * (least + greatest));
  const double half = std::max(greatest - static_cast<double>(c), static_cast<double>(c) - least);

  std::vector<float> low(k, std::numeric_limits<float>::infinity()), high(k, -std::numeric_limits<float>::infinity());
  for (const Index v : below) {
    const float* u = bounded_row(v, axis);
    for (std::size_t i = 0; i < k; ++i) low[i] = std::min(low[i], u[i]), high[i] = std::max(high[i], u[i]);
  }
  for (std::size_t i = 0; i < k; ++i) {
    const Eigen::half C_i(
        static_cast<float>(0.5 * (static_cast<double>(low[i]) + static_cast<double>(high[i])) / bounds_.scale[i]));
    C[i] = C_i.x;
    middle[i] = static_cast<double>(static_cast<float>(C_i)) * bounds_.scale[i];
    const double spread = std::max(high[i] - middle[i], middle[i] - low[i]) + error * std::abs(middle[i]);
    d[i] = half_rounded_up(spread * (1.0 + error) / bounds_.scale[i]);
    center_energy += middle[i] * middle[i] / bounds_.weights[i];
    underflow += kUnderflow * 4.0;  // of terms that are at most about the scale's
  }
  for (const Index v : below) {
    const float* u = bounded_row(v, axis);
    double sum = 0.0;
    for (std::size_t i = 0; i < k; ++i) {
      const double difference = static_cast<double>(u[i]) - middle[i];
      sum += difference * difference / bounds_.weights[i];
    }
    energy = std::max(energy, sum);
  }
  float* const constants = bounds_.constants.data() + n * kNodeConstants + static_cast<std::size_t>(axis);
  constants[0] = c;
  constants[4] = nearest_above((half + error * (std::abs(static_cast<double>(c)) + half)) * (1.0 + error) + underflow);
  constants[8] = nearest_above((std::sqrt(energy) + error * std::sqrt(center_energy)) * (1.0 + error));
}

}  // namespace limber
