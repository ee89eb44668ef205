#include "limber/mesh/write_mesh.h"

#include <charconv>
#include <set>

#include "limber/core/error.h"
#include "limber/core/file.h"

namespace limber {
namespace {

/// Of kTetEdges, in the order in which Gmsh's ten-node tet has their middles.
constexpr std::size_t kEdgesOfGmsh[] = {0, 1, 2, 3, 5, 4};

/// Text that grows by numbers, each the shortest that reads back to the same bits.
class Text {
 public:
  Text& operator<<(std::string_view word) {
    text_ += word;
    return *this;
  }
  template <class Number>
  requires std::is_arithmetic_v<Number> Text& operator<<(Number number) {
    char buffer[32];
    const auto end = std::to_chars(buffer, buffer + sizeof buffer, number).ptr;
    text_.append(buffer, end);
    return *this;
  }
  Text& operator<<(const Vec3& x) { return *this << x[0] << " " << x[1] << " " << x[2]; }
  const std::string& str() const { return text_; }

 private:
  std::string text_;
};

void check_index(Index index, std::size_t count, const char* what) {
  if (index < 0 || static_cast<std::size_t>(index) >= count)
    throw InvalidArgument(std::string("write: ") + what + " " + std::to_string(index) + ", expected 0 to " +
                          std::to_string(static_cast<std::int64_t>(count) - 1));
}

void check_name(const std::string& name) {
  if (name.empty() || name.find_first_of("\"\n\r") != std::string::npos)
    throw InvalidArgument(
        "write_gmsh: a region or node group has an empty name, or one with a quote or line end in it");
}

void check(const TetMesh& mesh) {
  if (mesh.has_mid_edge_nodes() && mesh.mid_edge_nodes.size() != mesh.tets.size())
    throw InvalidArgument("write_gmsh: mid-edge nodes of " + std::to_string(mesh.mid_edge_nodes.size()) + " of " +
                          std::to_string(mesh.tets.size()) + " tetrahedra");
  for (std::size_t i = 0; i < mesh.tets.size(); ++i)
    for (const Index n : TetNodes(mesh, i)) check_index(n, mesh.nodes.size(), "node of a tetrahedron");
  if (mesh.tet_region.size() != mesh.tets.size())
    throw InvalidArgument("write_gmsh: " + std::to_string(mesh.tet_region.size()) + " region indices for " +
                          std::to_string(mesh.tets.size()) + " tetrahedra");
  for (const Index r : mesh.tet_region) check_index(r, mesh.regions.size(), "region of a tetrahedron");
  for (const Region& r : mesh.regions) check_name(r.name);
  for (const NodeGroup& g : mesh.node_groups) {
    check_name(g.name);
    for (const Index n : g.nodes) check_index(n, mesh.nodes.size(), "node of a group");
  }
}

/// Positive and different from each other: the regions' own tags as far as they can be kept.
std::vector<int> physical_tags(const std::vector<Region>& regions) {
  std::set<int> taken;
  for (const Region& r : regions) taken.insert(r.tag);
  std::vector<int> tags;
  std::set<int> used;
  int fresh = 1;
  for (const Region& r : regions) {
    int tag = r.tag;
    if (tag <= 0 || used.contains(tag)) {
      while (taken.contains(fresh)) ++fresh;
      tag = fresh++;
    }
    used.insert(tag);
    tags.push_back(tag);
  }
  return tags;
}

void put_names(Text& out, const TetMesh& mesh, const std::vector<int>& tags) {
  out << "$PhysicalNames\n" << mesh.regions.size() + mesh.node_groups.size() << "\n";
  for (std::size_t g = 0; g < mesh.node_groups.size(); ++g)
    out << "0 " << g + 1 << " \"" << mesh.node_groups[g].name << "\"\n";
  for (std::size_t r = 0; r < mesh.regions.size(); ++r)
    out << "3 " << tags[r] << " \"" << mesh.regions[r].name << "\"\n";
  out << "$EndPhysicalNames\n";
}

void put_elements(Text& out, const TetMesh& mesh, const std::vector<int>& tags) {
  std::size_t count = mesh.tets.size();
  for (const NodeGroup& g : mesh.node_groups) count += g.nodes.size();
  out << "$Elements\n" << count << "\n";
  std::size_t number = 0;
  for (std::size_t g = 0; g < mesh.node_groups.size(); ++g)
    for (const Index n : mesh.node_groups[g].nodes)
      out << ++number << " 15 2 " << g + 1 << " " << n + 1 << " " << n + 1 << "\n";
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) {
    const int tag = tags[mesh.tet_region[i]];
    out << ++number << (mesh.has_mid_edge_nodes() ? " 11" : " 4") << " 2 " << tag << " " << tag;
    for (const Index n : mesh.tets[i]) out << " " << n + 1;
    if (mesh.has_mid_edge_nodes())
      for (const std::size_t e : kEdgesOfGmsh) out << " " << mesh.mid_edge_nodes[i][e] + 1;
    out << "\n";
  }
  out << "$EndElements\n";
}

}  // namespace

void write_gmsh(const std::filesystem::path& path, const TetMesh& mesh) {
  check(mesh);
  const auto tags = physical_tags(mesh.regions);
  Text out;
  out << "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n";
  put_names(out, mesh, tags);
  out << "$Nodes\n" << mesh.nodes.size() << "\n";
  for (std::size_t i = 0; i < mesh.nodes.size(); ++i) out << i + 1 << " " << mesh.nodes[i] << "\n";
  out << "$EndNodes\n";
  put_elements(out, mesh, tags);
  write_file(path, out.str());
}

std::string obj_text(const SurfaceMesh& surface) {
  Text out;
  for (const Vec3& x : surface.vertices) out << "v " << x << "\n";
  for (const Triangle& t : surface.triangles) {
    for (const Index v : t) check_index(v, surface.vertices.size(), "vertex of a triangle");
    out << "f " << t[0] + 1 << " " << t[1] + 1 << " " << t[2] + 1 << "\n";
  }
  return out.str();
}

std::string stl_bytes(const SurfaceMesh& surface) {
  for (const Triangle& t : surface.triangles)
    for (const Index v : t) check_index(v, surface.vertices.size(), "vertex of a triangle");
  std::string bytes(80, ' ');  // a header that must not begin with "solid"
  const auto append = [&](auto value) { bytes.append(reinterpret_cast<const char*>(&value), sizeof value); };
  const auto append_vector = [&](const Vec3& x) {
    for (int i = 0; i < 3; ++i) append(static_cast<float>(x[i]));
  };
  bytes.reserve(84 + 50 * surface.triangles.size());
  append(static_cast<std::uint32_t>(surface.triangles.size()));
  for (const Triangle& t : surface.triangles) {
    const Vec3 &a = surface.vertices[t[0]], &b = surface.vertices[t[1]], &c = surface.vertices[t[2]];
    append_vector((b - a).cross(c - a).stableNormalized());
    append_vector(a), append_vector(b), append_vector(c);
    append(std::uint16_t{0});
  }
  return bytes;
}

}  // namespace limber
