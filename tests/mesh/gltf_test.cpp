// glTF as its specification says: skins, morph targets, names, and what is refused.
#include <gmock/gmock.h>

#include "limber/core/error.h"
#include "limber/mesh/grouped_surface.h"
#include "limber/mesh/read_mesh.h"
#include "sample_meshes.h"

namespace limber {
namespace {

using namespace samples;
using ::testing::AllOf;
using ::testing::HasSubstr;

/// The unit cube, its faces, weights of 1 on joint 0, an inverse bind matrix, and a morph target that moves all by 1
/// along x.
std::string buffer(double bind_scale, double bind_x) {
  const SurfaceMesh cube = cube_surface();
  Bytes b;
  for (const Vec3& x : cube.vertices)
    for (const double c : x) b.raw(static_cast<float>(c));
  for (const Triangle& t : cube.triangles)
    for (const Index v : t) b.raw(static_cast<std::uint16_t>(v));
  for (int i = 0; i < 8; ++i) b.raw(std::uint32_t{0});
  for (int i = 0; i < 8; ++i) b.raw(1.F).raw(0.F).raw(0.F).raw(0.F);
  for (int column = 0; column < 4; ++column)
    for (int row = 0; row < 4; ++row)
      b.raw(static_cast<float>(column == 3 && row == 0 ? bind_x : column != row ? 0.0 : row < 3 ? bind_scale : 1.0));
  for (int i = 0; i < 8; ++i) b.raw(1.F).raw(0.F).raw(0.F);
  return b.str();
}

/// @param nodes JSON of the nodes, the first of which is the scene's; the skin's joint is the last
std::string gltf(const std::string& nodes, const std::string& roots, int joint, const std::string& mesh_extras = "",
                 const std::string& more = "", const std::string& uri = "a.bin", int position_type = 5126) {
  return R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": )" + roots + R"(}], "nodes": )" + nodes +
         R"(, "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "JOINTS_0": 2, "WEIGHTS_0": 3}, "indices": 1,
      "targets": [{"POSITION": 5}]}])" +
         mesh_extras + R"(}], "skins": [{"joints": [)" + std::to_string(joint) + R"(], "inverseBindMatrices": 4}],
    "accessors": [{"bufferView": 0, "componentType": )" +
         std::to_string(position_type) + R"(, "count": 8, "type": "VEC3", "min": [0,0,0], "max": [1,1,1]},
      {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"},
      {"bufferView": 2, "componentType": 5121, "count": 8, "type": "VEC4"},
      {"bufferView": 3, "componentType": 5126, "count": 8, "type": "VEC4"},
      {"bufferView": 4, "componentType": 5126, "count": 1, "type": "MAT4"},
      {"bufferView": 5, "componentType": 5126, "count": 8, "type": "VEC3", "min": [1,0,0], "max": [1,0,0]}],
    "bufferViews": [{"buffer": 0, "byteLength": 96}, {"buffer": 0, "byteOffset": 96, "byteLength": 72},
      {"buffer": 0, "byteOffset": 168, "byteLength": 32}, {"buffer": 0, "byteOffset": 200, "byteLength": 128},
      {"buffer": 0, "byteOffset": 328, "byteLength": 64}, {"buffer": 0, "byteOffset": 392, "byteLength": 96}],
    "buffers": [{"uri": ")" +
         uri + R"(", "byteLength": 488}])" + more + "}";
}

class Gltf : public ::testing::Test {
 protected:
  SurfaceMesh read(const std::string& text, double bind_scale = 1.0, double bind_x = 0.0,
                   const std::string& bin = "a.bin") const {
    folder_.write(bin, buffer(bind_scale, bind_x));
    Warnings warnings;
    return read_surface_mesh(folder_.write("a.gltf", text), warnings);
  }
  static double lowest_x(const SurfaceMesh& s) {
    double low = s.vertices.front().x();
    for (const Vec3& p : s.vertices) low = std::min(low, p.x());
    return low;
  }
  std::string complaint(const std::string& text) const {
    try {
      read(text);
    } catch (const InputError& e) {
      return e.what();
    }
    return {};
  }
  const Folder folder_;
};

