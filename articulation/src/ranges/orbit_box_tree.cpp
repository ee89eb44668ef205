#include "ranges/orbit_box_tree.h"

#include <cmath>
#include <limits>
#include <utility>

namespace limber::internal {
namespace {

constexpr float kInfiniteFloat = std::numeric_limits<float>::infinity();

/// The largest float not above a number, or the least not below it.
float rounded_down(double x) {
  const auto near = static_cast<float>(std::max(x, -1e38));
  return near <= x ? near : std::nextafter(near, -kInfiniteFloat);
}
float rounded_up(double x) { return -rounded_down(-x); }

/// Place along the Hilbert curve through a square of 2¹⁶ by 2¹⁶ cells, by quadrants from the largest on.
std::uint32_t along_curve(std::uint32_t x, std::uint32_t y) {
  constexpr std::uint32_t kSide = 1u << 16;
  std::uint32_t place = 0;
  for (std::uint32_t half = kSide / 2; half > 0; half /= 2) {
    const std::uint32_t right = (x & half) != 0, upper = (y & half) != 0;
    place = 4 * place + ((3 * right) ^ upper);
    if (upper != 0) continue;
    if (right != 0) x = kSide - 1 - x, y = kSide - 1 - y;
    std::swap(x, y);
  }
  return place;
}

}  // namespace

OrbitBoxTree::Rounded::Rounded(const OrbitBox& box) {
  for (std::size_t i = 0; i < 2; ++i) low[i] = rounded_down(box.low[i]), high[i] = rounded_up(box.high[i]);
}

OrbitBoxTree::Node::Node() {
  for (std::size_t i = 0; i < 2; ++i) low[i].fill(kInfiniteFloat), high[i].fill(-kInfiniteFloat);
}

void OrbitBoxTree::Node::set(std::size_t lane, const Rounded& box) {
  for (std::size_t i = 0; i < 2; ++i) low[i][lane] = box.low[i], high[i][lane] = box.high[i];
}

OrbitBoxTree::Rounded OrbitBoxTree::Node::around() const {
  Rounded out{OrbitBox{}};
  for (std::size_t i = 0; i < 2; ++i) {
    out.low[i] = *std::min_element(low[i].begin(), low[i].end());
    out.high[i] = *std::max_element(high[i].begin(), high[i].end());
  }
  return out;
}

OrbitBoxTree::OrbitBoxTree(const std::vector<OrbitBox>& boxes) {
  if (boxes.empty()) return;
  const auto middle = [](const OrbitBox& box, std::size_t i) { return 0.5 * box.low[i] + 0.5 * box.high[i]; };
  OrbitBox middles;
  for (const OrbitBox& box : boxes) middles.add(middle(box, 0), middle(box, 1));
  const auto cell = [&](const OrbitBox& box, std::size_t i) {
    constexpr double kCells = 65535.0;
    const double width = middles.high[i] - middles.low[i];
    return width > 0.0 ? static_cast<std::uint32_t>(kCells * ((middle(box, i) - middles.low[i]) / width)) : 0u;
  };
  std::vector<std::pair<std::uint32_t, Index>> places;
  places.reserve(boxes.size());
  for (const OrbitBox& box : boxes)
    places.emplace_back(along_curve(cell(box, 0), cell(box, 1)), static_cast<Index>(places.size()));
  std::sort(places.begin(), places.end());
  boxes_.reserve(boxes.size()), order_.reserve(boxes.size());
  for (const auto& [place, number] : places)
    order_.push_back(number), boxes_.push_back(boxes[static_cast<std::size_t>(number)]);

  const auto add_level = [&](std::size_t count, auto&& box_of) {
    levels_.push_back(nodes_.size());
    nodes_.resize(nodes_.size() + (count + kWidth - 1) / kWidth);
    for (std::size_t i = 0; i < count; ++i) nodes_[levels_.back() + i / kWidth].set(i % kWidth, box_of(i));
  };
  add_level(boxes_.size(), [&](std::size_t i) { return Rounded(boxes_[i]); });
  while (nodes_.size() - levels_.back() > 1) {
    const std::size_t below = levels_.back(), count = nodes_.size() - below;
    add_level(count, [&](std::size_t i) { return nodes_[below + i].around(); });
  }
}

}  // namespace limber::internal
