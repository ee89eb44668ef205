// Wrong mesh files of every format, each with a part of what should be said of it.
#pragma once

#include <cmath>
#include <stdexcept>

#include "sample_meshes.h"

namespace limber::samples {

struct Broken {
  std::string name, bytes;
  std::string says;  ///< part of the message
};

inline std::string with(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  if (at == std::string::npos)
    throw std::logic_error("a broken mesh is made from \"" + from + "\", which is not there");
  return text.replace(at, from.size(), to);
}

inline std::string cut(const std::string& bytes, double part) {
  return bytes.substr(0, static_cast<std::size_t>(part * static_cast<double>(bytes.size())));
}

inline std::vector<Broken> broken_gmsh() {
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
      {"ten_nodes.msh", with(m2, "\n3 4 2 21 1", "\n3 29 2 21 1 1 1 1 1 1 1"),
       "20-node tetrahedron; of solids only tetrahedra of 4 or 10 nodes"},
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

inline std::vector<Broken> broken_medit_and_vtk() {
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
       "only tetrahedra of 4 or 10 nodes"},
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
      {"cell_types.vtk", with(v3, "CELL_TYPES 12\n10", "CELL_TYPES 12\n24"), "of type 24 has 4 points, expected 10"},
      {"types_count.vtk", with(v3, "CELL_TYPES 12", "CELL_TYPES 11"), "expected 12, the number of CELLS"},
      {"data_count.vtk", with(v3, "CELL_DATA 12", "CELL_DATA 11"), "CELL_DATA for 11 cells, expected 12"},
      {"attribute.vtk", with(v3, "FIELD", "FEILD"), "seen \"FEILD\", expected a keyword"},
      {"no_cells.vtk", v3.substr(0, v3.find("CELLS")), "expected cells"},
      {"cut.vtk", cut(b5, 0.5), "byte"},
  };
}

inline std::vector<Broken> broken_surfaces() {
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

inline std::vector<Broken> broken_meshes() {
  std::vector<Broken> all;
  for (const auto& table : {broken_gmsh(), broken_medit_and_vtk(), broken_surfaces()})
    all.insert(all.end(), table.begin(), table.end());
  return all;
}

}  // namespace limber::samples