const std::string kOneNode = R"([{"mesh": 0}])";

TEST_F(Gltf, SkinnedMeshesStandWhereTheirJointsAre) {
  const std::string scaled =
      R"([{"mesh": 0, "skin": 0}, {"scale": [0.01, 0.01, 0.01], "children": [2]}, {"translation": [3, 0, 0]}])";
  EXPECT_NEAR(enclosed_volume(read(gltf(scaled, "[0, 1]", 2))), 1e-6, 1e-11);
  EXPECT_NEAR(lowest_x(read(gltf(scaled, "[0, 1]", 2))), 0.03, 1e-7);
  // The inverse bind matrix moves before the joint scales, and undoes it here.
  EXPECT_NEAR(enclosed_volume(read(gltf(scaled, "[0, 1]", 2), 100.0)), 1.0, 1e-5);
  EXPECT_NEAR(lowest_x(read(gltf(scaled, "[0, 1]", 2), 1.0, 5.0)), 0.08, 1e-7);
}

TEST_F(Gltf, TheNodeOfASkinnedMeshCountsForNothing) {
  const SurfaceMesh s = read(
      gltf(R"([{"mesh": 0, "skin": 0, "translation": [10, 0, 0], "scale": [-2, 2, 2]}, {"translation": [3, 0, 0]}])",
           "[0, 1]", 1));
  EXPECT_NEAR(lowest_x(s), 3.0, 1e-6);
  EXPECT_NEAR(enclosed_volume(s), 1.0, 1e-6);
}

TEST_F(Gltf, MorphTargetsHaveTheirDefaultWeights) {
  EXPECT_NEAR(lowest_x(read(gltf(kOneNode, "[0]", 0, R"(, "weights": [0.25])"))), 0.25, 1e-6);
  EXPECT_NEAR(lowest_x(read(gltf(kOneNode, "[0]", 0))), 0.0, 1e-6);
}

TEST_F(Gltf, NamesOfBuffersMayBeWrittenWithPerCent) {
  const SurfaceMesh s =
      read(gltf(kOneNode, "[0]", 0, "", "", "my%20mesh%20%C3%BC.bin"), 1.0, 0.0, "my mesh \xc3\xbc.bin");
  EXPECT_NEAR(enclosed_volume(s), 1.0, 1e-6);
  EXPECT_NEAR(enclosed_volume(read(gltf(kOneNode, "[0]", 0, "", "", "100%.bin"), 1.0, 0.0, "100%.bin")), 1.0, 1e-6);
}

TEST_F(Gltf, AMissingBufferIsToldWithTheFileThatNamesIt) {
  EXPECT_THAT(complaint(gltf(kOneNode, "[0]", 0, "", "", "nowhere.bin")),
              AllOf(HasSubstr("a.gltf\" buffers[0].uri: "), HasSubstr("nowhere.bin\": No such file")));
}

TEST_F(Gltf, WhatIsNotReadIsRefusedByName) {
  for (const std::string extension :
       {"KHR_draco_mesh_compression", "EXT_meshopt_compression", "EXT_mesh_gpu_instancing", "ACME_x"})
    EXPECT_THAT(complaint(gltf(kOneNode, "[0]", 0, "", R"(, "extensionsRequired": [")" + extension + "\"]")),
                HasSubstr(extension));
  for (const std::string extension : {"KHR_materials_unlit", "KHR_mesh_quantization"})
    EXPECT_EQ(complaint(gltf(kOneNode, "[0]", 0, "", R"(, "extensionsRequired": [")" + extension + "\"]")), "");
  EXPECT_THAT(complaint(R"({"asset": {"version": "1.0"}})"), HasSubstr("expected 2.0"));
  EXPECT_FALSE(is_known_mesh_format(folder_ / "a.gltf")) << "version 1 is another format";
}

