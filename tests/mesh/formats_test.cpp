// What is particular to each format: docs/formats/meshes.md, claim by claim.
#include <gmock/gmock.h>

#include <algorithm>
#include <cctype>
#include <cstring>

#include "limber/core/error.h"
#include "mesh_files.h"
#include "same_mesh.h"
#include "sample_meshes.h"

namespace limber {
namespace {

using namespace samples;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class Format : public ::testing::Test {
 protected:
  TetMesh tets(const std::string& name, const std::string& bytes) {
    return testing::read_tets(folder_.write(name, bytes), warnings);
  }
  SurfaceMesh surface(const std::string& name, const std::string& bytes) {
    return read_surface_mesh(folder_.write(name, bytes), warnings);
  }
  static std::vector<Index> group(const TetMesh& mesh, const std::string& name) {
    for (const NodeGroup& g : mesh.node_groups)
      if (g.name == name) return g.nodes;
    return {-1};
  }
  Folder folder_;
  Warnings warnings;
};

std::string region_names(const TetMesh& mesh) {
  std::string out;
  for (const Region& r : mesh.regions) out += "[" + r.name + "]";
  return out;
}

// Five nodes and two tets that share a face.
const std::string kNodes2 = "$Nodes\n5\n10 0 0 0\n20 1 0 0\n30 0 1 0\n40 0 0 1\n1000000 1 1 1\n$EndNodes\n";
std::string msh22(const std::string& names, const std::string& elements) {
  return "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n" + names + kNodes2 + "$Elements\n" + elements + "$EndElements\n";
}

using GmshFormat = Format;

TEST_F(GmshFormat, TakesAnyNodeNumbersInOrderOfAppearance) {
  const auto mesh = tets("m.msh", msh22("", "1\n7 4 2 1 1 20 30 10 1000000\n"));
  EXPECT_EQ(mesh.tets[0], (Tet{1, 2, 0, 4}));
  EXPECT_EQ(mesh.nodes.size(), 5u);
}

TEST_F(GmshFormat, GivesAnElementWrittenForTwoGroupsOnce) {
  const auto mesh =
      tets("m.msh", msh22("$PhysicalNames\n2\n3 1 \"left half\"\n3 9 \"all # of it\"\n$EndPhysicalNames\n",
                          "3\n1 4 2 1 1 10 20 30 40\n2 4 2 9 1 30 20 10 40\n3 4 2 9 2 20 30 40 1000000\n"));
  EXPECT_EQ(mesh.tets.size(), 2u);
  EXPECT_EQ(region_names(mesh), "[left half][all # of it]");
  EXPECT_THAT(group(mesh, "left half"), ElementsAre(0, 1, 2, 3));
  EXPECT_THAT(group(mesh, "all # of it"), ElementsAre(0, 1, 2, 3, 4));
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("1 tetrahedra are in several physical groups")));
}

TEST_F(GmshFormat, NamesTetsWithoutAPhysicalGroupByTheirEntity) {
  const auto mesh = tets("m.msh", msh22("", "2\n1 4 2 3 1 10 20 30 40\n2 4 2 0 8 20 30 40 1000000\n"));
  EXPECT_EQ(region_names(mesh), "[3][8]");
  const auto clash = tets("n.msh", msh22("", "2\n1 4 2 3 1 10 20 30 40\n2 4 2 0 3 20 30 40 1000000\n"));
  EXPECT_EQ(region_names(clash), "[3][entity 3]");
}

TEST_F(GmshFormat, JoinsGroupsOfOneNameAndPrefersSurfacesForABareNumber) {
  const std::string elements =
      "5\n1 15 2 1 1 1000000\n2 1 2 1 1 10 20\n3 2 2 2 1 10 20 30\n4 1 2 2 1 30 40\n5 4 2 2 1 10 20 30 40\n";
  const auto mesh =
      tets("m.msh", msh22("$PhysicalNames\n2\n0 1 \"grip\"\n1 1 \"grip\"\n$EndPhysicalNames\n", elements));
  EXPECT_THAT(group(mesh, "grip"), ElementsAre(0, 1, 4));
  EXPECT_THAT(group(mesh, "2"), ElementsAre(0, 1, 2));  // the surface, not the curve 30–40 or the whole volume
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("several dimensions share a name")));
}

