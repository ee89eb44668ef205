#include "limber/model/glb.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>

#include "limber/core/error.h"

namespace limber {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

const std::vector<float> kTrianglePositions{0, 0, 0, 1, 0, 0, 0, 2, 0};
const std::vector<float> kTriangleNormals{0, 0, 1, 0, 0, 1, 0, 0, 1};
const std::vector<float> kBend{0, 0, 0, 0, 0, -0.25f, 0, 0, 0.5f};
const std::vector<Triangle> kFaces{{0, 1, 2}};

/// One triangle with one morph target, turned and bent by an animation of three keys.
GlbBuilder animated_triangle() {
  GlbBuilder glb;
  const int position = glb.add_vertex_vectors(kTrianglePositions), normal = glb.add_vertex_vectors(kTriangleNormals);
  const int faces = glb.add_triangles(kFaces), bend = glb.add_vertex_vectors(kBend);
  const int paint = glb.add_material({.name = "clay", .roughness = 0.7f});
  const int mesh = glb.add_mesh({.name = "leaf",
                                 .position = position,
                                 .normal = normal,
                                 .triangles = faces,
                                 .material = paint,
                                 .targets = {{.name = "bend", .position = bend}},
                                 .weights = {-0.5f},
                                 .extras = R"({"grams": 3})"});
  const int node = glb.add_node({.name = "leaf", .mesh = mesh, .translation = Vec3(0, 0, 1)});
  glb.add_node({.name = "root", .children = {node}, .rotation = Quaternion{std::sqrt(0.5), -std::sqrt(0.5), 0, 0}});
  const int times = glb.add_times(std::vector<float>{0.0f, 0.5f, 1.0f});
  const int weights = glb.add_key_values(std::vector<float>{0.0f, 1.0f, -1.0f}, GlbPath::kWeights);
  const int turns = glb.add_key_values(std::vector<float>{0, 0, 0, 1, 0, 0, 1, 0, 0, 0, 0, -1}, GlbPath::kRotation);
  glb.add_animation({.name = "wave",
                     .channels = {{.node = node, .path = GlbPath::kWeights, .times = times, .values = weights},
                                  {.node = node, .path = GlbPath::kRotation, .times = times, .values = turns}}});
  return glb;
}

json document_of(const std::string& bytes) { return json::parse(glb_chunks(bytes, "test").json); }

/// The floats of an accessor, found as a glTF reader finds them.
std::vector<float> floats_of(const std::string& bytes, int accessor) {
  const json document = document_of(bytes);
  const json& view = document["bufferViews"][document["accessors"][accessor]["bufferView"].get<std::size_t>()];
  std::vector<float> out(view["byteLength"].get<std::size_t>() / sizeof(float));
  std::memcpy(out.data(), glb_chunks(bytes, "test").binary.data() + view["byteOffset"].get<std::size_t>(),
              out.size() * sizeof(float));
  return out;
}

std::string message_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& e) {
    return e.what();
  }
  return "no error";
}

TEST(Glb, SameCallsGiveSameBytes) { EXPECT_EQ(animated_triangle().bytes(), animated_triangle().bytes()); }

TEST(Glb, NumbersComeBackBitForBitWithTheirExtremes) {
  const std::string bytes = animated_triangle().bytes();
  const json document = document_of(bytes);
  EXPECT_EQ(floats_of(bytes, 0), kTrianglePositions);
  EXPECT_EQ(floats_of(bytes, 3), kBend);
  EXPECT_EQ(document["accessors"][0]["min"], json({0, 0, 0}));
  EXPECT_EQ(document["accessors"][0]["max"], json({1, 2, 0}));
  EXPECT_EQ(document["accessors"][0]["count"], 3);
  EXPECT_EQ(document["accessors"][2]["max"], json({2}));
}

TEST(Glb, SizesInTheHeaderAreThoseOfTheFile) {
  const std::string bytes = animated_triangle().bytes();
  std::uint32_t words[5];
  std::memcpy(words, bytes.data(), sizeof words);
  EXPECT_EQ(words[2], bytes.size());
  const GlbChunks chunks = glb_chunks(bytes, "test");
  EXPECT_EQ(12 + 8 + chunks.json.size() + 8 + chunks.binary.size(), bytes.size());
  EXPECT_EQ(words[3], chunks.json.size());
  EXPECT_EQ(chunks.json.size() % 4, 0u);
}

TEST(Glb, OnlyNodesWithoutParentAreRoots) {
  const json document = document_of(animated_triangle().bytes());
  EXPECT_EQ(document["scenes"][0]["nodes"], json({1}));
  EXPECT_EQ(document["nodes"][1]["children"], json({0}));
}

