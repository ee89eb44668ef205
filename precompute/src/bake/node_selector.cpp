#include <algorithm>
#include <charconv>
#include <string_view>

#include "limber/core/error.h"
#include "limber/precompute/bake.h"

namespace limber {
namespace {

constexpr std::string_view kForms =
    "expected group:NAME, box:x0,y0,z0,x1,y1,z1 (m) or nodes:I,J,... (0-based, in order of appearance in the file)";

[[noreturn]] void refuse(std::string_view text, const std::string& why) {
  throw InvalidArgument("node selector \"" + std::string(text) + "\": " + why + "; " + std::string(kForms));
}

template <class T>
std::vector<T> parse_list(std::string_view text, std::string_view list) {
  std::vector<T> values;
  while (true) {
    const auto comma = list.find(',');
    const std::string_view item = list.substr(0, comma);
    T value{};
    const auto [end, error] = std::from_chars(item.data(), item.data() + item.size(), value);
    if (item.empty() || error != std::errc() || end != item.data() + item.size())
      refuse(text, std::string(item) + " is not a number in range");
    values.push_back(value);
    if (comma == std::string_view::npos) return values;
    list.remove_prefix(comma + 1);
  }
}

NodesInBox parse_box(std::string_view text, std::string_view list) {
  const auto v = parse_list<double>(text, list);
  if (v.size() != 6) refuse(text, "has " + std::to_string(v.size()) + " numbers for the box, expected 6");
  NodesInBox box{{v[0], v[1], v[2]}, {v[3], v[4], v[5]}};
  // Written so that NaN fails too.
  if (!(box.low.array() <= box.high.array()).all()) refuse(text, "the box's first corner is not below its second");
  return box;
}

std::vector<Index> nodes_of(const TetMesh& mesh, const NodesOfGroup& group) {
  std::string known;
  for (const NodeGroup& g : mesh.node_groups) {
    if (g.name == group.name) return g.nodes;
    known += (known.empty() ? "" : ", ") + g.name;
  }
  throw InvalidArgument("node selector group:" + group.name + ": the mesh has no node group of that name; it has " +
                        (known.empty() ? "none" : known));
}

std::vector<Index> nodes_of(const TetMesh& mesh, const NodesInBox& box) {
  std::vector<Index> nodes;
  for (std::size_t i = 0; i < mesh.nodes.size(); ++i)
    if ((mesh.nodes[i].array() >= box.low.array()).all() && (mesh.nodes[i].array() <= box.high.array()).all())
      nodes.push_back(static_cast<Index>(i));
  return nodes;
}

std::vector<Index> nodes_of(const TetMesh& mesh, const NodesByIndex& list) {
  for (const Index i : list.nodes)
    if (i < 0 || static_cast<std::size_t>(i) >= mesh.nodes.size())
      throw InvalidArgument("node selector nodes: node " + std::to_string(i) + " is out of range, expected 0 to " +
                            std::to_string(mesh.nodes.size() - 1));
  return list.nodes;
}

}  // namespace

NodeSelector parse_node_selector(std::string_view text) {
  const auto colon = text.find(':');
  if (colon == std::string_view::npos) refuse(text, "has no \":\"");
  const std::string_view kind = text.substr(0, colon), rest = text.substr(colon + 1);
  if (rest.empty()) refuse(text, "nothing follows the \":\"");
  if (kind == "group") return NodesOfGroup{std::string(rest)};
  if (kind == "box") return parse_box(text, rest);
  if (kind == "nodes") return NodesByIndex{parse_list<Index>(text, rest)};
  refuse(text, std::string(kind) + " is not a kind of selector");
}

std::vector<Index> select_nodes(const TetMesh& mesh, const NodeSelector& selector) {
  std::vector<Index> nodes = std::visit([&](const auto& s) { return nodes_of(mesh, s); }, selector);
  if (nodes.empty()) throw InvalidArgument("node selector: it selects no node of the mesh");
  std::sort(nodes.begin(), nodes.end());
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  return nodes;
}

}  // namespace limber