TEST_F(GmshFormat, SkipsSectionsItDoesNotKnow) {
  const auto mesh = tets("m.msh", msh22("$Comments\nby $Nobody\n$EndComments\n", "1\n7 4 2 1 1 10 20 30 40\n") +
                                      "$NodeData\n1\n\"a view\"\n$EndNodeData\n");
  EXPECT_EQ(mesh.tets.size(), 1u);
}

TEST_F(GmshFormat, ReadsParametricNodesSeveralGroupsAndTurnedOnes) {
  const auto mesh =
      tets("m.msh",
           "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n2 6 \"lid\"\n$EndPhysicalNames\n"
           "$Entities\n0 0 1 1\n4 0 0 0 1 1 1 2 -6 7 0\n1 0 0 0 1 1 1 1 1 1 4\n$EndEntities\n"
           "$Nodes\n2 4 1 4\n2 4 1 3\n1\n2\n3\n0 0 0 .5 .5\n1 0 0 .5 .5\n0 1 0 .5 .5\n3 1 0 1\n4\n0 0 1\n$EndNodes\n"
           "$Elements\n2 2 1 2\n2 4 2 1\n1 1 2 3\n3 1 4 1\n2 1 2 3 4\n$EndElements\n");
  EXPECT_THAT(group(mesh, "lid"), ElementsAre(0, 1, 2));
  EXPECT_THAT(group(mesh, "7"), ElementsAre(0, 1, 2));
  EXPECT_EQ(mesh.nodes[3], Vec3(0, 0, 1));
  EXPECT_THAT(warnings, IsEmpty());
}

TEST_F(GmshFormat, IsASurfaceWhereThereAreTrianglesOnly) {
  const auto s = surface("m.msh", msh22("", "3\n1 2 2 1 1 10 20 30\n2 2 2 9 1 10 20 30\n3 3 2 1 1 10 20 1000000 40\n"));
  EXPECT_THAT(s.triangles,
              ElementsAre(Triangle{0, 1, 2}, Triangle{0, 1, 4}, Triangle{0, 4, 3}));  // groups 1 and 9: once
  EXPECT_TRUE(std::holds_alternative<SurfaceMesh>(read_mesh(folder_ / "m.msh", warnings)));
}

TEST_F(GmshFormat, TakesNumbersOfFortranAndPlusSigns) {
  const auto mesh = tets("m.msh", [] {
    auto text = msh22("", "1\n7 4 2 1 1 10 20 30 40\n");
    const std::string first = "10 0 0 0";
    return text.replace(text.find(first), first.size(), "10 +1.5D-1 -2d0 1e-400");
  }());
  EXPECT_EQ(mesh.nodes[0], Vec3(0.15, -2.0, 0.0));
}

using MeditFormat = Format;

std::string medit_text(const std::string& after_nodes) {
  return "MeshVersionFormatted 1\nDimension 3\nVertices 4\n0 0 0 1\n1 0 0 2\n0 1 0 2\n0 0 1 0\n" + after_nodes;
}

TEST_F(MeditFormat, NamesGroupsByReferenceHighestDimensionFirst) {
  const auto mesh = tets("m.mesh", medit_text("Edges 1\n3 4 3\nTriangles 1\n1 2 3 1\nTetrahedra 1\n1 2 3 4 0\nEnd\n"));
  EXPECT_THAT(group(mesh, "1"), ElementsAre(0, 1, 2));  // the triangle's, not vertex 0 alone
  EXPECT_THAT(group(mesh, "2"), ElementsAre(1, 2));     // of vertices
  EXPECT_THAT(group(mesh, "3"), ElementsAre(2, 3));     // of an edge
  EXPECT_EQ(region_names(mesh), "[0]");
}

TEST_F(MeditFormat, WarnsWhereTheEndIsMissing) {
  tets("m.mesh", medit_text("Tetrahedra 1\n1 2 3 4 0\n"));
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("without the keyword End")));
}

