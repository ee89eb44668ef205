#include "formats/mesh_file.h"

#include <algorithm>

namespace limber::internal {
namespace {

/// Sorts each list and drops repeats, in time linear in its length but for the sort of what stays.
class Deduplicator {
 public:
  explicit Deduplicator(std::size_t nodes) : stamp_(nodes, 0) {}
  void run(std::vector<Index>& list) {
    ++now_;
    std::erase_if(list, [&](Index n) { return std::exchange(stamp_[static_cast<std::size_t>(n)], now_) == now_; });
    std::sort(list.begin(), list.end());
  }

 private:
  std::vector<std::uint32_t> stamp_;
  std::uint32_t now_ = 0;
};

/// Per region the nodes of its tets, repeats included.
std::vector<std::vector<Index>> nodes_by_region(const TetMesh& mesh) {
  std::vector<std::vector<Index>> nodes(mesh.regions.size());
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) {
    auto& list = nodes[static_cast<std::size_t>(mesh.tet_region[i])];
    const TetNodes tet(mesh, i);
    list.insert(list.end(), tet.begin(), tet.end());
  }
  return nodes;
}

}  // namespace

bool push_tet(TetMesh& mesh, std::span<const Index> nodes, const MidEdgeOrder& order) {
  const bool ten = nodes.size() == 10;
  if (!mesh.tets.empty() && ten != mesh.has_mid_edge_nodes()) return false;
  mesh.tets.push_back({nodes[0], nodes[1], nodes[2], nodes[3]});
  if (!ten) return true;
  MidEdgeNodes& middles = mesh.mid_edge_nodes.emplace_back();
  for (std::size_t e = 0; e < middles.size(); ++e) middles[e] = nodes[4 + order[e]];
  return true;
}

std::string GroupCollector::name(int dim, int tag) const {
  const auto found = names_.find({dim, tag});
  return found == names_.end() ? std::to_string(tag) : found->second;
}

bool GroupCollector::finish(TetMesh& mesh) const {
  struct Named {
    std::vector<Index> nodes;
    int dim;
    bool by_user;
  };
  const auto join = [](Named& to, const std::vector<Index>& more) {
    to.nodes.insert(to.nodes.end(), more.begin(), more.end());
  };
  std::map<std::string, Named> groups;
  bool shared_number = false;
  for (const int dim : {2, 1, 0, 3})
    for (const auto& [key, nodes] : groups_) {
      if (key.first != dim || nodes.empty()) continue;
      const bool by_user = names_.contains(key);
      const auto [place, is_new] = groups.try_emplace(name(dim, key.second), Named{nodes, dim, by_user});
      if (is_new) continue;
      if (by_user && place->second.by_user && dim < 3)
        join(place->second, nodes);
      else
        shared_number = true;
    }
  // A region's nodes join the group that other tets of the same volume group have made.
  const auto of_region = nodes_by_region(mesh);
  for (std::size_t r = 0; r < of_region.size(); ++r) {
    const auto [place, is_new] = groups.try_emplace(mesh.regions[r].name, Named{of_region[r], 3, false});
    if (!is_new && place->second.dim == 3) join(place->second, of_region[r]);
  }

  Deduplicator deduplicator(mesh.nodes.size());
  mesh.node_groups.clear();
  for (auto& [name, group] : groups) {
    deduplicator.run(group.nodes);
    mesh.node_groups.push_back({name, std::move(group.nodes)});
  }
  return shared_number;
}

std::optional<std::int64_t> NodeNumbers::finish() {
  if (numbers_.empty()) return std::nullopt;
  const auto [low, high] = std::minmax_element(numbers_.begin(), numbers_.end());
  first_ = *low;
  // Unsigned: the span of two 64-bit numbers may overflow a signed one.
  const auto span = static_cast<std::uint64_t>(*high) - static_cast<std::uint64_t>(*low);
  const bool dense = span < 4 * numbers_.size() + 1024;
  if (dense) dense_.assign(static_cast<std::size_t>(span) + 1, -1);
  for (std::size_t i = 0; i < numbers_.size(); ++i) {
    if (find(numbers_[i]) >= 0) return numbers_[i];
    if (dense)
      dense_[static_cast<std::size_t>(numbers_[i] - first_)] = static_cast<Index>(i);
    else
      sparse_[numbers_[i]] = static_cast<Index>(i);
  }
  return std::nullopt;
}

Index NodeNumbers::find(std::int64_t number) const {
  if (!dense_.empty()) {
    const auto at = static_cast<std::uint64_t>(number) - static_cast<std::uint64_t>(first_);
    return at < dense_.size() ? dense_[static_cast<std::size_t>(at)] : -1;
  }
  const auto found = sparse_.find(number);
  return found == sparse_.end() ? -1 : found->second;
}

}  // namespace limber::internal
