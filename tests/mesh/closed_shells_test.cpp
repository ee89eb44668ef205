// Shells that are inside out are turned; what may look so on purpose is left alone.
#include "limber/mesh/closed_shells.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <vector>

#include "limber/core/error.h"
#include "sample_meshes.h"

namespace limber {
namespace {

/// Adds a cube of side `side` at `corner`; inside out if asked for.
void add_cube(SurfaceMesh& to, double side, const Vec3& corner, bool inside_out) {
  const SurfaceMesh cube = samples::cube_surface();
  const auto first = static_cast<Index>(to.vertices.size());
  for (const Vec3& p : cube.vertices) to.vertices.emplace_back(corner + side * p);
  for (const Triangle& t : cube.triangles)
    to.triangles.push_back(inside_out ? Triangle{first + t[0], first + t[2], first + t[1]}
                                      : Triangle{first + t[0], first + t[1], first + t[2]});
}

/// As STL holds it: no two triangles share a vertex.
SurfaceMesh as_stl_has_it(const SurfaceMesh& s) {
  SurfaceMesh out;
  for (const Triangle& t : s.triangles) {
    const auto n = static_cast<Index>(out.vertices.size());
    for (const Index v : t) out.vertices.push_back(s.vertices[v]);
    out.triangles.push_back({n, n + 1, n + 2});
  }
  return out;
}

TEST(ClosedShells, AreSplitByTheirLabels) {
  SurfaceMesh s;
  add_cube(s, 3.0, {0, 0, 0}, false);
  add_cube(s, 1.0, {1, 1, 1}, true);
  std::vector<Index> label(24, 0);
  std::fill(label.begin() + 12, label.end(), 1);
  const std::vector<SurfaceShell> shells = split_into_shells(s, label);
  ASSERT_EQ(shells.size(), 2u);
  EXPECT_NEAR(shells[0].volume, 27.0, 1e-12);
  EXPECT_NEAR(shells[1].volume, -1.0, 1e-12);
  EXPECT_EQ(shells[1].surface.vertices.size(), 8u);
  EXPECT_EQ(shells[1].triangles.front(), 12);
  EXPECT_EQ(shells[1].box.max(), Vec3(2, 2, 2));
  EXPECT_TRUE(holds(shells[0], shells[1]));
  EXPECT_FALSE(holds(shells[1], shells[0]));
  EXPECT_THROW(split_into_shells(s, std::vector<Index>(23, 0)), InvalidArgument);
  label[3] = -1;
  EXPECT_THROW(split_into_shells(s, label), InvalidArgument);
}

TEST(ClosedShells, HaveNoBoundaryEvenWhereTwoShareAnEdge) {
  SurfaceMesh s;
  s.vertices = {{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {0, -1, 0}};
  s.triangles = {{0, 3, 2}, {0, 1, 3}, {0, 2, 1}, {1, 2, 3}, {0, 5, 4}, {0, 1, 5}, {0, 4, 1}, {1, 4, 5}};
  EXPECT_FALSE(surface_quality(s).closed_manifold());
  EXPECT_TRUE(boundary_of(s).empty());
  EXPECT_NEAR(enclosed_volume(s), 1.0 / 3.0, 1e-15);
  s.triangles.pop_back();  // it ran 1, 4, 5: the others run these edges the other way
  EXPECT_EQ(boundary_of(s), (std::vector<std::array<Index, 2>>{{4, 1}, {1, 5}, {5, 4}}));
}

TEST(ClosedShells, OneInsideOutIsTurned) {
  for (const bool tear : {false, true}) {
    SurfaceMesh s;
    add_cube(s, 2.0, {5, 0, 0}, true);
    if (tear) s = as_stl_has_it(s);
    EXPECT_EQ(turn_shells_outward(s), 1);
    EXPECT_NEAR(enclosed_volume(s), 8.0, 1e-12);
    EXPECT_EQ(turn_shells_outward(s), 0);
  }
}

TEST(ClosedShells, EachIsJudgedByItself) {
  SurfaceMesh s;
  add_cube(s, 2.0, {0, 0, 0}, false);
  add_cube(s, 1.0, {5, 0, 0}, true);  // the whole has a positive volume
  EXPECT_EQ(turn_shells_outward(s), 1);
  EXPECT_NEAR(enclosed_volume(s), 9.0, 1e-12);
}

TEST(ClosedShells, ACavityLooksIntoItselfWhicheverWayTheFileHasIt) {
  for (const bool outer : {false, true})
    for (const bool inner : {false, true}) {
      SurfaceMesh s;
      add_cube(s, 3.0, {0, 0, 0}, outer);
      add_cube(s, 1.0, {1, 1, 1}, inner);
      EXPECT_EQ(turn_shells_outward(s), (outer ? 1 : 0) + (inner ? 0 : 1));
      EXPECT_NEAR(enclosed_volume(s), 26.0, 1e-12);
    }
}

TEST(ClosedShells, OpenOnesStay) {
  SurfaceMesh s;
  add_cube(s, 1.0, {0, 0, 0}, true);
  s.triangles.pop_back();
  const SurfaceMesh before = s;
  EXPECT_EQ(turn_shells_outward(s), 0);
  EXPECT_EQ(s.triangles, before.triangles);
}

}  // namespace
}  // namespace limber
