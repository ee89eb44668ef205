// The same mesh read from every format is the same mesh.
#include <gmock/gmock.h>

#include "mesh_files.h"
#include "same_mesh.h"
#include "sample_meshes.h"

namespace limber {
namespace {

using namespace samples;

std::vector<NodeGroup> without(std::vector<NodeGroup> groups, const std::string& name) {
  std::erase_if(groups, [&](const NodeGroup& g) { return g.name == name; });
  return groups;
}

TEST(EveryFormat, GivesTheSameTets) {
  const Folder folder;
  for (const Sample& sample : tet_samples()) {
    SCOPED_TRACE(sample.name);
    TetMesh expected = two_cubes();
    if (sample.name.ends_with(".vtk")) expected.node_groups = without(expected.node_groups, "5");
    Warnings warnings;
    expect_same(testing::read_tets(sample.write(folder), warnings), expected);
    EXPECT_THAT(warnings, ::testing::IsEmpty());
  }
}

TEST(EveryFormat, GivesTheSameSurface) {
  const Folder folder;
  for (const Sample& sample : surface_samples()) {
    SCOPED_TRACE(sample.name);
    Warnings warnings;
    const auto surface = read_surface_mesh(sample.write(folder), warnings);
    // STL has no vertices of its own: they come in the order of its facets.
    EXPECT_EQ(corner_positions(surface), corner_positions(cube_surface()));
    if (!sample.name.ends_with(".stl")) {
      EXPECT_EQ(surface.vertices, cube_surface().vertices);
    }
    EXPECT_EQ(surface.vertices.size(), 8u);
    EXPECT_TRUE(surface_quality(surface).closed_manifold());
    EXPECT_THAT(warnings, ::testing::IsEmpty());
    EXPECT_TRUE(std::holds_alternative<SurfaceMesh>(read_mesh(folder / sample.name, warnings)));
  }
}

/// Text formats with the line ends of Windows, and with blank lines between all lines.
TEST(EveryFormat, ReadsOtherLineEndsAndBlankLines) {
  const Folder folder;
  const auto replaced = [](const std::string& text, const std::string& line_end) {
    std::string out;
    for (const char c : text) out += c == '\n' ? line_end : std::string(1, c);
    return out;
  };
  std::vector<Sample> all = tet_samples();
  for (const Sample& s : surface_samples()) all.push_back(s);
  for (const std::string line_end : {"\r\n", " \n\n"})
    for (Sample sample : all) {
      const bool blank_means_end = sample.name.ends_with(".vtk") && line_end != "\r\n";
      if (sample.bytes.find('\0') != std::string::npos || blank_means_end) continue;
      SCOPED_TRACE(sample.name);
      Warnings warnings;
      const auto before = read_mesh(sample.write(folder), warnings);
      sample.bytes = replaced(sample.bytes, line_end);
      sample.companion_bytes = replaced(sample.companion_bytes, line_end);
      const auto after = read_mesh(sample.write(folder), warnings);
      if (const auto* tets = std::get_if<TetMesh>(&before)) {
        expect_same(std::get<TetMesh>(after), *tets);
      } else {
        EXPECT_EQ(corner_positions(std::get<SurfaceMesh>(after)), corner_positions(std::get<SurfaceMesh>(before)));
      }
    }
}

TEST(EveryFormat, IsToldByItsContentWhateverItsName) {
  const Folder folder;
  Warnings warnings;
  expect_same(testing::read_tets(folder.write("cubes.dat", msh4(two_cubes(), true)), warnings), two_cubes());
  expect_same(testing::read_tets(folder.write("cubes.msh", medit(two_cubes())), warnings), two_cubes());
  EXPECT_TRUE(is_known_mesh_format(folder / "cubes.dat"));
  EXPECT_EQ(corner_positions(read_surface_mesh(folder.write("cube.dat", glb(cube_surface())), warnings)),
            corner_positions(cube_surface()));
  EXPECT_FALSE(is_known_mesh_format(folder.write("cubes.3ds", "MM")));
}

TEST(WriteGmsh, ReadsBackToTheSameBits) {
  const Folder folder;
  TetMesh mesh = two_cubes();
  mesh.nodes[3] *= 1.0 + 1e-15;
  mesh.nodes[12] = {-0.1, 1e300, 5e-324};
  mesh.regions = {{"lower part", 4}, {"upper #2", 4}};  // a tag twice: the second gets a fresh one
  mesh.node_groups = {{"clamped end", {0, 2}}, {"lower part", {1}}, {"tip", {11, 12}}};
  write_gmsh(folder / "out.msh", mesh);
  Warnings warnings;
  const auto back = testing::read_tets(folder / "out.msh", warnings);
  mesh.regions[1].tag = 1;
  mesh.node_groups.push_back(
      {"upper #2", {4, 5, 6, 7, 8, 9, 10, 11}});  // each region is a group too, its name permitting
  expect_same(back, mesh);
  EXPECT_THAT(warnings, ::testing::IsEmpty());
}

TEST(WriteGmsh, RefusesWhatItCannotSay) {
  const Folder folder;
  TetMesh mesh = two_cubes();
  mesh.regions[0].name = "with \"quotes\"";
  EXPECT_THROW(write_gmsh(folder / "out.msh", mesh), InvalidArgument);
  mesh = two_cubes();
  mesh.tets[0][2] = 13;
  EXPECT_THROW(write_gmsh(folder / "out.msh", mesh), InvalidArgument);
  EXPECT_FALSE(fs::exists(folder / "out.msh"));
}

TEST(WriteObj, ReadsBackToTheSameBits) {
  const Folder folder;
  SurfaceMesh surface = cube_surface();
  surface.vertices[5] = {0.1, -1.0 / 3.0, 1e-300};
  testing::write_obj(folder / "out.obj", surface);
  Warnings warnings;
  const auto back = read_surface_mesh(folder / "out.obj", warnings);
  EXPECT_EQ(back.vertices, surface.vertices);
  EXPECT_EQ(back.triangles, surface.triangles);
  surface.triangles[0][0] = 8;
  EXPECT_THROW(testing::write_obj(folder / "out.obj", surface), InvalidArgument);
}

}  // namespace
}  // namespace limber
