#include "finder/patch_weights.h"

#include <algorithm>
#include <cmath>

namespace limber::internal {
namespace {

// Of the patch's extent, squared: areas and powers of points below are round-off, or as good as a line or a circle.
constexpr double kFlat = 1e-9, kOnCircle = 1e-6;
// Barycentric weights below are those of a point on an edge.
constexpr double kOnEdge = 1e-7;

double dot(const PlanePoint& a, const PlanePoint& b) { return a.x * b.x + a.y * b.y; }
PlanePoint minus(const PlanePoint& a, const PlanePoint& b) { return {a.x - b.x, a.y - b.y}; }

PlanePoint nearest_on_segment(const PlanePoint& a, const PlanePoint& b, const PlanePoint& p) {
  const PlanePoint d = minus(b, a);
  const double t = std::clamp(dot(minus(p, a), d) / dot(d, d), 0.0, 1.0);
  return {a.x + t * d.x, a.y + t * d.y};
}

PlanePoint nearest_in_polygon(const std::vector<PlanePoint>& polygon, const PlanePoint& p) {
  PlanePoint nearest = p;
  double least = -1.0;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const PlanePoint &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
    if (doubled_area(a, b, p) >= 0.0) continue;
    const PlanePoint q = nearest_on_segment(a, b, p), d = minus(q, p);
    if (least < 0.0 || dot(d, d) < least) least = dot(d, d), nearest = q;
  }
  return nearest;
}

}  // namespace

void PatchWeights::set(const std::vector<PlanePoint>& kept) {
  kept_.assign(kept.begin(), kept.end());
  for (std::size_t r = 0; r < kept_.size(); ++r) kept_[r].item = static_cast<Index>(r);
  scratch_.assign(kept_.begin(), kept_.end());
  convex_hull(scratch_, hull_);
  size_ = diameter(hull_);
  line_.clear();
  if (hull_.size() > 2 && area(hull_) > kFlat * size_ * size_) return;
  origin_ = hull_.front();
  along_ = minus(hull_[hull_.size() > 1 ? 1 : 0], origin_);
  for (const PlanePoint& corner : hull_)
    if (const PlanePoint d = minus(corner, origin_); dot(d, d) > dot(along_, along_)) along_ = d;
  for (std::size_t r = 0; r < kept_.size(); ++r) line_.emplace_back(dot(minus(kept_[r], origin_), along_), r);
  std::sort(line_.begin(), line_.end());
}

const std::vector<PatchWeights::Weight>& PatchWeights::find(PlanePoint p) {
  weights_.clear();
  if (!line_.empty()) {
    find_on_line(dot(minus(p, origin_), along_));
    return weights_;
  }
  p = nearest_in_polygon(hull_, p);
  Triple t = first_triangle(p);
  std::array<double, 3> phi = barycentric(t, p);
  // The simplex method for the least Σ φ |x − x_r|²: the triangle goes over to others until no kept point is in its
  // circle. Any triangle on the way is right, too, so that a bound is enough against cycles.
  const auto swap_in = [&](std::size_t r, const std::array<double, 3>& of_r, std::size_t& leaves) {
    double ratio = 0.0;
    leaves = 3;
    for (std::size_t i = 0; i < 3; ++i)
      if (of_r[i] > kOnEdge)
        if (const double q = std::max(0.0, phi[i]) / of_r[i]; leaves == 3 || q < ratio) ratio = q, leaves = i;
    Triple next = t;
    next[leaves] = r;
    return next;
  };
  for (std::size_t swaps = 0; swaps < 4 * kept_.size(); ++swaps) {
    double least = -kOnCircle * size_ * size_;
    std::size_t enters = kept_.size();
    for (std::size_t r = 0; r < kept_.size(); ++r)
      if (const double d = outside_circle(t, barycentric(t, kept_[r]), r); d < least) least = d, enters = r;
    if (enters == kept_.size()) break;
    std::size_t leaves = 3;
    t = swap_in(enters, barycentric(t, kept_[enters]), leaves);
    phi = barycentric(t, p);
  }
  add(t, phi);
  double triangles = 1.0;
  for (std::size_t r = 0; r < kept_.size(); ++r) {
    const std::array<double, 3> of_r = barycentric(t, kept_[r]);
    if (std::find(t.begin(), t.end(), r) != t.end() || outside_circle(t, of_r, r) > kOnCircle * size_ * size_) continue;
    std::size_t leaves = 3;
    const Triple next = swap_in(r, of_r, leaves);
    add(next, barycentric(next, p));
    ++triangles;
  }
  for (Weight& w : weights_) w.value /= triangles;
  return weights_;
}

/// Between the nearest kept points on either side.
void PatchWeights::find_on_line(double t) {
  const auto after =
      std::lower_bound(line_.begin(), line_.end(), t, [](const auto& at, double s) { return at.first < s; });
  if (after == line_.begin() || after == line_.end()) {
    weights_.push_back({(after == line_.end() ? line_.back() : line_.front()).second, 1.0});
    return;
  }
  const auto before = after - 1;
  const double share = (t - before->first) / (after->first - before->first);
  if (share < 1.0) weights_.push_back({before->second, 1.0 - share});
  weights_.push_back({after->second, share});
}

/// Of a fan over the hull the triangle that has the point, or all but has it.
PatchWeights::Triple PatchWeights::first_triangle(const PlanePoint& p) const {
  const auto at = [&](std::size_t i) { return static_cast<std::size_t>(hull_[i].item); };
  Triple best{at(0), at(1), at(2)};
  double most = -1e300;
  for (std::size_t i = 1; i + 1 < hull_.size(); ++i) {
    if (!(doubled_area(hull_[0], hull_[i], hull_[i + 1]) > kFlat * size_ * size_)) continue;
    const Triple t{at(0), at(i), at(i + 1)};
    const std::array<double, 3> phi = barycentric(t, p);
    if (const double least = std::min({phi[0], phi[1], phi[2]}); least > most) most = least, best = t;
  }
  return best;
}

std::array<double, 3> PatchWeights::barycentric(const Triple& t, const PlanePoint& p) const {
  const PlanePoint &a = kept_[t[0]], &b = kept_[t[1]], &c = kept_[t[2]];
  const double whole = doubled_area(a, b, c);
  return {doubled_area(p, b, c) / whole, doubled_area(a, p, c) / whole, doubled_area(a, b, p) / whole};
}

/// The power of a kept point in the triangle's circle. @param of_r its barycentric coordinates there
double PatchWeights::outside_circle(const Triple& t, const std::array<double, 3>& of_r, std::size_t r) const {
  const auto squared = [&](std::size_t i) {
    const PlanePoint d = minus(kept_[i], kept_[t[0]]);
    return dot(d, d);
  };
  return squared(r) - of_r[1] * squared(t[1]) - of_r[2] * squared(t[2]);
}

/// What a point has of an edge or a corner, to round-off, is that.
void PatchWeights::add(const Triple& t, const std::array<double, 3>& values) {
  for (std::size_t i = 0; i < 3; ++i) {
    if (!(values[i] > kOnEdge)) continue;
    const auto known = std::find_if(weights_.begin(), weights_.end(), [&](const Weight& w) { return w.kept == t[i]; });
    if (known != weights_.end())
      known->value += values[i];
    else
      weights_.push_back({t[i], values[i]});
  }
}

}  // namespace limber::internal