TEST_F(MeditFormat, IsASurfaceWhereThereAreTrianglesOnly) {
  EXPECT_EQ(surface("m.mesh", medit_text("Quadrilaterals 1\n1 2 3 4 0\nTetrahedra 0\nEnd\n")).triangles.size(), 2u);
}

using TetgenFormat = Format;

TEST_F(TetgenFormat, NeedsNoAttributesAndNoMarkers) {
  folder_.write("m.node", "4 3 0 0\n0 0 0 0\n1 1 0 0 # x\n2 0 1 0\n3 0 0 1\n");
  const auto mesh = tets("m.ele", "1 4 0\n0 0 1 2 3\n");
  EXPECT_EQ(region_names(mesh), "[0]");
  EXPECT_EQ(mesh.tets[0], (Tet{0, 1, 2, 3}));
}

using VtkFormat = Format;

std::string vtk_text(const std::string& rest) {
  return "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 5 float\n0 0 0 1 0 0 0 1 0 0 0 1 1 1 "
         "1\n"
         "CELLS 3 13\n4 0 1 2 3\n4 1 2 3 4\n2 0 1\nCELL_TYPES 3\n10 10 3\nCELL_DATA 3\n" +
         rest;
}

TEST_F(VtkFormat, TakesTheOnlyWholeNumberFieldForRegions) {
  EXPECT_EQ(region_names(tets("a.vtk", vtk_text("SCALARS part int 1\nLOOKUP_TABLE default\n7 8 0\n"))), "[7][8]");
  EXPECT_EQ(
      region_names(tets("b.vtk", vtk_text("SCALARS part int\n7 8 0\nSCALARS q float\nLOOKUP_TABLE x\n1 nan 2\n"))),
      "[7][8]");
  EXPECT_THAT(warnings, IsEmpty());
}

TEST_F(VtkFormat, PrefersAFieldWithAUsualNameAndWarnsWhereItCannotChoose) {
  const std::string two = "FIELD data 2\ncount 1 3 int\n1 2 3\nMaterial_ID 1 3 long\n5 5 0\n";
  EXPECT_EQ(region_names(tets("a.vtk", vtk_text(two))), "[5]");
  const std::string neither = "FIELD data 2\ncount 1 3 int\n1 2 3\nother 1 3 long\n5 5 0\n";
  EXPECT_EQ(region_names(tets("b.vtk", vtk_text(neither))), "[0]");
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("name the one meant \"region\"")));
}

TEST_F(VtkFormat, ReadsPolygonsAndStripsOfPolydata) {
  const auto s =
      surface("p.vtk",
              "# vtk DataFile Version 2.0\nt\nASCII\nDATASET POLYDATA\nPOINTS 5 double\n0 0 0 1 0 0 1 1 0 0 1 0 2 "
              "0 0\nVERTICES 1 2\n1 0\nLINES 1 3\n2 0 1\nPOLYGONS 1 5\n4 0 1 2 3\nTRIANGLE_STRIPS 1 5\n4 0 1 3 "
              "2\nPOINT_DATA 5\nCOLOR_SCALARS c 1\n0 .1 .2 .3 .4\nLOOKUP_TABLE t 1\n0 0 0 1\nNORMALS n float\n0 0 1 "
              "0 0 1 0 0 1 0 0 1 0 0 1\n");
  EXPECT_THAT(s.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}, Triangle{0, 1, 3}, Triangle{3, 1, 2}));
}

TEST_F(VtkFormat, ReadsTrianglesAndPixelsOfAGridWithoutTets) {
  const auto s =
      surface("p.vtk",
              "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 int\n0 0 0 1 0 0 0 1 0 1 1 "
              "0\nCELLS 2 9\n3 0 1 2\n4 0 1 2 3\nCELL_TYPES 2\n5 8\n");
  EXPECT_THAT(s.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{0, 1, 3}, Triangle{0, 3, 2}));
}

using ObjFormat = Format;