TEST(Glb, TargetNamesJoinTheExtras) {
  const json mesh = document_of(animated_triangle().bytes())["meshes"][0];
  EXPECT_EQ(mesh["extras"], json({{"grams", 3}, {"targetNames", {"bend"}}}));
  EXPECT_EQ(mesh["weights"], json({-0.5}));
}

TEST(Glb, ExtensionsAreListedAsUsedNeverAsRequired) {
  GlbBuilder glb = animated_triangle();
  glb.set_extension("LIMBER_b", R"({"x": 1})");
  glb.add_mesh({.position = 0, .triangles = 2, .extensions = R"({"LIMBER_a": {}})"});
  const json document = document_of(glb.bytes());
  EXPECT_EQ(document["extensionsUsed"], json({"LIMBER_a", "LIMBER_b"}));
  EXPECT_FALSE(document.contains("extensionsRequired"));
}

TEST(Glb, WhatDoesNotFitTogetherIsRefusedByName) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  GlbBuilder glb = animated_triangle();
  const int two = glb.add_vertex_vectors(std::vector<float>{0, 0, 0, 1, 1, 1});
  EXPECT_THAT(message_of([&] { glb.add_vertex_vectors(std::vector<float>{0, 0, nan}); }), HasSubstr("not finite"));
  EXPECT_THAT(message_of([&] { glb.add_vertex_vectors(std::vector<float>{0, 0}); }), HasSubstr("multiple of 3"));
  EXPECT_THAT(message_of([&] { glb.add_vertex_vectors({}); }), HasSubstr("at least one"));
  EXPECT_THAT(message_of([&] { glb.add_triangles(std::vector<Triangle>{{0, 1, -1}}); }), HasSubstr("negative"));
  EXPECT_THAT(message_of([&] { glb.add_times(std::vector<float>{0.0f, 0.0f}); }), HasSubstr("ascending"));
  EXPECT_THAT(message_of([&] {
                glb.add_key_values(std::vector<float>{0, 0, 0, 2}, GlbPath::kRotation);
              }),
              HasSubstr("length 1"));
  EXPECT_THAT(message_of([&] { glb.add_mesh({.name = "m", .position = 99, .triangles = 2}); }),
              HasSubstr("\"m\".position: accessor 99 does not exist"));
  EXPECT_THAT(message_of([&] { glb.add_mesh({.position = 2, .triangles = 2}); }), HasSubstr("holds triangles"));
  EXPECT_THAT(message_of([&] { glb.add_mesh({.position = two, .triangles = 2}); }), HasSubstr("beyond the last"));
  EXPECT_THAT(message_of([&] { glb.add_mesh({.position = 0, .normal = 0, .triangles = 2}); }), HasSubstr("length 1"));
  EXPECT_THAT(message_of([&] { glb.add_mesh({.position = 0, .triangles = 2, .extras = "[1]"}); }),
              HasSubstr("not a JSON object"));
  EXPECT_THAT(message_of([&] { glb.add_node({.name = "n", .children = {0}}); }), HasSubstr("has a parent already"));
  EXPECT_THAT(message_of([&] { glb.add_raw(std::vector<std::byte>(3)); }), HasSubstr("multiple of 4"));
  EXPECT_THAT(message_of([&] { glb.add_material({.name = "\xff"}); }), HasSubstr("UTF-8"));
  EXPECT_THAT(message_of([&] {
                glb.add_animation({.channels = {{.node = 0, .path = GlbPath::kWeights, .times = 4, .values = 6}}});
              }),
              HasSubstr("holds rotation"));
}

TEST(Glb, KeysTimesTargetsMustEqualTheWeights) {
  GlbBuilder glb = animated_triangle();
  const int values = glb.add_key_values(std::vector<float>{0, 1, 0, 1}, GlbPath::kWeights);
  EXPECT_THAT(message_of([&] {
                glb.add_animation({.channels = {{.node = 0, .path = GlbPath::kWeights, .times = 4, .values = values}}});
              }),
              HasSubstr("there are 4, expected 3"));
}

TEST(Glb, AFileCutAnywhereIsOneClearError) {
  const std::string bytes = animated_triangle().bytes();
  for (std::size_t size = 0; size < bytes.size(); ++size)
    EXPECT_THROW(glb_chunks(bytes.substr(0, size), "cut"), InputError) << size;
  EXPECT_THROW(glb_chunks(bytes + "xxxx", "longer"), InputError);
}

}  // namespace
}  // namespace limber