/// A box that stands in one buffer: 8 vertices as `T` in [0, one], its 36 indices, and what `more` has.
template <class T>
std::string box_buffer(T one, const std::string& more = "") {
  const SurfaceMesh cube = cube_surface();
  Bytes b;
  for (const Vec3& x : cube.vertices) {
    for (const double c : x) b.raw(c > 0.5 ? one : T{});
    b.text(std::string((4 - 3 * sizeof(T) % 4) % 4, '\0'));
  }
  for (const Triangle& t : cube.triangles)
    for (const Index v : t) b.raw(static_cast<std::uint16_t>(v));
  return b.str() + more;
}

/// @param accessor of the positions, after `"bufferView": 0,` @param stride of a vertex
std::string box_gltf(const std::string& accessor, std::size_t stride, const std::string& nodes, std::size_t more = 0,
                     const std::string& uri = R"("uri": "a.bin", )") {
  const std::string vertices = std::to_string(8 * stride), all = std::to_string(8 * stride + 72 + more);
  return R"({"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": )" + nodes +
         R"(, "meshes": [{"name": "box", "primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
    "materials": [{"name": "brass"}],
    "accessors": [{)" +
         accessor + R"(, "count": 8, "type": "VEC3"},
      {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"}],
    "bufferViews": [{"buffer": 0, "byteLength": )" +
         vertices + R"(, "byteStride": )" + std::to_string(stride) + R"(}, {"buffer": 0, "byteOffset": )" + vertices +
         R"(, "byteLength": 72},
      {"buffer": 0, "byteOffset": )" +
         std::to_string(8 * stride + 72) + R"(, "byteLength": 8}],
    "buffers": [{)" +
         uri + R"("byteLength": )" + all + "}]}";
}

TEST_F(Gltf, QuantizedPositionsAreWhatTheyStandFor) {
  const std::string node = R"([{"mesh": 0, "scale": [1, 2, 3], "translation": [0.5, 0, 0]}])";
  const auto volume = [&](const std::string& type, std::size_t stride, const std::string& bytes) {
    folder_.write("a.bin", bytes);
    Warnings warnings;
    const SurfaceMesh s = read_surface_mesh(
        folder_.write("a.gltf", box_gltf(R"("bufferView": 0, "componentType": )" + type, stride, node)), warnings);
    EXPECT_NEAR(lowest_x(s), 0.5, 1e-12);
    return enclosed_volume(s);
  };
  EXPECT_NEAR(volume(R"(5123, "normalized": true)", 8, box_buffer<std::uint16_t>(65535)), 6.0, 1e-12);
  EXPECT_NEAR(volume(R"(5121, "normalized": true)", 4, box_buffer<std::uint8_t>(255)), 6.0, 1e-12);
  EXPECT_NEAR(volume(R"(5122, "normalized": true)", 8, box_buffer<std::int16_t>(32767)), 6.0, 1e-12);
  EXPECT_NEAR(volume("5120", 4, box_buffer<std::int8_t>(10)), 6000.0, 1e-9);
}

TEST_F(Gltf, SparseAccessorsOverwriteWhatTheyName) {
  Bytes sparse;
  sparse.raw(std::uint16_t{7}).raw(std::uint16_t{0});  // the index, padded
  std::string more = sparse.str();
  Bytes value;
  value.raw(2.F).raw(2.F).raw(2.F);
  folder_.write("a.bin", box_buffer(1.F, more + value.str()));
  std::string text = box_gltf(
      R"("bufferView": 0, "componentType": 5126, "sparse": {"count": 1, "indices": {"bufferView": 2, "componentType": 5123},
         "values": {"bufferView": 3}})",
      12, kOneNode, more.size() + 12);
  const std::string last = R"("byteLength": 8}])";
  text.replace(text.find(last), last.size(),
               R"("byteLength": 4}, {"buffer": 0, "byteOffset": 172, "byteLength": 12}])");
  Warnings warnings;
  const SurfaceMesh s = read_surface_mesh(folder_.write("a.gltf", text), warnings);
  double farthest = 0.0;
  for (const Vec3& x : s.vertices) farthest = std::max(farthest, x.minCoeff());
  EXPECT_EQ(farthest, 2.0) << "the corner (1, 1, 1) moved to (2, 2, 2)";
}

TEST_F(Gltf, NestedScalesMultiplyAndMirrorsKeepTheOutsideOut) {
  folder_.write("a.bin", box_buffer(1.F));
  for (const auto& [scale, volume] : {std::pair("[-1, 2, 1]", 12.0), std::pair("[-1, -2, 1]", 12.0)}) {
    const std::string nodes = std::string(R"([{"children": [1], "scale": )") + scale +
                              R"(}, {"children": [2], "rotation": [0, 0, 0.6, 0.8]},
                                {"mesh": 0, "matrix": [1,0,0,0, 0,2,0,0, 0,0,3,0, 5,6,7,1]}])";
    Warnings warnings;
    const SurfaceMesh s = read_surface_mesh(
        folder_.write("a.gltf", box_gltf(R"("bufferView": 0, "componentType": 5126)", 12, nodes)), warnings);
    EXPECT_NEAR(enclosed_volume(s), volume, 1e-12);
    EXPECT_TRUE(surface_quality(s).closed_manifold());
  }
}

