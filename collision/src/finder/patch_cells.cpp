#include "finder/patch_cells.h"

#include <algorithm>
#include <limits>

namespace limber::internal {
namespace {

// Of the patch's extent, squared: areas below are a line's, points that are nearer are one.
constexpr double kNoArea = 1e-9, kOnePoint = 1e-18;

double distance_squared(const PlanePoint& p, const PlanePoint& q) {
  const double x = q.x - p.x, y = q.y - p.y;
  return x * x + y * y;
}

}  // namespace

const std::vector<double>& PatchCells::find(const std::vector<PlanePoint>& points) {
  areas_.assign(points.size(), std::numeric_limits<double>::infinity());
  scratch_.assign(points.begin(), points.end());
  convex_hull(scratch_, hull_);
  const double extent = diameter(hull_), squared = extent * extent;
  if (hull_.size() < 3 || !(area(hull_) > kNoArea * squared)) return areas_;
  for (std::vector<PlanePoint>* cell : {&cell_, &next_}) cell->reserve(hull_.size() + points.size());  // a cut adds one
  for (std::size_t i = 0; i < points.size(); ++i) {
    const PlanePoint& p = points[i];
    cell_.assign(hull_.begin(), hull_.end());
    double farthest = farthest_corner(p), sharing = 1.0;
    for (std::size_t j = 0; j < points.size(); ++j) {
      const double d = distance_squared(p, points[j]);
      if (j == i || d >= 4.0 * farthest) continue;
      if (d <= kOnePoint * squared) {
        ++sharing;
        continue;
      }
      cut(p, points[j]);
      farthest = farthest_corner(p);
    }
    areas_[i] = area(cell_) / sharing;
  }
  return areas_;
}

void PatchCells::cut(const PlanePoint& p, const PlanePoint& q) {
  const PlanePoint d{q.x - p.x, q.y - p.y}, middle{0.5 * (p.x + q.x), 0.5 * (p.y + q.y)};
  const auto beyond = [&](const PlanePoint& c) { return d.x * (c.x - middle.x) + d.y * (c.y - middle.y); };
  next_.clear();
  for (std::size_t c = 0; c < cell_.size(); ++c) {
    const PlanePoint &a = cell_[c], &b = cell_[(c + 1) % cell_.size()];
    const double at_a = beyond(a), at_b = beyond(b);
    if (at_a <= 0.0) next_.push_back(a);
    if ((at_a < 0.0 && at_b > 0.0) || (at_a > 0.0 && at_b < 0.0)) {
      const double t = at_a / (at_a - at_b);
      next_.push_back({a.x + t * (b.x - a.x), a.y + t * (b.y - a.y)});
    }
  }
  std::swap(cell_, next_);
}

double PatchCells::farthest_corner(const PlanePoint& p) const {
  double farthest = 0.0;
  for (const PlanePoint& corner : cell_) farthest = std::max(farthest, distance_squared(p, corner));
  return farthest;
}

}  // namespace limber::internal
