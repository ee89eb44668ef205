// Regular grids: sampling, and their files.
#include "limber/mesh/voxel_grid.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cstring>

#include "limber/core/error.h"
#include "limber/core/file.h"
#include "sample_meshes.h"

namespace limber {
namespace {

using ::testing::HasSubstr;

template <class Action>
std::string message_of(Action&& action) {
  try {
    action();
  } catch (const InputError& e) {
    return e.what();
  }
  return "accepted";
}

/// 3 × 2 × 2 points with steps that are not square, of the values of a function.
template <class F>
VoxelGrid grid_of(bool of_cells, F&& value) {
  VoxelGrid grid{.counts = {3, 2, 2}, .origin = Vec3(1.0, -1.0, 0.5), .of_cells = of_cells, .fields = {}};
  grid.step << 0.5, 0.1, 0.0, 0.0, 2.0, 0.0, 0.0, 0.3, 1.0;
  grid.fields.push_back({"f", {}});
  for (int k = 0; k < 2; ++k)
    for (int j = 0; j < 2; ++j)
      for (int i = 0; i < 3; ++i) grid.fields[0].values.push_back(value(grid.origin + grid.step * Vec3(i, j, k)));
  validate(grid, "grid");
  return grid;
}

TEST(VoxelGrid, PointsInterpolateALinearFieldExactlyAndCellsAreConstant) {
  const auto linear = [](const Vec3& x) { return 3.0 + x.dot(Vec3(1.0, -2.0, 0.5)); };
  const VoxelGrid points = grid_of(false, linear), cells = grid_of(true, linear);
  for (const Vec3& at : {Vec3(0.0, 0.0, 0.0), Vec3(2.0, 1.0, 1.0), Vec3(0.3, 0.6, 0.9), Vec3(1.7, 0.2, 0.4)}) {
    const Vec3 x = points.origin + points.step * at;
    EXPECT_NEAR(points.value_at(points.fields[0], x).value(), linear(x), 1e-13);
    const Vec3 middle = cells.origin + cells.step * Vec3(at.array().round());
    EXPECT_NEAR(cells.value_at(cells.fields[0], x).value(), linear(middle), 1e-13);
  }
}

TEST(VoxelGrid, CoversItsPointsOrItsCellsAndNoMore) {
  const auto one = [](const Vec3&) { return 1.0; };
  const VoxelGrid points = grid_of(false, one), cells = grid_of(true, one);
  const auto covered = [](const VoxelGrid& g, const Vec3& at) {
    return g.value_at(g.fields[0], g.origin + g.step * at).has_value();
  };
  EXPECT_TRUE(covered(points, {2.0, 0.0, 1.0}));
  EXPECT_FALSE(covered(points, {2.01, 0.0, 1.0}));
  EXPECT_TRUE(covered(cells, {2.49, -0.49, 1.49}));
  EXPECT_FALSE(covered(cells, {2.51, 0.0, 1.0}));
}

class VoxelFiles : public ::testing::Test {
 protected:
  VoxelGrid read(const std::string& bytes) {
    folder.write("grid.vox", bytes);
    return read_voxel_grid(folder / "grid.vox");
  }
  std::string error(const std::string& bytes) {
    return message_of([&] { read(bytes); });
  }
  const samples::Folder folder;
};

std::string bytes_of(const std::vector<float>& values, bool big) {
  std::string bytes;
  for (const float v : values) {
    char b[4];
    std::memcpy(b, &v, 4);
    if (big == (std::endian::native == std::endian::little)) std::swap(b[0], b[3]), std::swap(b[1], b[2]);
    bytes.append(b, 4);
  }
  return bytes;
}

const std::vector<float> kEight{1, 2, 3, 4, 5, 6, 7, 8};

TEST_F(VoxelFiles, VtkReadsScalarsAndFieldsOfPointsAndCells) {
  const std::string head = "# vtk DataFile Version 3.0\ntitle\n";
  const std::string grid = "DATASET STRUCTURED_POINTS\nDIMENSIONS 2 2 2\nORIGIN 1 2 3\nSPACING 0.5 1 2\n";
  const VoxelGrid points = read(head + "ASCII\n" + grid +
                                "POINT_DATA 8\nSCALARS density float 1\nLOOKUP_TABLE default\n1 2 3 4 5 6 7 8\n"
                                "FIELD f 1\nyoungs_modulus 1 8 int\n8 7 6 5 4 3 2 1\n");
  ASSERT_EQ(points.fields.size(), 2u);
  EXPECT_FALSE(points.of_cells);
  EXPECT_EQ(points.value_at(*points.find("density"), {1.5, 2, 3}), 2.0);
  EXPECT_EQ(points.value_at(*points.find("youngs_modulus"), {1, 3, 5}), 2.0);
  const VoxelGrid cells = read(head + "BINARY\n" + grid + "CELL_DATA 1\nSCALARS density float\nLOOKUP_TABLE default\n" +
                               bytes_of({7.0F}, true));
  EXPECT_TRUE(cells.of_cells);
  EXPECT_EQ(cells.value_at(cells.fields[0], {1.01, 2.99, 4.99}), 7.0);
  EXPECT_FALSE(cells.value_at(cells.fields[0], {0.99, 2.5, 4.0}));
}

TEST_F(VoxelFiles, NrrdIsPlacedByDirectionsOrBySpacings) {
  const std::string head = "NRRD0005\n# made for a test\ntype: float\ndimension: 3\nsizes: 2 2 2\nencoding: raw\n";
  const VoxelGrid placed = read(head +
                                "endian: big\nspace: left-posterior-superior\nspace units: \"mm\" \"mm\" \"mm\"\n"
                                "space directions: (0,500,0) (1000,0,0) (0,0,2000)\nspace origin: (1000,0,0)\n"
                                "centers: node node node\ncontent: density\n\n" +
                                bytes_of(kEight, true));
  EXPECT_EQ(placed.fields[0].name, "density");
  EXPECT_EQ(placed.value_at(placed.fields[0], {1.0, 0.5, 0.0}), 2.0);
  EXPECT_EQ(placed.value_at(placed.fields[0], {2.0, 0.25, 0.0}), 3.5);
  const VoxelGrid spaced =
      read(head + "endian: little\nspacings: 1 1 1\naxis mins: 0 0 0\n\n" + bytes_of(kEight, false));
  EXPECT_TRUE(spaced.of_cells);
  EXPECT_EQ(spaced.value_at(spaced.fields[0], {0.1, 0.9, 1.9}), 5.0);
}

TEST_F(VoxelFiles, NrrdOfFourAxesHasAFieldPerValueOfTheFirst) {
  const VoxelGrid grid = read(
      "NRRD0004\ntype: uchar\ndimension: 4\nsizes: 2 2 1 1\nspacings: nan 1 1 1\nencoding: raw\n"
      "kinds: vector domain domain domain\n\n\x01\x02\x03\x04");
  ASSERT_EQ(grid.fields.size(), 2u);
  EXPECT_THAT(grid.fields[0].values, ::testing::ElementsAre(1.0, 3.0));
  EXPECT_THAT(grid.fields[1].values, ::testing::ElementsAre(2.0, 4.0));
}

TEST_F(VoxelFiles, MistakesAreToldInOneLine) {
  const std::string vtk = "# vtk DataFile Version 3.0\nt\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 2 1 1\n";
  const std::string nrrd = "NRRD0004\ntype: float\ndimension: 3\nsizes: 2 1 1\nspacings: 1 1 1\n";
  const std::vector<std::pair<std::string, const char*>> wrong{
      {"solid ball\n", "neither VTK legacy nor NRRD"},
      {vtk + "POINT_DATA 3\n", "seen 3 data items, expected 2"},
      {vtk + "SPACING 0 1 1\nPOINT_DATA 2\nSCALARS a float\n1 2\n", "lie in one plane"},
      {vtk + "POINT_DATA 2\nSCALARS a float\n1\n", "expected 2 values"},
      {vtk + "POINT_DATA 2\nSCALARS a float\n1 nan\n", "nan"},
      {vtk, "no field"},
      {nrrd + "encoding: gzip\n\n", "expected raw"},
      {nrrd + "\n", "\"encoding\" is missing"},
      {nrrd + "encoding: raw\ndata file: other.raw\n\n", "another file"},
      {nrrd + "encoding: raw\n\n1234", "cut short"},
      {nrrd + "encoding: raw\n", "expected an empty line"}};
  for (const auto& [bytes, expected] : wrong) {
    const std::string message = error(bytes);
    EXPECT_THAT(message, HasSubstr(expected)) << bytes;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  }
}

}  // namespace
}  // namespace limber
