// glTF as its specification says: skins, morph targets, names, and what is refused.
#include <gmock/gmock.h>

#include "limber/core/error.h"
#include "limber/mesh_assimp/read_surface_mesh.h"
#include "sample_meshes.h"

namespace limber {
namespace {

using namespace samples;
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
    return read_any_surface_mesh(folder_.write("a.gltf", text), warnings);
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

TEST_F(Gltf, WhatIsNotReadIsRefusedByName) {
  for (const std::string extension : {"KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_mesh_quantization",
                                      "EXT_mesh_gpu_instancing", "ACME_x"})
    EXPECT_THAT(complaint(gltf(kOneNode, "[0]", 0, "", R"(, "extensionsRequired": [")" + extension + "\"]")),
                HasSubstr(extension));
  EXPECT_EQ(complaint(gltf(kOneNode, "[0]", 0, "", R"(, "extensionsRequired": ["KHR_materials_unlit"])")), "");
  EXPECT_THAT(complaint(gltf(kOneNode, "[0]", 0, "", "", "a.bin", 5123)), HasSubstr("KHR_mesh_quantization"));
}

}  // namespace
}  // namespace limber
