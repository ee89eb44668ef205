#include "limber/mesh/surface_mesh.h"

#include <gmock/gmock.h>

#include "limber/core/error.h"
#include "limber/mesh/read_mesh.h"
#include "same_mesh.h"
#include "sample_meshes.h"

namespace limber {
namespace {

using namespace samples;
using ::testing::HasSubstr;

/// The surface with three vertices of its own for each triangle.
SurfaceMesh torn(const SurfaceMesh& surface) {
  SurfaceMesh out;
  out.vertices = corner_positions(surface);
  for (Index i = 0; i < static_cast<Index>(out.vertices.size()); i += 3) out.triangles.push_back({i, i + 1, i + 2});
  return out;
}

TEST(EnclosedVolume, OfACubeIsOneWhereverItStands) {
  auto cube = cube_surface();
  EXPECT_DOUBLE_EQ(enclosed_volume(cube), 1.0);
  for (Vec3& x : cube.vertices) x += Vec3(1e3, -1e3, 1e3);
  EXPECT_DOUBLE_EQ(enclosed_volume(cube), 1.0);
  for (Triangle& t : cube.triangles) std::swap(t[0], t[1]);
  EXPECT_DOUBLE_EQ(enclosed_volume(cube), -1.0);
}

TEST(SurfaceQuality, CountsWhatKeepsASurfaceFromBoundingASolid) {
  EXPECT_TRUE(surface_quality(cube_surface()).closed_manifold());

  auto open = cube_surface();
  open.triangles.pop_back();
  EXPECT_EQ(surface_quality(open).boundary_edges, 3);

  auto flipped = cube_surface();
  std::swap(flipped.triangles[4][0], flipped.triangles[4][1]);
  EXPECT_EQ(surface_quality(flipped).misoriented_edges, 3);
  EXPECT_EQ(surface_quality(flipped).boundary_edges, 0);

  auto fin = cube_surface();
  fin.vertices.emplace_back(0.5, -1.0, 0.5);
  fin.triangles.push_back({0, 1, 8});
  EXPECT_EQ(surface_quality(fin).non_manifold_edges, 1);
  EXPECT_EQ(surface_quality(fin).boundary_edges, 2);

  auto two = torn(cube_surface());
  EXPECT_EQ(surface_quality(two).components, 12);
  EXPECT_EQ(surface_quality(two).boundary_edges, 36);
}

TEST(Weld, MendsATornSurface) {
  auto surface = torn(cube_surface());
  EXPECT_EQ(weld(surface), 36 - 8);
  EXPECT_EQ(corner_positions(surface), corner_positions(cube_surface()));
  EXPECT_TRUE(surface_quality(surface).closed_manifold());
  EXPECT_EQ(weld(surface), 0);
}

TEST(Weld, TakesTheZerosForOneAndNeighboursForTwo) {
  SurfaceMesh s;
  s.vertices = {{0.0, 1, 1}, {-0.0, 1, 1}, {std::nextafter(0.0, 1.0), 1, 1}};
  s.triangles = {{0, 1, 2}};
  EXPECT_EQ(weld(s), 1);
  EXPECT_EQ(s.triangles[0], (Triangle{0, 0, 1}));
}

TEST(ValidateSurface, DropsTrianglesThatNameAVertexTwiceAndKeepsNeedles) {
  auto s = cube_surface();
  s.triangles.push_back({3, 3, 4});
  s.vertices.push_back(0.5 * (s.vertices[0] + s.vertices[1]));
  s.triangles.push_back({0, 1, 8});  // no area, three vertices
  Warnings warnings;
  validate(s, "\"s\"", warnings);
  EXPECT_EQ(s.triangles.size(), 13u);
  EXPECT_THAT(warnings, ::testing::ElementsAre(HasSubstr("1 triangles name a vertex twice")));
  s.triangles[2][1] = 9;
  EXPECT_THROW(validate(s, "\"s\"", warnings), InputError);
  s = cube_surface();
  s.vertices[3][0] = std::nan("");
  EXPECT_THROW(validate(s, "\"s\"", warnings), InputError);
}

// Polygons, through OBJ.

double area(const SurfaceMesh& s) {
  double sum = 0.0;
  for (const Triangle& t : s.triangles)
    sum += 0.5 * (s.vertices[t[1]] - s.vertices[t[0]]).cross(s.vertices[t[2]] - s.vertices[t[0]]).norm();
  return sum;
}

TEST(Polygons, ConcaveOnesAreCutWithoutOverlap) {
  const Folder folder;
  // A comb of three teeth, area 3 × 1 + 3 × 2, turned in space and given in either sense.
  const double xy[][2] = {{0, 0}, {5, 0}, {5, 3}, {4, 3}, {4, 1}, {3, 1},
                          {3, 3}, {2, 3}, {2, 1}, {1, 1}, {1, 3}, {0, 3}};
  const Mat3 R = Eigen::AngleAxisd(2.0, Vec3(3, -1, 2).normalized()).toRotationMatrix();
  for (const bool backwards : {false, true}) {
    auto out = exact();
    for (const auto& p : xy) out << "v" << joined(Vec3(R * Vec3(p[0], p[1], 0))) << "\n";
    out << "f";
    for (int i = 1; i <= 12; ++i) out << " " << (backwards ? 13 - i : i);
    Warnings warnings;
    const auto s = read_surface_mesh(folder.write("comb.obj", out.str() + "\n"), warnings);
    ASSERT_EQ(s.triangles.size(), 10u);
    EXPECT_NEAR(area(s), 5.0 * 1.0 + 3.0 * 2.0, 1e-13);  // a fan would count parts twice
    const Vec3 normal = R * Vec3(0, 0, backwards ? -1 : 1);
    for (const Triangle& t : s.triangles)
      EXPECT_GT((s.vertices[t[1]] - s.vertices[t[0]]).cross(s.vertices[t[2]] - s.vertices[t[0]]).dot(normal), 0.0);
  }
}

TEST(Polygons, SixSquaresMakeACube) {
  const Folder folder;
  Warnings warnings;
  std::string text;
  for (const Vec3& x : cube_surface().vertices) text += "v" + joined(x) + "\n";
  text += "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
  const auto cube = read_surface_mesh(folder.write("squares.obj", text), warnings);
  EXPECT_TRUE(surface_quality(cube).closed_manifold());
  EXPECT_DOUBLE_EQ(enclosed_volume(cube), 1.0);
}

}  // namespace
}  // namespace limber
