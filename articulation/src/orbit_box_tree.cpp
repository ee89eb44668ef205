#include "orbit_box_tree.h"

namespace limber::internal {

OrbitBoxTree::OrbitBoxTree(const std::vector<OrbitBox>& boxes) {
  std::vector<Entry> entries;
  entries.reserve(boxes.size());
  for (const OrbitBox& box : boxes) entries.push_back({box, static_cast<Index>(entries.size())});
  nodes_.reserve(entries.size() + 1);
  if (!entries.empty()) build(entries, 0, static_cast<Index>(entries.size()));
  boxes_.reserve(entries.size());
  order_.reserve(entries.size());
  for (const Entry& entry : entries) boxes_.push_back(entry.box), order_.push_back(entry.number);
}

Index OrbitBoxTree::build(std::vector<Entry>& entries, Index first, Index count) {
  constexpr Index kLeaf = 4;
  const auto id = static_cast<Index>(nodes_.size());
  nodes_.emplace_back();
  const auto begin = entries.begin() + first;
  OrbitBox box;
  std::for_each(begin, begin + count, [&](const Entry& entry) { box.add(entry.box); });
  nodes_[static_cast<std::size_t>(id)].box = box;
  if (count <= kLeaf) {
    nodes_[static_cast<std::size_t>(id)].first = first;
    nodes_[static_cast<std::size_t>(id)].count = count;
    return id;
  }
  const std::size_t axis = box.high[0] - box.low[0] >= box.high[1] - box.low[1] ? 0 : 1;
  const auto middle = [&](const Entry& entry) { return entry.box.low[axis] + entry.box.high[axis]; };
  std::nth_element(begin, begin + count / 2, begin + count,
                   [&](const Entry& a, const Entry& b) { return middle(a) < middle(b); });
  build(entries, first, count / 2);
  const Index right = build(entries, first + count / 2, count - count / 2);
  nodes_[static_cast<std::size_t>(id)].right = right;
  return id;
}

}  // namespace limber::internal
