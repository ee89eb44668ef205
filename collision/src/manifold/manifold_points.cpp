#include "manifold/manifold_points.h"

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

#include "tuning.h"

namespace limber::internal {
namespace {

class Choice {
 public:
  Choice(std::span<FeatureContact> patch, std::span<const std::uint64_t> last)
      : patch_(patch), last_(last), normal_(patch[0].normal) {
    take(deepest());
    deepest_gap_ = chosen(0).gap;
    take(best([&](const FeatureContact& c) { return across(chosen(0), c).norm(); }));
    take(best([&](const FeatureContact& c) { return std::abs(beside(0, 1, c)); }));
    const double turn = beside(0, 1, chosen(2)) > 0.0 ? 1.0 : -1.0;
    take(best([&](const FeatureContact& c) {  // how far outside of the triangle of the three
      return std::max({-turn * beside(0, 1, c), -turn * beside(1, 2, c), -turn * beside(2, 0, c)});
    }));
  }

 private:
  const FeatureContact& chosen(std::size_t i) const { return patch_[i]; }
  void take(std::size_t place) { std::swap(patch_[count_++], patch_[place]); }

  bool kept(const FeatureContact& c) const {
    return std::find(last_.begin(), last_.end(), feature_pair(c)) != last_.end();
  }
  std::size_t deepest() const {
    double extent = 0.0;
    for (const FeatureContact& c : patch_) extent = std::max(extent, across(patch_[0], c).norm());
    const double deeper = collision_tuning().manifold.kept_depth * extent;
    std::size_t best = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < patch_.size(); ++i)
      if (const double gap = patch_[i].gap - (kept(patch_[i]) ? deeper : 0.0); gap < least) least = gap, best = i;
    return best;
  }
  template <class Distance>
  std::size_t best(const Distance& distance) const {
    const double farther = collision_tuning().manifold.kept_distance;
    std::size_t best = count_;
    double most = -std::numeric_limits<double>::infinity();
    for (std::size_t i = best; i < patch_.size(); ++i) {
      const FeatureContact& c = patch_[i];
      const double value = (kept(c) ? farther : 1.0) * distance(c) - (c.gap - deepest_gap_);
      if (value > most) most = value, best = i;
    }
    return best;
  }
  static Vec3 middle(const FeatureContact& c) { return 0.5 * (c.a.point + c.b.point); }
  Vec3 across(const FeatureContact& from, const FeatureContact& to) const {
    const Vec3 d = middle(to) - middle(from);
    return d - normal_.dot(d) * normal_;
  }
  // How far left of the line from one of those chosen to another.
  double beside(std::size_t from, std::size_t to, const FeatureContact& c) const {
    const Vec3 along = across(chosen(from), chosen(to)), d = across(chosen(from), c);
    const double length = along.norm();
    return length > 0.0 ? normal_.dot(along.cross(d)) / length : d.norm();
  }

  std::span<FeatureContact> patch_;
  std::size_t count_ = 0;
  std::span<const std::uint64_t> last_;
  Vec3 normal_;
  double deepest_gap_ = 0.0;
};

}  // namespace

std::size_t choose_manifold_points(std::span<FeatureContact> patch, std::span<const std::uint64_t> last) {
  if (patch.size() <= kManifoldPoints) return patch.size();
  Choice(patch, last);
  return kManifoldPoints;
}

void keep_manifold_points(std::vector<FeatureContact>& found, std::span<const std::uint64_t> last) {
  const double like_normals = collision_tuning().manifold.like_normals;
  const auto deeper = [](const FeatureContact& c, const FeatureContact& d) {
    return std::pair(c.gap, feature_pair(c)) < std::pair(d.gap, feature_pair(d));
  };
  std::size_t kept = 0;
  for (auto begin = found.begin(); begin != found.end();) {
    std::iter_swap(begin, std::min_element(begin, found.end(), deeper));
    const Vec3 normal = begin->normal;
    const auto end = std::partition(begin + 1, found.end(),
                                    [&](const FeatureContact& c) { return c.normal.dot(normal) > like_normals; });
    const std::size_t chosen = choose_manifold_points({&*begin, static_cast<std::size_t>(end - begin)}, last);
    std::copy_n(begin, chosen, found.begin() + static_cast<std::ptrdiff_t>(kept));
    kept += chosen;
    begin = end;
  }
  found.resize(kept);
}

}  // namespace limber::internal