TEST_F(Gltf, GroupsAreNodesWithTheirMaterials) {
  folder_.write("a.bin", box_buffer(1.F));
  Warnings warnings;
  const std::string text = box_gltf(R"("bufferView": 0, "componentType": 5126)", 12,
                                    R"([{"children": [1, 2]}, {"mesh": 0, "name": "arm"}, {"mesh": 0}])");
  const GroupedSurface g = read_grouped_surface(folder_.write("a.gltf", text), warnings);
  ASSERT_EQ(g.groups.size(), 2u);
  EXPECT_EQ(g.groups[0].name, "arm");
  EXPECT_EQ(g.groups[1].name, "box");
  EXPECT_EQ(g.groups[1].material, "brass");
  EXPECT_EQ(g.groups[1].first, 12);
  EXPECT_EQ(g.surface.vertices.size(), 16u) << "what touches stays apart";
}

TEST_F(Gltf, WrongFilesAreRefusedInOneLine) {
  folder_.write("a.bin", box_buffer(1.F));
  const std::string right = box_gltf(R"("bufferView": 0, "componentType": 5126)", 12, kOneNode);
  const auto with = [&](const std::string& was, const std::string& is) {
    std::string text = right;
    text.replace(text.find(was), was.size(), is);
    Warnings warnings;
    try {
      read_surface_mesh(folder_.write("a.gltf", text), warnings);
    } catch (const InputError& e) {
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
      return std::string(e.what());
    }
    return std::string("no error");
  };
  EXPECT_EQ(with("box", "box"), "no error");
  EXPECT_THAT(with(R"("count": 8)", R"("count": 9)"), HasSubstr("has 9 elements"));
  EXPECT_THAT(with(R"("count": 8)", R"("count": 7)"), HasSubstr("names vertex 7"));
  EXPECT_THAT(with(R"("count": 36)", R"("count": 35)"), HasSubstr("multiple of 3"));
  EXPECT_THAT(with(R"([{"mesh": 0}])", R"([{"children": [1], "mesh": 0}, {"children": [2]}, {"children": [1]}])"),
              HasSubstr("has a parent already"));
  EXPECT_THAT(with(R"([{"mesh": 0}])", R"([{"mesh": 0}, {"children": [2]}, {"children": [1]}])"),
              HasSubstr("their own ancestors"));
  EXPECT_THAT(with(R"([{"mesh": 0}])", R"([{"mesh": 1}])"), HasSubstr("meshes[1] of 1"));
  EXPECT_THAT(with(R"("bufferView": 0, "componentType": 5126)", R"("componentType": 5126)"), HasSubstr("compressed"));
  EXPECT_THAT(with("a.bin", "b.bin"), HasSubstr("b.bin"));
  EXPECT_THAT(with("a.bin", "https://a.org/a.bin"), HasSubstr("expected the name of a file"));
  EXPECT_THAT(with("a.bin", "data:x;base64,****"), HasSubstr("base64"));
}

}  // namespace
}  // namespace limber
