#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "grouped_parts.h"
#include "limber/articulation/assembly.h"
#include "limber/core/error.h"

namespace limber {
namespace {

/// Twelve triangles from corner to corner.
SurfaceMesh box(const Vec3& low, const Vec3& high) {
  SurfaceMesh out;
  for (int i = 0; i < 8; ++i)
    out.vertices.emplace_back(i & 1 ? high[0] : low[0], i & 2 ? high[1] : low[1], i & 4 ? high[2] : low[2]);
  out.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                   {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return out;
}

GroupedSurface together(const std::vector<std::pair<std::string, SurfaceMesh>>& parts) {
  GroupedSurface out;
  for (const auto& [name, part] : parts) append_group(part, name, out);
  return out;
}

GroupedSurface as_soup(GroupedSurface input) {
  SurfaceMesh soup;
  for (const Triangle& t : input.surface.triangles) {
    const auto first = static_cast<Index>(soup.vertices.size());
    for (const Index v : t) soup.vertices.push_back(input.surface.vertices[static_cast<std::size_t>(v)]);
    soup.triangles.push_back({first, first + 1, first + 2});
  }
  input.surface = std::move(soup);
  return input;
}

std::vector<std::string> names(const Assembly& assembly) {
  std::vector<std::string> out;
  for (const Component& c : assembly.components) out.push_back(c.name);
  return out;
}

// Two boxes whose faces coincide, vertex by vertex.
GroupedSurface touching_boxes() { return together({{"", box({0, 0, 0}, {1, 1, 1})}, {"", box({0, 0, 1}, {1, 1, 2})}}); }

TEST(Components, PartsThatTouchExactlyStayApart) {
  const Assembly assembly = find_components(touching_boxes());
  ASSERT_EQ(assembly.components.size(), 2u);
  EXPECT_THAT(names(assembly), ::testing::ElementsAre("part 1", "part 2"));
  EXPECT_THAT(assembly.components[1].faces, ::testing::ElementsAre(FaceRange{12, 12}));
  EXPECT_TRUE(assembly.components[0].closed);
  EXPECT_DOUBLE_EQ(assembly.components[0].diagonal, std::sqrt(3.0));
}

TEST(Components, SoupIsJoinedWithinPartsButNotAcrossATouchingFace) {
  const Assembly assembly = find_components(as_soup(touching_boxes()));
  ASSERT_EQ(assembly.components.size(), 2u);
  for (const Component& c : assembly.components) {
    EXPECT_EQ(c.triangles.size(), 12u);
    EXPECT_TRUE(c.closed);
  }
}

// Each corner is displaced by up to 1e-6 of the size along each axis.
TEST(Components, ATornSoupIsAsTheWeldedOne) {
  GroupedSurface torn = as_soup(touching_boxes());
  double phase = 0.0;
  const double tear = 1e-6 * std::sqrt(6.0);
  for (Vec3& v : torn.surface.vertices) {
    phase += 1.0;
    v += tear * Vec3(std::sin(phase), std::sin(2.3 * phase), std::cos(phase));
  }
  const Assembly assembly = find_components(torn);
  ASSERT_EQ(assembly.components.size(), 2u);
  for (const Component& c : assembly.components) {
    EXPECT_EQ(c.surface.vertices.size(), 8u);
    EXPECT_TRUE(c.closed);
    EXPECT_NEAR(enclosed_volume(c.surface), 1.0, 1e-4);
  }
}

TEST(Components, QuadrilateralsThatShareNoCornerAreASoupToo) {
  GroupedSurface quads = as_soup(touching_boxes());
  for (std::size_t i = 0; i < quads.face_of.size(); ++i) quads.face_of[i] = static_cast<Index>(i / 2);
  for (std::size_t i = 0; i + 1 < quads.surface.triangles.size(); i += 2) {
    // The second triangle of each takes the first one's corners where they are the same.
    for (Index& v : quads.surface.triangles[i + 1])
      for (const Index w : quads.surface.triangles[i])
        if (quads.surface.vertices[static_cast<std::size_t>(w)] == quads.surface.vertices[static_cast<std::size_t>(v)])
          v = w;
  }
  EXPECT_EQ(find_components(quads).components.size(), 2u);
}

TEST(Components, TrianglesWithTwoCornersAtOnePlaceBelongToNoPart) {
  for (const bool soup : {false, true}) {
    GroupedSurface input = touching_boxes();
    SurfaceMesh& s = input.surface;
    s.vertices.push_back(s.vertices[0]);  // another vertex at the first one's place
    s.triangles.push_back({0, static_cast<Index>(s.vertices.size()) - 1, 1});
    input.face_of.push_back(24);
    ++input.groups.back().count;
    if (soup) input = as_soup(input);
    const Assembly assembly = find_components(input);
    ASSERT_EQ(assembly.components.size(), 2u);
    for (const Component& c : assembly.components) {
      EXPECT_EQ(c.surface.triangles.size(), 12u);
      EXPECT_EQ(c.triangles.size(), 12u);
      EXPECT_TRUE(c.closed);
    }
  }
}

TEST(Components, ShellsUnderOneNameAreProposedForMerging) {
  const Assembly assembly = find_components(together({{"bolt", box({0, 0, 0}, {1, 1, 1})},
                                                      {"bolt", box({3, 0, 0}, {4, 1, 1})},
                                                      {"plate", box({6, 0, 0}, {7, 1, 1})}}));
  EXPECT_THAT(names(assembly), ::testing::ElementsAre("bolt", "bolt 2", "plate"));
  ASSERT_EQ(assembly.proposals.size(), 1u);
  EXPECT_THAT(assembly.proposals[0].components, ::testing::ElementsAre(0, 1));
}

TEST(Components, ANameThatAllShellsShareNamesNone) {
  auto input = together({{"assembly", box({0, 0, 0}, {1, 1, 1})}, {"assembly", box({3, 0, 0}, {4, 1, 1})}});
  EXPECT_THAT(names(find_components(input)), ::testing::ElementsAre("part 1", "part 2"));
  input.groups[0].material = "steel", input.groups[1].material = "rubber";
  EXPECT_THAT(names(find_components(input)), ::testing::ElementsAre("steel", "rubber"));
  EXPECT_THAT(names(find_components(together({{"assembly", box({0, 0, 0}, {1, 1, 1})}}))),
              ::testing::ElementsAre("assembly"));
}

TEST(Components, MergedAndRenamedPartsKeepAllTheirFaces) {
  const auto input =
      together({{"a", box({0, 0, 0}, {1, 1, 1})}, {"b", box({3, 0, 0}, {4, 1, 1})}, {"c", box({6, 0, 0}, {7, 1, 1})}});
  const Assembly assembly = find_components(input, {.merge = {{"c", "a"}}, .rename = {{"c", "frame"}}});
  EXPECT_THAT(names(assembly), ::testing::ElementsAre("frame", "b"));
  EXPECT_THAT(assembly.components[0].faces, ::testing::ElementsAre(FaceRange{0, 12}, FaceRange{24, 12}));
  EXPECT_THROW(find_components(input, {.merge = {{"a", "d"}}}), InvalidArgument);
  EXPECT_THROW(find_components(input, {.rename = {{"a", "b"}}}), InvalidArgument);
}

TEST(Components, GroupsAndMaterialsCanRule) {
  auto input =
      together({{"a", box({0, 0, 0}, {1, 1, 1})}, {"b", box({3, 0, 0}, {4, 1, 1})}, {"a", box({6, 0, 0}, {7, 1, 1})}});
  EXPECT_THAT(names(find_components(input, {.rule = ComponentRule::kGroups})), ::testing::ElementsAre("a", "b"));
  for (auto& group : input.groups) group.material = "steel";
  EXPECT_THAT(names(find_components(input, {.rule = ComponentRule::kMaterials})), ::testing::ElementsAre("steel"));
}

}  // namespace
}  // namespace limber