TEST_F(ObjFormat, ReadsContinuedLinesNegativeAndLaterVerticesAndColours) {
  const auto s =
      surface("m.obj",
              "# a remark \\\nv 0 0 0 1.0\nv 1 0 0 0.5 0.5 0.5\nv 0 \\\n 1 0 # trailing\nf -3/1 -2/-1/2 \\\r\n-1//7\n"
              "f 1 2 4\nv 0 0 1\nl 1 2\n");
  EXPECT_THAT(s.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{0, 1, 3}));
  EXPECT_EQ(s.vertices[2], Vec3(0, 1, 0));
}

using StlFormat = Format;

TEST_F(StlFormat, IsToldBinaryByItsLengthWhateverItBeginsWith) {
  for (const char* head : {"solid cube\nfacet normal 0 0 1\n", "made by hand", ""})
    EXPECT_TRUE(surface_quality(surface("m.stl", stl_binary(cube_surface(), head))).closed_manifold()) << head;
}

TEST_F(StlFormat, ReadsSeveralSolidsInCapitals) {
  std::string text = stl_text(cube_surface());
  text = text.substr(text.find('\n'));
  text = "solid" + text + "SOLID a" + text.substr(0, text.find("endsolid")) + "ENDSOLID\n";
  const auto s = surface("m.stl", text);
  EXPECT_EQ(s.triangles.size(), 24u);
  EXPECT_EQ(s.vertices.size(), 8u);
}

TEST_F(StlFormat, IsTextInCapitalsThroughout) {
  std::string text = stl_text(cube_surface());
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::toupper(c); });
  EXPECT_NEAR(enclosed_volume(surface("m.stl", text)), 1.0, 1e-15);
}

TEST_F(StlFormat, TakesBinaryFilesWhoseCountWasLeftOpen) {
  for (const std::uint32_t count : {0U, 0xffffffffU})
    for (const char* head : {"made by hand", "solid cube", "SOLID"}) {
      std::string bytes = stl_binary(cube_surface(), head);
      std::memcpy(bytes.data() + 80, &count, 4);
      EXPECT_EQ(surface("m.stl", bytes).triangles.size(), 12u) << head << count;
    }
}

using PlyFormat = Format;

TEST_F(PlyFormat, TakesFacesBeforeVerticesAndPolygons) {
  const auto s =
      surface("m.ply",
              "ply\r\nformat ascii 1.0\r\nelement nothing 4000000\r\nelement face 1\r\nproperty list uint8 uint32 "
              "vertex_index\r\nelement vertex 4\r\nproperty float64 z\r\nproperty int8 y\r\nproperty float x\r\n"
              "end_header\r\n4 0 1 2 3\r\n0 0 0\r\n0 0 1\r\n0 1 1\r\n0 1 0\r\n");
  EXPECT_THAT(s.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}));
  EXPECT_EQ(s.vertices[1], Vec3(1, 0, 0));
}

TEST_F(PlyFormat, TakesTriangleStripsEveryOtherTurned) {
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n"
      "element tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n0 1 0\n1 0 0\n1 1 0\n2 0 0\n2 1 "
      "0\n";
  EXPECT_THAT(surface("m.ply", head + "8 0 1 2 3 -1 2 3 4\n").triangles,
              ElementsAre(Triangle{0, 1, 2}, Triangle{2, 1, 3}, Triangle{2, 3, 4}));
  // Triangles of no area lead from one strip to the next and count.
  EXPECT_THAT(surface("m.ply", head + "7 0 1 2 2 3 4 5\n").triangles,
              ElementsAre(Triangle{0, 1, 2}, Triangle{3, 2, 4}, Triangle{3, 4, 5}));
}

TEST_F(ObjFormat, LeavesOutVerticesThatNoFaceUsesAndSaysSo) {
  const Folder folder;
  Warnings warnings;
  const auto path = folder.write("far.obj", "v 0 0 0\nv 1e6 0 0\nv 1 0 0\nv 0 1 0\nf 1 3 4\n");
  EXPECT_EQ(read_surface_mesh(path, warnings).vertices.size(), 3u);
  EXPECT_THAT(warnings, ElementsAre(::testing::HasSubstr("1 vertices belong to no triangle")));
}

}  // namespace
}  // namespace limber
