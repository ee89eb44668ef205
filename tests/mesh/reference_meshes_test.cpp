// Meshes of other programs, with what those programs say of them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "folders.h"
#include "mesh_files.h"

namespace limber {
namespace {

namespace fs = std::filesystem;

// Volumes are sums of some 1e4 terms: round-off of each, and of the sums.
constexpr double kReferenceRoundOff = 1e-12;

class ReferenceMesh : public ::testing::TestWithParam<const char*> {};

TEST_P(ReferenceMesh, HasItsNodesTetsVolumeBodiesAndFixedNodes) {
  const fs::path folder = fs::path(LIMBER_SOURCE_DIR) / "tests/data/reference-modal";
  const auto expected = nlohmann::json::parse(std::ifstream(folder / (std::string(GetParam()) + ".json")));

  Warnings warnings;
  auto mesh = testing::read_tets(folder / expected["mesh"].get<std::string>(), warnings);
  EXPECT_THAT(warnings, ::testing::IsEmpty());
  EXPECT_EQ(mesh.nodes.size(), expected["nodes_in_file"].get<std::size_t>());
  EXPECT_EQ(mesh.tets.size(), expected["tets"].get<std::size_t>());
  EXPECT_NEAR(volume_properties(mesh).volume, expected["total_volume"].get<double>(),
              kReferenceRoundOff * expected["total_volume"].get<double>());
  const auto body = connected_components(mesh);
  EXPECT_EQ(1 + *std::max_element(body.begin(), body.end()), expected["components"].get<int>());

  std::vector<std::string> region_names;
  for (const Region& r : mesh.regions) region_names.push_back(r.name);
  for (const auto& material : expected["materials"]) {
    if (!material.contains("tag")) continue;
    EXPECT_THAT(region_names, ::testing::Contains(std::to_string(material["tag"].get<int>())));
  }

  const auto& fixed = expected["fixed"];
  if (fixed.is_object() && fixed["kind"] == "physical_group") {
    const auto group = std::find_if(mesh.node_groups.begin(), mesh.node_groups.end(),
                                    [&](const NodeGroup& g) { return g.name == fixed["name"].get<std::string>(); });
    ASSERT_NE(group, mesh.node_groups.end());
    EXPECT_EQ(group->nodes, fixed["nodes_index0"].get<std::vector<Index>>());
  }

  drop_unused_nodes(mesh);
  EXPECT_EQ(mesh.nodes.size(), expected["nodes_used"].get<std::size_t>());
}

INSTANTIATE_TEST_SUITE_P(Cases, ReferenceMesh,
                         ::testing::Values("bar_cantilever", "composite_medit", "pinned_node", "small_300",
                                           "two_bodies"));

TEST(BunnySurface, IsAClosedManifoldOfOnePiece) {
  const fs::path bunny = "/usr/share/glmark2/models/bunny.obj";
  if (!fs::exists(bunny)) GTEST_SKIP() << "Debian package glmark2-data is not installed";
  Warnings warnings;
  const auto surface = read_surface_mesh(bunny, warnings);
  EXPECT_EQ(surface.vertices.size(), 34835u);
  EXPECT_EQ(surface.triangles.size(), 2 * surface.vertices.size() - 4);  // Euler: V − E + F = 2, 2E = 3F
  const auto quality = surface_quality(surface);
  EXPECT_TRUE(quality.closed_manifold());
  EXPECT_EQ(quality.components, 1);
  EXPECT_GT(enclosed_volume(surface), 0.0);
}

}  // namespace
}  // namespace limber
