/// One small tet mesh and one small surface, written by the tests in every format that limber reads.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "limber/mesh/surface_mesh.h"
#include "limber/mesh/tet_mesh.h"

namespace limber::samples {

namespace fs = std::filesystem;

/// A folder of its own for each test, gone with it.
class Folder {
 public:
  Folder() {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    std::string name = std::string("limber_mesh_") + test->test_suite_name() + "_" + test->name();
    std::replace(name.begin(), name.end(), '/', '_');
    // In memory where the system has it: thousands of small files take half a minute on some disks.
    path_ = (fs::is_directory("/dev/shm") ? fs::path("/dev/shm") : fs::path(::testing::TempDir())) /
            (name + "_" + std::to_string(::getpid()));
    fs::remove_all(path_);
    fs::create_directories(path_);
  }
  ~Folder() { fs::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  fs::path write(const std::string& name, const std::string& bytes) const {
    std::ofstream(path_ / name, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    return path_ / name;
  }
  fs::path operator/(const std::string& name) const { return path_ / name; }

 private:
  fs::path path_;
};

/// A file's bytes, text and raw numbers of a chosen byte order.
class Bytes {
 public:
  explicit Bytes(bool big_endian = false) : swap_(big_endian == (std::endian::native == std::endian::little)) {}
  Bytes& text(const std::string& t) {
    bytes_ += t;
    return *this;
  }
  template <class T>
  Bytes& raw(T value) {
    char copy[sizeof(T)];
    std::copy_n(std::bit_cast<std::array<char, sizeof(T)>>(value).begin(), sizeof(T), copy);
    if (swap_) std::reverse(copy, copy + sizeof(T));
    bytes_.append(copy, sizeof(T));
    return *this;
  }
  const std::string& str() const { return bytes_; }

 private:
  bool swap_;
  std::string bytes_;
};

/// A cube of side h at `corner` as six tets around its diagonal (Kuhn), all right-handed. Nodes: bit 0 x, bit 1 y, bit
/// 2 z.
inline std::vector<Tet> kuhn_tets(const std::array<Index, 8>& node) {
  std::vector<Tet> tets;
  constexpr int kPaths[6][2] = {{1, 3}, {3, 2}, {2, 6}, {6, 4}, {4, 5}, {5, 1}};
  for (const auto& p : kPaths) tets.push_back({node[0], node[p[0]], node[p[1]], node[7]});
  return tets;
}

/// nx × ny × nz cubes of side h.
inline TetMesh block(int nx, int ny, int nz, double h) {
  TetMesh mesh;
  mesh.regions = {{"0", 0}};
  const auto at = [&](int i, int j, int k) { return static_cast<Index>(i + (nx + 1) * (j + (ny + 1) * k)); };
  for (int k = 0; k <= nz; ++k)
    for (int j = 0; j <= ny; ++j)
      for (int i = 0; i <= nx; ++i) mesh.nodes.emplace_back(h * i, h * j, h * k);
  for (int k = 0; k < nz; ++k)
    for (int j = 0; j < ny; ++j)
      for (int i = 0; i < nx; ++i) {
        std::array<Index, 8> corner{};
        for (int c = 0; c < 8; ++c) corner[c] = at(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2));
        for (const Tet& t : kuhn_tets(corner)) mesh.tets.push_back(t);
      }
  mesh.tet_region.assign(mesh.tets.size(), 0);
  return mesh;
}

/// Two cubes on each other, regions "21" below and "22" above, the floor as node group "5", and a last node that no tet
/// uses. Numbers that need all their digits.
inline TetMesh two_cubes() {
  TetMesh mesh = block(1, 1, 2, 0.1);
  mesh.nodes.emplace_back(7.0, -1e-9, 1.0 / 3.0);
  mesh.regions = {{"21", 21}, {"22", 22}};
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) mesh.tet_region[i] = i < 6 ? 0 : 1;
  mesh.node_groups = {{"21", {0, 1, 2, 3, 4, 5, 6, 7}}, {"22", {4, 5, 6, 7, 8, 9, 10, 11}}, {"5", {0, 1, 2, 3}}};
  return mesh;
}

/// The unit cube's surface, two triangles a side, seen from outside.
inline SurfaceMesh cube_surface() {
  SurfaceMesh s;
  for (int c = 0; c < 8; ++c) s.vertices.emplace_back(c & 1, c >> 1 & 1, c >> 2);
  s.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                 {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return s;
}

inline std::ostringstream exact() {
  std::ostringstream out;
  out.precision(17);
  return out;
}

inline std::string joined(const auto& numbers, int add = 0) {
  auto out = exact();
  for (const auto n : numbers) out << " " << n + add;
  return out.str();
}

// The floor of two_cubes().
inline const std::vector<Triangle> kFloor = {{0, 2, 3}, {0, 3, 1}};
constexpr int kFloorTag = 5;

inline std::string msh2(const TetMesh& m, bool binary, bool big = false) {
  Bytes b(big);
  b.text(binary ? "$MeshFormat\n2.2 1 8\n" : "$MeshFormat\n2.2 0 8\n");
  if (binary) b.raw(std::int32_t{1}).text("\n");
  b.text("$EndMeshFormat\n$Nodes\n" + std::to_string(m.nodes.size()) + "\n");
  for (std::size_t i = 0; i < m.nodes.size(); ++i) {
    const auto number = static_cast<std::int32_t>(i + 1);
    if (binary)
      b.raw(number).raw(m.nodes[i][0]).raw(m.nodes[i][1]).raw(m.nodes[i][2]);
    else
      b.text(std::to_string(number) + joined(m.nodes[i]) + "\n");
  }
  b.text(std::string(binary ? "\n" : "") + "$EndNodes\n$Elements\n" + std::to_string(kFloor.size() + m.tets.size()) +
         "\n");
  std::int32_t number = 0;
  if (binary) b.raw(std::int32_t{2}).raw(static_cast<std::int32_t>(kFloor.size())).raw(std::int32_t{2});
  for (const Triangle& t : kFloor) {
    ++number;
    if (!binary) {
      b.text(std::to_string(number) + " 2 2 5 1" + joined(t, 1) + "\n");
      continue;
    }
    b.raw(number).raw(std::int32_t{kFloorTag}).raw(std::int32_t{1});
    for (const Index n : t) b.raw(n + 1);
  }
  if (binary) b.raw(std::int32_t{4}).raw(static_cast<std::int32_t>(m.tets.size())).raw(std::int32_t{2});
  for (std::size_t i = 0; i < m.tets.size(); ++i) {
    const std::int32_t tag = m.regions[m.tet_region[i]].tag;
    ++number;
    if (!binary) {
      b.text(std::to_string(number) + " 4 2 " + std::to_string(tag) + " 1" + joined(m.tets[i], 1) + "\n");
      continue;
    }
    b.raw(number).raw(tag).raw(std::int32_t{1});
    for (const Index n : m.tets[i]) b.raw(n + 1);
  }
  return b.text(std::string(binary ? "\n" : "") + "$EndElements\n").str();
}

/// Writes integers, sizes and reals of MSH 4.1 as text or bytes.
class Msh4 {
 public:
  Msh4(bool binary, bool big) : binary_(binary), bytes_(big) {}
  Msh4& text(const std::string& t) { return bytes_.text(t), *this; }
  Msh4& integer(std::int32_t v) { return put(v); }
  Msh4& size(std::uint64_t v) { return put(v); }
  Msh4& real(double v) { return put(v); }
  Msh4& line() { return binary_ ? *this : text("\n"); }
  Msh4& section_end() { return binary_ ? text("\n") : *this; }
  const std::string& str() const { return bytes_.str(); }

 private:
  template <class T>
  Msh4& put(T v) {
    if (binary_) {
      bytes_.raw(v);
    } else {
      auto out = exact();
      out << v << " ";
      bytes_.text(out.str());
    }
    return *this;
  }
  bool binary_;
  Bytes bytes_;
};

inline std::string msh4(const TetMesh& m, bool binary, bool big = false) {
  Msh4 b(binary, big);
  b.text(binary ? "$MeshFormat\n4.1 1 8\n" : "$MeshFormat\n4.1 0 8\n");
  if (binary) b.integer(1).text("\n");
  b.text("$EndMeshFormat\n$Entities\n").size(0).size(0).size(1).size(m.regions.size()).line();
  const auto box = [&] {
    for (int i = 0; i < 6; ++i) b.real(i < 3 ? 0.0 : 1.0);
  };
  b.integer(1);
  box();
  b.size(1).integer(kFloorTag).size(0).line();
  for (std::size_t r = 0; r < m.regions.size(); ++r) {
    b.integer(static_cast<int>(r) + 1);
    box();
    b.size(1).integer(m.regions[r].tag).size(1).integer(1).line();
  }
  b.section_end().text("$EndEntities\n$Nodes\n").size(1).size(m.nodes.size()).size(1).size(m.nodes.size()).line();
  b.integer(3).integer(1).integer(0).size(m.nodes.size()).line();
  for (std::size_t i = 0; i < m.nodes.size(); ++i) b.size(i + 1).line();
  for (const Vec3& x : m.nodes) b.real(x[0]).real(x[1]).real(x[2]).line();
  b.section_end().text("$EndNodes\n$Elements\n");
  b.size(1 + m.regions.size()).size(kFloor.size() + m.tets.size()).size(1).size(kFloor.size() + m.tets.size()).line();
  std::uint64_t number = 0;
  b.integer(2).integer(1).integer(2).size(kFloor.size()).line();
  for (const Triangle& t : kFloor) {
    b.size(++number);
    for (const Index n : t) b.size(static_cast<std::uint64_t>(n + 1));
    b.line();
  }
  for (std::size_t r = 0; r < m.regions.size(); ++r) {
    const auto count = std::count(m.tet_region.begin(), m.tet_region.end(), static_cast<Index>(r));
    b.integer(3).integer(static_cast<int>(r) + 1).integer(4).size(static_cast<std::uint64_t>(count)).line();
    for (std::size_t i = 0; i < m.tets.size(); ++i) {
      if (m.tet_region[i] != static_cast<Index>(r)) continue;
      b.size(++number);
      for (const Index n : m.tets[i]) b.size(static_cast<std::uint64_t>(n + 1));
      b.line();
    }
  }
  return b.section_end().text("$EndElements\n").str();
}

inline std::string medit(const TetMesh& m) {
  auto out = exact();
  out << "MeshVersionFormatted 2\n# a remark\nDimension\n3\n\nVertices\n" << m.nodes.size() << "\n";
  for (const Vec3& x : m.nodes) out << joined(x) << " 0\n";
  out << "Triangles\n" << kFloor.size() << "\n";
  for (const Triangle& t : kFloor) out << joined(t, 1) << " 5\n";
  out << "Ridges\n2\n1\n2\nTetrahedra\n" << m.tets.size() << "\n";
  for (std::size_t i = 0; i < m.tets.size(); ++i)
    out << joined(m.tets[i], 1) << " " << m.regions[m.tet_region[i]].tag << "\n";
  return out.str() + "End\n";
}

inline std::string tetgen_node(const TetMesh& m, int first) {
  auto out = exact();
  out << "# nodes\n" << m.nodes.size() << " 3 1 1\n";
  for (std::size_t i = 0; i < m.nodes.size(); ++i)
    out << static_cast<int>(i) + first << joined(m.nodes[i]) << " 0.5 " << (i < 4 ? kFloorTag : 0) << "\n";
  return out.str();
}

inline std::string tetgen_ele(const TetMesh& m, int first) {
  auto out = exact();
  out << m.tets.size() << " 4 1\n";
  for (std::size_t i = 0; i < m.tets.size(); ++i)
    out << static_cast<int>(i) + first << joined(m.tets[i], first) << " " << m.regions[m.tet_region[i]].tag << "\n";
  return out.str() + "# Generated by hand\n";
}

/// @param version "3.0" with counted cells or "5.1" with offsets
inline std::string vtk(const TetMesh& m, const std::string& version, bool binary) {
  const bool offsets = version == "5.1";
  Bytes b(true);
  const auto integer = [&](std::int64_t v, bool wide) {
    if (!binary)
      b.text(std::to_string(v) + "\n");
    else if (wide)
      b.raw(v);
    else
      b.raw(static_cast<std::int32_t>(v));
  };
  b.text("# vtk DataFile Version " + version + "\ntwo cubes\n" + (binary ? "BINARY" : "ASCII"));
  b.text("\nDATASET UNSTRUCTURED_GRID\nPOINTS " + std::to_string(m.nodes.size()) + " double\n");
  for (const Vec3& x : m.nodes)
    if (binary)
      b.raw(x[0]).raw(x[1]).raw(x[2]);
    else
      b.text(joined(x) + "\n");
  const auto tets = std::to_string(m.tets.size());
  if (offsets) {
    b.text("\nCELLS " + std::to_string(m.tets.size() + 1) + " " + std::to_string(4 * m.tets.size()));
    b.text("\nOFFSETS vtktypeint64\n");
    for (std::size_t i = 0; i <= m.tets.size(); ++i) integer(static_cast<std::int64_t>(4 * i), true);
    b.text("\nCONNECTIVITY vtktypeint64\n");
  } else {
    b.text("\nCELLS " + tets + " " + std::to_string(5 * m.tets.size()) + "\n");
  }
  for (const Tet& t : m.tets) {
    if (!offsets) integer(4, false);
    for (const Index n : t) integer(n, offsets);
  }
  b.text("\nCELL_TYPES " + tets + "\n");
  for (std::size_t i = 0; i < m.tets.size(); ++i) integer(10, false);
  b.text("\nCELL_DATA " + tets + "\nFIELD FieldData 2\nquality 1 " + tets + " double\n");
  for (std::size_t i = 0; i < m.tets.size(); ++i)
    if (binary)
      b.raw(0.5);
    else
      b.text("nan ");
  b.text("\nregion 1 " + tets + " int\n");
  for (const Index r : m.tet_region) integer(m.regions[r].tag, false);
  return b.text("\nMETADATA\nINFORMATION 0\n\n").str();
}

inline std::string obj(const SurfaceMesh& s) {
  auto out = exact();
  out << "# cube\nmtllib no.mtl\no cube\n";
  for (const Vec3& x : s.vertices) out << "v" << joined(x) << "\n";
  out << "vn 0 0 1\nvt 0 0\ng all\ns off\n";
  for (const Triangle& t : s.triangles) out << "f " << t[0] + 1 << "/1/1 " << t[1] + 1 << "//1 " << t[2] + 1 << "\n";
  return out.str();
}

inline std::string stl_text(const SurfaceMesh& s) {
  auto out = exact();
  out << "solid cube of æther\n";
  for (const Triangle& t : s.triangles) {
    out << " facet normal nan 0 0\n  outer loop\n";
    for (const Index v : t) out << "   vertex" << joined(s.vertices[v]) << "\n";
    out << "  endloop\n endfacet\n";
  }
  return out.str() + "endsolid cube\n";
}

/// @param head its first characters
inline std::string stl_binary(const SurfaceMesh& s, std::string head = "solid cube") {
  Bytes b;
  head.resize(80, ' ');
  b.text(head).raw(static_cast<std::uint32_t>(s.triangles.size()));
  for (const Triangle& t : s.triangles) {
    for (int i = 0; i < 3; ++i) b.raw(0.0f);
    for (const Index v : t)
      for (int a = 0; a < 3; ++a) b.raw(static_cast<float>(s.vertices[v][a]));
    b.raw(std::uint16_t{0});
  }
  return b.str();
}

enum class PlyForm { kText, kLittle, kBig };

inline std::string ply(const SurfaceMesh& s, PlyForm form) {
  const bool binary = form != PlyForm::kText;
  Bytes b(form == PlyForm::kBig);
  b.text("ply\nformat ");
  b.text(form == PlyForm::kText ? "ascii" : form == PlyForm::kBig ? "binary_big_endian" : "binary_little_endian");
  b.text(
      " 1.0\ncomment a cube\nelement camera 1\nproperty list uchar float matrix\nelement vertex " +
      std::to_string(s.vertices.size()) +
      "\nproperty uchar red\nproperty double x\nproperty double y\nproperty float z\nproperty list uchar short near\n"
      "element face " +
      std::to_string(s.triangles.size()) +
      "\nproperty list uchar int vertex_indices\nproperty float quality\nend_header\n");
  if (binary)
    b.raw(std::uint8_t{2}).raw(1.0f).raw(2.0f);
  else
    b.text("2 1 2\n");
  for (const Vec3& x : s.vertices)
    if (binary)
      b.raw(std::uint8_t{255})
          .raw(x[0])
          .raw(x[1])
          .raw(static_cast<float>(x[2]))
          .raw(std::uint8_t{1})
          .raw(std::int16_t{-1});
    else
      b.text("255" + joined(x) + " 1 -1\n");
  for (const Triangle& t : s.triangles) {
    if (!binary) {
      b.text("3" + joined(t) + " 0.5\n");
      continue;
    }
    b.raw(std::uint8_t{3});
    for (const Index v : t) b.raw(v);
    b.raw(0.5f);
  }
  return b.str();
}

/// Vertices as floats, then triangles as 16-bit numbers.
inline std::string gltf_buffer(const SurfaceMesh& s) {
  Bytes b;
  for (const Vec3& x : s.vertices)
    for (const double c : x) b.raw(static_cast<float>(c));
  for (const Triangle& t : s.triangles)
    for (const Index v : t) b.raw(static_cast<std::uint16_t>(v));
  return b.str();
}

/// @param uri of gltf_buffer(), as JSON and with a comma; empty in a GLB file
inline std::string gltf_text(const SurfaceMesh& s, const std::string& uri) {
  const std::string vertices = std::to_string(12 * s.vertices.size()), corners = std::to_string(6 * s.triangles.size());
  return R"({"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
 "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
 "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 1], "count": )" +
         std::to_string(s.vertices.size()) + R"(},
  {"bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": )" +
         std::to_string(3 * s.triangles.size()) + R"(}],
 "bufferViews": [{"buffer": 0, "byteLength": )" +
         vertices + R"(}, {"buffer": 0, "byteOffset": )" + vertices + R"(, "byteLength": )" + corners + R"(}],
 "buffers": [{)" +
         uri + R"("byteLength": )" + std::to_string(gltf_buffer(s).size()) + "}]}";
}

inline std::string glb(const SurfaceMesh& s) {
  std::string text = gltf_text(s, "");
  text.append((4 - text.size() % 4) % 4, ' ');
  const std::string buffer = gltf_buffer(s);
  Bytes b;
  b.text("glTF").raw(std::uint32_t{2}).raw(static_cast<std::uint32_t>(28 + text.size() + buffer.size()));
  b.raw(static_cast<std::uint32_t>(text.size())).text("JSON").text(text);
  return b.raw(static_cast<std::uint32_t>(buffer.size())).text(std::string("BIN\0", 4)).text(buffer).str();
}

/// A valid file; TetGen's is a pair.
struct Sample {
  std::string name, bytes;
  std::string companion_name = {}, companion_bytes = {};

  fs::path write(const Folder& folder) const {
    if (!companion_name.empty()) folder.write(companion_name, companion_bytes);
    return folder.write(name, bytes);
  }
};

/// two_cubes() in every form. All carry the floor's group but VTK, which has no groups.
inline std::vector<Sample> tet_samples() {
  const TetMesh m = two_cubes();
  return {{"text2.msh", msh2(m, false)},
          {"binary2.msh", msh2(m, true)},
          {"big2.msh", msh2(m, true, true)},
          {"text4.msh", msh4(m, false)},
          {"binary4.msh", msh4(m, true)},
          {"big4.msh", msh4(m, true, true)},
          {"text.mesh", medit(m)},
          {"from0.ele", tetgen_ele(m, 0), "from0.node", tetgen_node(m, 0)},
          {"from1.node", tetgen_node(m, 1), "from1.ele", tetgen_ele(m, 1)},
          {"text3.vtk", vtk(m, "3.0", false)},
          {"binary3.vtk", vtk(m, "3.0", true)},
          {"text51.vtk", vtk(m, "5.1", false)},
          {"binary51.vtk", vtk(m, "5.1", true)}};
}

/// cube_surface() in every form of the formats that hold surfaces only.
inline std::vector<Sample> surface_samples() {
  const SurfaceMesh s = cube_surface();
  return {{"cube.obj", obj(s)},
          {"text.stl", stl_text(s)},
          {"binary.stl", stl_binary(s)},
          {"text.ply", ply(s, PlyForm::kText)},
          {"little.ply", ply(s, PlyForm::kLittle)},
          {"big.ply", ply(s, PlyForm::kBig)},
          {"cube.gltf", gltf_text(s, R"("uri": "cube.bin", )"), "cube.bin", gltf_buffer(s)},
          {"cube.glb", glb(s)}};
}

}  // namespace limber::samples
