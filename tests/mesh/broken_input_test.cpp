// Wrong files: one clear line each, whatever is wrong, and never anything but InputError.
#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include <random>

#include "limber/core/error.h"
#include "limber/mesh/read_mesh.h"
#include "sample_meshes.h"

namespace limber {
namespace {

using namespace samples;
using testing::HasSubstr;

/// What reading says, empty if it goes well.
std::string complaint(const fs::path& path) {
  Warnings warnings;
  try {
    read_mesh(path, warnings);
  } catch (const InputError& e) {
    return e.what();
  }
  return {};
}

struct Broken {
  std::string name, bytes;
  std::string says;  ///< part of the message
};

std::string with(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

std::string cut(const std::string& bytes, double part) {
  return bytes.substr(0, static_cast<std::size_t>(part * static_cast<double>(bytes.size())));
}

std::vector<Broken> broken_gmsh() {
  const auto m2 = msh2(two_cubes(), false), m4 = msh4(two_cubes(), false);
  const auto b2 = msh2(two_cubes(), true), b4 = msh4(two_cubes(), true);
  TetMesh flat = two_cubes();
  flat.nodes[7] = flat.nodes[0];
  TetMesh nan = two_cubes();
  nan.nodes[2][1] = std::nan("");
  return {
      {"nonsense.msh", "hello", "line 1: seen \"hello\", expected $MeshFormat"},
      {"version.msh", with(m2, "2.2 0 8", "3.0 0 8"), "expected 2.2 or 4.1"},
      {"data_size.msh", with(m2, "2.2 0 8", "2.2 0 4"), "seen data size 4, expected 8"},
      {"file_type.msh", with(m2, "2.2 0 8", "2.2 7 8"), "seen 7, expected the file type from 0 to 1"},
      {"order_mark.msh", with(b2, std::string("\1\0\0\0", 4), "abcd"), "expected the number 1"},
      {"no_end.msh", with(m2, "$EndNodes", "$EndNode"), "expected $EndNodes"},
      {"no_nodes.msh", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Elements\n0\n$EndElements\n",
       "expected $Nodes before it"},
      {"no_elements.msh", m2.substr(0, m2.find("$Elements")), "expected a section $Elements"},
      {"nodes_twice.msh", m2 + m2.substr(m2.find("$Nodes"), m2.find("$Elements") - m2.find("$Nodes")),
       "second section"},
      {"huge_count2.msh", with(m2, "$Nodes\n13", "$Nodes\n999999999999"), "999999999999 as the number of nodes"},
      {"too_huge_count2.msh", with(m2, "$Nodes\n13", "$Nodes\n99999999999999999999"), "expected number of nodes"},
      {"negative_count2.msh", with(m2, "$Nodes\n13", "$Nodes\n-13"), "expected 0 or more"},
      {"huge_count4.msh", with(m4, "$Nodes\n1 13", "$Nodes\n1 4000000000"), "4000000000 as the number of nodes"},
      {"wrong_count2.msh", with(m2, "$Nodes\n13", "$Nodes\n12"), "expected $EndNodes"},
      {"wrong_total4.msh", with(m4, "$Nodes\n1 13", "$Nodes\n1 12"), "expected 12 as the section's head says"},
      {"nan_text.msh", with(m2, "\n2 0.1", "\n2 nan 0.1"), "line 7: seen \"nan\", expected a coordinate"},
      {"inf_text.msh", with(m2, "\n2 0.1", "\n2 -inf 0.1"), "seen \"-inf\""},
      {"overflow.msh", with(m2, "\n2 0.1", "\n2 1e999 0.1"), "seen \"1e999\""},
      {"glued.msh", with(m2, "\n2 0.1", "\n2 12abc 0.1"), "seen \"12abc\""},
      {"not_ascii.msh", with(m2, "\n2 0.1", "\n2 \xc3\xa4\x07"), "seen \"\\xc3\\xa4\\x07"},
      {"node_twice.msh", with(m2, "\n2 0.1", "\n1 0.1"), "node 1 stands twice"},
      {"no_such_node.msh", with(m2, " 4 2 21 1 1 ", " 4 2 21 1 99 "),
       "names node 99, expected one that stands in $Nodes"},
      {"node_in_tet_twice.msh", with(m2, " 4 2 21 1 1 2 ", " 4 2 21 1 2 2 "), "names node 1 twice"},
      {"no_such_type.msh", with(m2, "\n3 4 2", "\n3 77 2"), "seen element type 77"},
      {"ten_nodes.msh", with(m2, "\n3 4 2 21 1", "\n3 11 2 21 1 1 1 1 1 1 1"),
       "10-node tetrahedron; of solids only 4-node"},
      {"hexahedron.msh", with(m2, "\n3 4 2", "\n3 5 2"), "is a hexahedron"},
      {"tags.msh", with(m2, "\n3 4 2", "\n3 4 -2"), "as the number of tags"},
      {"flat.msh", msh2(flat, true), "is flat"},
      {"nan_binary.msh", msh4(nan, true), "node 2 (counted from 0) has a coordinate that is not finite"},
      {"run.msh", with(b2, std::string("\4\0\0\0\x0c\0\0\0", 8), std::string("\4\0\0\0\x0d\0\0\0", 8)),
       "under one head"},
      {"cut_text2.msh", cut(m2, 0.5), "line 16: the file ends"},
      {"cut_text4.msh", cut(m4, 0.7), "the file ends"},
      {"cut_binary2.msh", cut(b2, 0.4), "cut"},
      {"cut_binary4.msh", cut(b4, 0.9), "cut"},
      {"dimension4.msh", with(m4, "\n3 1 4 ", "\n2 1 4 "), "expected 3"},
      {"no_tets.msh", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n0\n$EndNodes\n$Elements\n0\n$EndElements\n",
       "holds no"},
  };
}

std::vector<Broken> broken_medit_and_vtk() {
  const auto medit_text = medit(two_cubes());
  const auto v3 = vtk(two_cubes(), "3.0", false), v5 = vtk(two_cubes(), "5.1", false),
             b5 = vtk(two_cubes(), "5.1", true);
  return {
      {"binary.meshb", std::string("\1\0\0\0\2\0\0\0", 8), "binary MEDIT (.meshb) is not read"},
      {"big_binary.meshb", std::string("\0\0\0\1\0\0\0\2", 8), "binary MEDIT (.meshb) is not read"},
      {"dimension.mesh", with(medit_text, "Dimension\n3", "Dimension\n2"), "line 4: seen dimension 2, expected 3"},
      {"no_vertices.mesh", "MeshVersionFormatted 1\nDimension 3\nEnd\n", "expected a section Vertices"},
      {"late_vertices.mesh", "MeshVersionFormatted 1\nDimension 3\nTetrahedra\n1\n1 2 3 4 0\n", "Vertices first"},
      {"index0.mesh", with(medit_text, "Tetrahedra\n12\n 1", "Tetrahedra\n12\n 0"),
       "seen 0, expected a vertex from 1 to 13"},
      {"index14.mesh", with(medit_text, "Tetrahedra\n12\n 1", "Tetrahedra\n12\n 14"), "seen 14, expected a vertex"},
      {"fraction.mesh", with(medit_text, "Tetrahedra\n12\n 1", "Tetrahedra\n12\n 1.5"), "seen \"1.5\""},
      {"huge.mesh", with(medit_text, "Tetrahedra\n12", "Tetrahedra\n2000000000"), "bytes follow"},
      {"short.mesh", with(medit_text, "Tetrahedra\n12", "Tetrahedra\n13"), "seen \"End\", expected a vertex"},
      {"long.mesh", with(medit_text, "Tetrahedra\n12", "Tetrahedra\n11"), "expected a keyword"},
      {"hexahedra.mesh", with(medit_text, "Ridges\n2\n1\n2", "Hexahedra\n1\n1 2 3 4 5 6 7 8 0"),
       "only 4-node tetrahedra"},
      {"cut.mesh", cut(medit_text, 0.8), "the file"},
      {"title.vtk", "# vtk", "expected # vtk DataFile Version"},
      {"form.vtk", with(v3, "ASCII", "ASKII"), "line 3: seen \"ASKII\", expected ASCII or BINARY"},
      {"dataset.vtk", with(v3, "UNSTRUCTURED_GRID", "STRUCTURED_POINTS"), "expected UNSTRUCTURED_GRID or POLYDATA"},
      {"type.vtk", with(v3, " double", " dubble"), "seen data type \"dubble\""},
      {"huge_points.vtk", with(v3, "POINTS 13", "POINTS 1000000000"), "bytes follow"},
      {"huge_cells.vtk", with(v3, "CELLS 12 60", "CELLS 12 6000000000"), "bytes follow"},
      {"cell_size.vtk", with(v3, "CELLS 12 60", "CELLS 12 59"), "as its number of points"},
      {"cell_numbers.vtk", with(v3, "CELLS 12 60", "CELLS 12 61"), "expected 61"},
      {"wrong_point.vtk", with(v3, "\n4\n0\n1\n3\n7\n", "\n4\n0\n1\n3\n13\n"), "names point 13, expected 0 to 12"},
      {"offsets.vtk", with(v5, "\n4\n8\n", "\n8\n4\n"), "seen offset 4, expected 8 to 48"},
      {"last_offset.vtk", with(v5, "\n48\n", "\n47\n"), "the last offset is 47, expected 48"},
      {"cell_types.vtk", with(v3, "CELL_TYPES 12\n10", "CELL_TYPES 12\n24"), "has type 24; of cells only 4-node"},
      {"types_count.vtk", with(v3, "CELL_TYPES 12", "CELL_TYPES 11"), "expected 12, the number of CELLS"},
      {"data_count.vtk", with(v3, "CELL_DATA 12", "CELL_DATA 11"), "CELL_DATA for 11 cells, expected 12"},
      {"attribute.vtk", with(v3, "FIELD", "FEILD"), "seen \"FEILD\", expected a keyword"},
      {"no_cells.vtk", v3.substr(0, v3.find("CELLS")), "expected cells"},
      {"cut.vtk", cut(b5, 0.5), "byte"},
  };
}

std::vector<Broken> broken_surfaces() {
  const auto o = obj(cube_surface()), st = stl_text(cube_surface()), sb = stl_binary(cube_surface());
  const auto pt = ply(cube_surface(), PlyForm::kText), pl = ply(cube_surface(), PlyForm::kLittle);
  return {
      {"statement.obj", "vertex 1 2 3\n", "line 1: seen \"vertex\", expected a statement of OBJ"},
      {"short_vertex.obj", "v 1 2\nf 1 1 1\n", "line 1: the line ends, expected three coordinates"},
      {"face2.obj", "v 0 0 0\nv 1 0 0\nf 1 2\n", "a face of 2 corners, expected 3 or more"},
      {"face0.obj", "v 0 0 0\nf 0 1 1\n", "names vertex 0, expected 1 to 1"},
      {"beyond.obj", with(o, "f 1/1/1", "f 9/1/1"), "names vertex 9, expected 1 to 8"},
      {"before.obj", with(o, "f 1/1/1", "f -9/1/1"), "names vertex -9"},
      {"corner.obj", with(o, "f 1/1/1", "f 1/a/1"), "seen \"1/a/1\", expected a corner"},
      {"nan.obj", with(o, "v 0 0 0", "v 0 nan 0"), "line 4: seen \"nan\""},
      {"no_faces.obj", "v 0 0 0\n", "holds no triangles"},
      {"garbage.obj", std::string("\0\1\2\xff\xfe garbage", 13), "seen \"\\x00\\x01\\x02\\xff\\xfe\""},
      {"short.stl", "solid", "the file ends"},
      {"no_loop.stl", with(st, "outer loop", "outer"), "seen \"vertex\", expected loop"},
      {"word.stl", with(st, "vertex 0", "vertex zero"), "line 4: seen \"zero\", expected a coordinate"},
      {"quad.stl", with(st, "  endloop", "   vertex 0 0 0\n  endloop"), "seen \"vertex\", expected endloop"},
      {"cut_text.stl", cut(st, 0.5), "line 43: seen \"endfa\", expected endfacet"},
      {"cut_binary.stl", cut(stl_binary(cube_surface(), "made by"), 0.5), "bytes follow"},
      {"empty_binary.stl", sb.substr(0, 80) + std::string(4, '\0'), "holds no triangles"},
      {"tiny_binary.stl", std::string("\1\2\3", 3), "the 80 bytes of a binary STL file's head"},
      {"magic.ply", "plyx\n", "line 1: seen \"plyx\", expected ply"},
      {"format.ply", with(pt, "ascii", "text"), "expected ascii, binary_little_endian or binary_big_endian"},
      {"keyword.ply", with(pt, "comment", "komment"), "line 3: seen \"komment\""},
      {"type.ply", with(pt, "uchar red", "byte red"), "expected a type of PLY"},
      {"list_length.ply", with(pt, "list uchar int", "list float int"), "a list's length is a fraction"},
      {"no_x.ply", with(pt, "double x", "double u"), "has no property \"x\""},
      {"no_list.ply", with(pt, "vertex_indices", "indices"), "has no list \"vertex_indices\""},
      {"huge.ply", with(pl, "vertex 8", "vertex 2000000000"), "bytes follow"},
      {"face_index.ply", with(pt, "3 0 2 3", "3 0 2 8"), "names vertex 8, expected 0 to 7"},
      {"negative.ply", with(pt, "3 0 2 3", "3 0 2 -3"), "names vertex -3"},
      {"too_large.ply", with(pt, "\n3 0 2 3", "\n256 0 2 3"), "seen 256, expected"},
      {"cut.ply", cut(pl, 0.9), "the file ends"},
      {"no_end.ply", "ply\nformat ascii 1.0\n", "the file ends, expected end_header"},
      {"twice.ply", with(pt, "element face", "element vertex"), "a second element \"vertex\""},
  };
}

void expect_one_clear_line(const fs::path& path, const std::string& says) {
  const std::string message = complaint(path);
  EXPECT_FALSE(message.empty()) << "no error";
  EXPECT_THAT(message, HasSubstr(path.string()));
  EXPECT_THAT(message, HasSubstr(says));
  EXPECT_EQ(message.find_first_of("\n\r"), std::string::npos) << message;
  EXPECT_LT(message.size(), path.string().size() + 400);
}

TEST(BrokenFile, SaysWhereWhatWasSeenAndWhatWasExpected) {
  const Folder folder;
  std::vector<Broken> all;
  for (const auto& table : {broken_gmsh(), broken_medit_and_vtk(), broken_surfaces()})
    all.insert(all.end(), table.begin(), table.end());
  ASSERT_GE(all.size(), 60u);
  for (const Broken& b : all) {
    SCOPED_TRACE(b.name);
    expect_one_clear_line(folder.write(b.name, b.bytes), b.says);
  }
}

TEST(BrokenFile, OfTetgenNamesTheFileOfThePairThatIsWrong) {
  const Folder folder;
  const auto node = tetgen_node(two_cubes(), 1), ele = tetgen_ele(two_cubes(), 1);
  const auto expect = [&](const std::string& n, const std::string& e, const std::string& wrong,
                          const std::string& says) {
    folder.write("pair.node", n);
    folder.write("pair.ele", e);
    for (const char* given : {"pair.node", "pair.ele"}) {
      const auto message = complaint(folder / given);
      EXPECT_THAT(message, HasSubstr((folder / wrong).string()));
      EXPECT_THAT(message, HasSubstr(says));
      EXPECT_EQ(message.find('\n'), std::string::npos);
    }
  };
  expect(with(node, "13 3 1 1", "13 2 1 1"), ele, "pair.node", "seen 2, expected a dimension");
  expect(with(node, "\n1 0 0 0", "\n2 0 0 0"), ele, "pair.node", "seen 2, expected a node number from 0 to 1");
  expect(with(node, "\n3 ", "\n4 "), ele, "pair.node", "seen 4, expected a node number from 3 to 3");
  expect(with(node, "13 3", "12 3"), ele, "pair.node", "the head counts fewer nodes");
  expect(with(node, "13 3", "1300000 3"), ele, "pair.node", "bytes follow");
  expect(node, with(ele, "12 4 1", "12 10 1"), "pair.ele", "run tetgen without -o2");
  expect(node, with(ele, "\n1 1 ", "\n1 0 "), "pair.ele", "seen 0, expected a node from 1 to 13");
  expect(node, with(ele, " 21\n", " 21.5\n"), "pair.ele", "expected a whole number as region attribute");
  expect(node, cut(ele, 0.6), "pair.ele", "");
  fs::remove(folder / "pair.ele");
  EXPECT_THAT(complaint(folder / "pair.node"), HasSubstr((folder / "pair.ele").string() + "\": No such file"));
}

TEST(BrokenFile, ThatIsNoReadableFileIsTold) {
  const Folder folder;
  for (const char* extension : {".msh", ".mesh", ".vtk", ".node", ".obj", ".stl", ".ply", ".xyz"}) {
    SCOPED_TRACE(extension);
    expect_one_clear_line(folder / (std::string("missing") + extension), "No such file");
    expect_one_clear_line(folder.write(std::string("empty") + extension, ""),
                          extension == std::string(".node") ? "" : "empty");
    fs::create_directory(folder / (std::string("folder") + extension));
    expect_one_clear_line(folder / (std::string("folder") + extension),
                          extension == std::string(".node") ? "" : "directory");
  }
  expect_one_clear_line(folder.write("cube.step", "ISO-10303-21;"), "the format is not known, expected Gmsh .msh");
  if (::geteuid() == 0) return;  // root reads everything
  const auto locked = folder.write("locked.obj", obj(cube_surface()));
  ::chmod(locked.c_str(), 0);
  expect_one_clear_line(locked, "Permission denied");
}

TEST(BrokenFile, OfTheOtherKindIsTold) {
  const Folder folder;
  Warnings warnings;
  const auto tets = folder.write("tets.msh", msh2(two_cubes(), true));
  const auto surface = folder.write("cube.obj", obj(cube_surface()));
  const auto message_of = [](const auto& read) {
    try {
      read();
    } catch (const InputError& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  EXPECT_THAT(message_of([&] { read_surface_mesh(tets, warnings); }),
              HasSubstr("holds tetrahedra, expected a surface"));
  EXPECT_THAT(message_of([&] { read_tet_mesh(surface, warnings); }), HasSubstr("holds a surface, expected tetrahedra"));
}

/// All samples, small: damage can be tried at every place.
std::vector<Sample> all_samples() {
  auto all = tet_samples();
  for (const Sample& s : surface_samples()) all.push_back(s);
  return all;
}

/// Reading either works or throws InputError with one line. @return whether it threw
bool survives(const Folder& folder, const Sample& sample) {
  const auto path = sample.write(folder);
  const auto message = complaint(path);  // anything but InputError fails the test by itself
  EXPECT_EQ(message.find_first_of("\n\r"), std::string::npos) << message;
  return !message.empty();
}

TEST(DamagedFile, CutAnywhereIsAnErrorOrStillAMesh) {
  const Folder folder;
  for (const Sample& whole : all_samples()) {
    SCOPED_TRACE(whole.name);
    std::size_t refused = 0;
    for (std::size_t length = 1; length < whole.bytes.size(); ++length) {
      Sample part = whole;
      part.bytes.resize(length);
      refused += survives(folder, part) ? 1 : 0;
    }
    // Only a cut in the last line or in data that limber does not use can go unseen.
    EXPECT_GT(refused, whole.bytes.size() * 2 / 3);
  }
}

TEST(DamagedFile, WithFlippedBitsIsAnErrorOrStillAMesh) {
  const Folder folder;
  std::mt19937 random(20030611);
  for (const Sample& whole : all_samples()) {
    SCOPED_TRACE(whole.name);
    for (int trial = 0; trial < 1000; ++trial) {
      Sample damaged = whole;
      for (int flips = 1 + trial % 3; flips > 0; --flips)
        damaged.bytes[random() % damaged.bytes.size()] ^= static_cast<char>(1u << random() % 8);
      survives(folder, damaged);
    }
  }
}

}  // namespace
}  // namespace limber
