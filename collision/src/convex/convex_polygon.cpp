#include "convex/convex_polygon.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <tuple>

namespace limber::internal {
namespace {

double squared_distance(const PlanePoint& a, const PlanePoint& b) {
  return (a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y);
}

std::array<std::size_t, 2> farthest_pair(const std::vector<PlanePoint>& hull) {
  std::array<std::size_t, 2> best{0, 0};
  double largest = -1.0;
  for (std::size_t i = 0; i < hull.size(); ++i)
    for (std::size_t j = i + 1; j < hull.size(); ++j)
      if (const double d = squared_distance(hull[i], hull[j]); d > largest) largest = d, best = {i, j};
  return best;
}

/// Runs over the corners after i; the corner between i and k farthest from line ik only moves forward with k (rotating
/// calipers), so that all pairs take O(corners²).
template <class Consider>
void for_each_diagonal(const std::vector<PlanePoint>& hull, const Consider& consider) {
  const std::size_t n = hull.size();
  const auto wrapped = [n](std::size_t i) { return i < n ? i : i - n; };  // all below are less than 2n
  const auto at = [&](std::size_t i) -> const PlanePoint& { return hull[wrapped(i)]; };
  for (std::size_t i = 0; i < n; ++i) {
    std::size_t right = i + 1, left = i + 2;
    for (std::size_t k = i + 2; k < i + n; ++k) {
      while (right + 1 < k && doubled_area(at(i), at(right + 1), at(k)) > doubled_area(at(i), at(right), at(k)))
        ++right;
      left = std::max(left, k + 1);
      while (left + 1 < i + n && doubled_area(at(i), at(k), at(left + 1)) > doubled_area(at(i), at(k), at(left)))
        ++left;
      consider(i, wrapped(right), wrapped(k), left < i + n ? wrapped(left) : i);
    }
  }
}

std::array<std::size_t, 3> largest_triangle(const std::vector<PlanePoint>& hull) {
  std::array<std::size_t, 3> best{};
  double largest = -1.0;
  for_each_diagonal(hull, [&](std::size_t i, std::size_t j, std::size_t k, std::size_t) {
    if (const double a = doubled_area(hull[i], hull[j], hull[k]); a > largest) largest = a, best = {i, j, k};
  });
  return best;
}

std::array<std::size_t, 4> largest_quadrilateral(const std::vector<PlanePoint>& hull) {
  std::array<std::size_t, 4> best{};
  double largest = -1.0;
  for_each_diagonal(hull, [&](std::size_t i, std::size_t j, std::size_t k, std::size_t l) {
    if (l == i) return;
    const double a = doubled_area(hull[i], hull[j], hull[k]) + doubled_area(hull[i], hull[k], hull[l]);
    if (a > largest) largest = a, best = {i, j, k, l};
  });
  return best;
}

/// Keeps the corners that are farthest in one of kMostCorners directions: none of the others is farther from their hull
/// than 1 − cos(π/kMostCorners), 0.12 %, of the extent.
void thin(std::vector<PlanePoint>& hull) {
  const std::size_t n = hull.size();
  std::array<std::size_t, kMostCorners> kept{};
  std::size_t count = 0, corner = 0;
  for (std::size_t d = 0; d < kMostCorners; ++d) {
    const double angle = 2.0 * std::numbers::pi * static_cast<double>(d) / kMostCorners;
    const auto height = [&](std::size_t i) {
      return std::cos(angle) * hull[i % n].x + std::sin(angle) * hull[i % n].y;
    };
    if (d == 0)
      for (std::size_t i = 1; i < n; ++i) corner = height(i) > height(corner) ? i : corner;
    while (height(corner + 1) > height(corner)) ++corner;
    if (count == 0 || kept[count - 1] != corner) kept[count++] = corner;
  }
  if (count > 1 && kept[count - 1] % n == kept[0] % n) --count;
  std::sort(kept.begin(), kept.begin() + static_cast<std::ptrdiff_t>(count),
            [&](std::size_t a, std::size_t b) { return a % n < b % n; });
  for (std::size_t i = 0; i < count; ++i) hull[i] = hull[kept[i] % n];  // kept[i] % n ≥ i
  hull.resize(count);
}

/// The corner that adds the largest triangle to some of the corners of a hull.
std::size_t most_growth(const std::vector<PlanePoint>& hull, const std::array<bool, kMostCorners>& taken) {
  const std::size_t n = hull.size();
  std::size_t best = n;
  double largest = -1.0;
  for (std::size_t i = 0; i < n; ++i) {
    if (taken[i]) continue;
    std::size_t before = i, after = i;
    while (!taken[before]) before = (before + n - 1) % n;
    while (!taken[after]) after = (after + 1) % n;
    if (const double a = doubled_area(hull[before], hull[i], hull[after]); a > largest) largest = a, best = i;
  }
  return best;
}

}  // namespace

void convex_hull(std::vector<PlanePoint>& points, std::vector<PlanePoint>& hull) {
  std::sort(points.begin(), points.end(), [](const PlanePoint& a, const PlanePoint& b) {
    return std::tie(a.x, a.y, a.item) < std::tie(b.x, b.y, b.item);
  });
  const auto same_place = [](const PlanePoint& a, const PlanePoint& b) { return a.x == b.x && a.y == b.y; };
  points.erase(std::unique(points.begin(), points.end(), same_place), points.end());
  hull.clear();
  const auto add = [&](const PlanePoint& p, std::size_t chain_start) {
    while (hull.size() >= chain_start + 2 && doubled_area(hull[hull.size() - 2], hull.back(), p) <= 0.0)
      hull.pop_back();
    hull.push_back(p);
  };
  for (const PlanePoint& p : points) add(p, 0);
  if (points.size() < 3) return;
  const std::size_t upper = hull.size() - 1;
  for (std::size_t i = points.size() - 1; i-- > 0;) add(points[i], upper);
  hull.pop_back();  // the first again
}

double area(const std::vector<PlanePoint>& polygon) {
  double sum = 0.0;
  for (std::size_t i = 2; i < polygon.size(); ++i) sum += doubled_area(polygon[0], polygon[i - 1], polygon[i]);
  return 0.5 * sum;
}

double diameter(const std::vector<PlanePoint>& polygon) {
  if (polygon.size() < 2) return 0.0;
  const auto [i, j] = farthest_pair(polygon);
  return std::sqrt(squared_distance(polygon[i], polygon[j]));
}

void largest_polygon(std::vector<PlanePoint>& hull, int count, std::vector<PlanePoint>& polygon) {
  if (hull.size() > kMostCorners) thin(hull);
  polygon.clear();
  if (hull.size() <= static_cast<std::size_t>(count)) {
    polygon.assign(hull.begin(), hull.end());
    return;
  }
  std::array<bool, kMostCorners> taken{};
  if (count == 1) taken[0] = true;
  if (count == 2)
    for (const std::size_t i : farthest_pair(hull)) taken[i] = true;
  if (count == 3)
    for (const std::size_t i : largest_triangle(hull)) taken[i] = true;
  if (count >= 4)
    for (const std::size_t i : largest_quadrilateral(hull)) taken[i] = true;
  for (int c = 4; c < count; ++c) taken[most_growth(hull, taken)] = true;
  for (std::size_t i = 0; i < hull.size(); ++i)
    if (taken[i]) polygon.push_back(hull[i]);
}

}  // namespace limber::internal
