// Faults of a surface that are mended where its vertices are: the solid's volume tells whether it was done right.
#include "limber/mesh/mend_surface.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "limber/core/error.h"
#include "shapes.h"

namespace limber {
namespace {

constexpr double kRoundOff = 1e-12;

SurfaceMesh plate() { return shapes::box({0, 0, 0}, {0.2, 0.2, 0.002}); }
constexpr double kPlate = 0.2 * 0.2 * 0.002;

/// Triangles that share no vertex, as STL has them; each corner displaced by up to `tear` along each axis.
SurfaceMesh torn(const SurfaceMesh& whole, double tear) {
  SurfaceMesh s;
  std::uint32_t state = 1;
  const auto random = [&] {
    state = state * 1664525u + 1013904223u;  // Numerical Recipes' generator
    return 2.0 * (state / 4294967296.0) - 1.0;
  };
  for (const Triangle& t : whole.triangles) {
    const auto base = static_cast<Index>(s.vertices.size());
    for (const Index v : t) s.vertices.push_back(whole.vertices[v] + tear * Vec3(random(), random(), random()));
    s.triangles.push_back({base, base + 1, base + 2});
  }
  return s;
}

/// Every vertex of the mended surface is one of those given.
void expect_no_vertex_moved(const SurfaceMesh& mended, const SurfaceMesh& given) {
  for (const Vec3& v : mended.vertices)
    EXPECT_NE(std::find(given.vertices.begin(), given.vertices.end(), v), given.vertices.end()) << v.transpose();
}

/// Mends and expects a solid of this volume.
SurfaceMending mended_to(SurfaceMesh surface, double volume, double error = kRoundOff) {
  const SurfaceMesh given = surface;
  const SurfaceMending done = mend_surface(surface, weld_tolerance(surface));
  EXPECT_TRUE(surface_quality(surface).closed_manifold()) << done.text();
  EXPECT_NEAR(std::abs(enclosed_volume(surface)), volume, error * volume) << done.text();
  expect_no_vertex_moved(surface, given);
  EXPECT_FALSE(mend_surface(surface, weld_tolerance(surface)).any()) << "once is enough";
  return done;
}

TEST(MendSurface, ACleanOneStaysAsItIs) {
  SurfaceMesh s = plate();
  const SurfaceMesh before = s;
  const SurfaceMending done = mend_surface(s, weld_tolerance(s));
  EXPECT_FALSE(done.any());
  EXPECT_EQ(done.text(), "");
  EXPECT_EQ(s.triangles, before.triangles);
  EXPECT_EQ(s.vertices, before.vertices);
}

TEST(MendSurface, ATriangleThatStandsTwiceCountsOnceWhicheverWayItRuns) {
  for (const bool back : {false, true})
    for (std::size_t which = 0; which < 12; ++which) {
      SurfaceMesh s = plate();
      Triangle t = s.triangles[which];
      if (back) std::swap(t[0], t[1]);
      s.triangles.push_back(t);
      s.triangles.push_back(t);
      const SurfaceMending done = mended_to(s, kPlate);
      EXPECT_EQ(done.doubled, 2);
      EXPECT_EQ(done.turned, 0);
    }
}

TEST(MendSurface, TrianglesAreTurnedToRunAsTheMostOfTheirNeighbours) {
  SurfaceMesh s = plate();
  for (const std::size_t i : {0u, 5u, 7u, 11u}) std::swap(s.triangles[i][1], s.triangles[i][2]);
  EXPECT_EQ(mended_to(s, kPlate).turned, 4);
  SurfaceMesh most = shapes::turned(plate());
  std::swap(most.triangles[3][1], most.triangles[3][2]);
  mend_surface(most, 0.0);
  EXPECT_NEAR(enclosed_volume(most), -kPlate, kRoundOff * kPlate) << "the greater part stays, inside out";
}

TEST(MendSurface, AOneSidedSurfaceStays) {
  SurfaceMesh moebius;  // Möbius' own, of five vertices and five triangles
  moebius.vertices = {{1, 0, 0}, {0, 1, 0.2}, {-1, 0, 0}, {0, -1, 0.1}, {0, 0, 1}};
  moebius.triangles = {{0, 1, 2}, {1, 2, 3}, {2, 3, 4}, {3, 4, 0}, {4, 0, 1}};
  const SurfaceMesh before = moebius;
  mend_surface(moebius, 0.0);
  EXPECT_EQ(moebius.triangles, before.triangles);
}

TEST(MendSurface, CornersTornByLastBitsAreWelded) {
  const SurfaceMesh ball = shapes::sphere({0, 0, 0}, 1.0, 3);
  const double volume = enclosed_volume(ball);
  EXPECT_FALSE(mended_to(torn(ball, 0.0), volume).any()) << "equal coordinates need no word";
  mended_to(torn(ball, 1e-6 * 2.0), volume, 1e-5);
  // In single precision, far from the origin.
  SurfaceMesh far = torn(ball, 0.0);
  for (Vec3& v : far.vertices)
    for (int a = 0; a < 3; ++a) v[a] = std::nextafterf(static_cast<float>(v[a] + 1000.0), v[a] > 0 ? 2000.0f : 0.0f);
  mended_to(far, volume, 1e-3);
}

TEST(MendSurface, AGapWiderThanTheToleranceStays) {
  SurfaceMesh s = torn(plate(), 1e-4);
  mend_surface(s, weld_tolerance(s));
  EXPECT_GT(surface_quality(s).boundary_edges, 0);
}

/// A cube whose bottom has four triangles around its middle where the sides have the corners alone, and whose top edge
/// on one side is cut in three.
TEST(MendSurface, TJunctionsAreSplit) {
  SurfaceMesh s;
  s.vertices = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
  s.triangles = {{0, 2, 1}, {0, 3, 2}, {0, 1, 5}, {0, 5, 4}, {1, 2, 6},
                 {1, 6, 5}, {2, 3, 7}, {2, 7, 6}, {3, 0, 4}, {3, 4, 7}};
  s.vertices.insert(s.vertices.end(), {{0.25, 0, 1}, {0.7, 0, 1}, {1, 0.5, 1}, {0.4, 0.6, 1}});
  // The top, 4-8-9-5-10-6-7, around its middle.
  for (const auto& [a, b] : {std::pair(4, 8), {8, 9}, {9, 5}, {5, 10}, {10, 6}, {6, 7}, {7, 4}})
    s.triangles.push_back({a, b, 11});
  EXPECT_EQ(mended_to(s, 1.0).split, 3);
}

TEST(MendSurface, AnEdgeMayBeSplitInManyThousands) {
  SurfaceMesh s;
  s.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  s.triangles = {{0, 2, 1}, {1, 2, 3}, {2, 0, 3}};
  constexpr Index kParts = 5'000;
  Index last = 0;
  for (Index i = 1; i <= kParts; ++i) {  // the side at y = 0, a fan about its tip
    Index next = 1;
    if (i < kParts) {
      next = static_cast<Index>(s.vertices.size());
      s.vertices.push_back({static_cast<double>(i) / kParts, 0, 0});
    }
    s.triangles.push_back({last, next, 3});
    last = next;
  }
  EXPECT_EQ(mended_to(s, 1.0 / 6.0).split, kParts - 1);
}

TEST(MendSurface, AFlatTriangleGoesAndItsNeighbourIsSplit) {
  SurfaceMesh s = shapes::box({0, 0, 0}, {1, 1, 1});
  // A vertex in the middle of an edge, which the triangle on one side has and the other has by a flat triangle alone.
  const Triangle cut = s.triangles[0];
  s.vertices.push_back(0.5 * (s.vertices[cut[0]] + s.vertices[cut[1]]));
  const auto middle = static_cast<Index>(s.vertices.size() - 1);
  s.triangles[0] = {cut[0], middle, cut[2]};
  s.triangles.push_back({middle, cut[1], cut[2]});
  s.triangles.push_back({cut[0], cut[1], middle});
  const SurfaceMending done = mended_to(s, 1.0);
  EXPECT_EQ(done.flat, 1);
  EXPECT_EQ(done.split, 1);
}

TEST(MendSurface, ABodyOfSheetsWithTwoSidesIsABody) {
  SurfaceMesh s = shapes::box({0, 0, 0}, {1, 2, 3});
  shapes::append(shapes::turned(s), s);
  SurfaceMesh torn_sides = torn(s, 0.0);
  for (const SurfaceMesh& sides : {s, torn_sides}) EXPECT_EQ(mended_to(sides, 6.0).doubled, 12);
}

TEST(MendSurface, AWallBetweenTwoBodiesGoes) {
  for (const bool back : {false, true}) {  // whichever way the second body runs
    SurfaceMesh s = shapes::box({0, 0, 0}, {1, 1, 1});
    SurfaceMesh other = shapes::box({0, 0, 0}, {1, 1, 1});
    for (Vec3& v : other.vertices) v.x() = 2.0 - v.x();  // mirrored: triangles of the wall fit
    shapes::append(back ? other : shapes::turned(other), s);
    EXPECT_EQ(mended_to(s, 2.0).doubled, 4);
  }
}

TEST(MendSurface, ASheetByItselfKeepsItsTwoSides) {
  SurfaceMesh s = shapes::box({0, 0, 0}, {1, 1, 1});
  s.triangles.resize(10);  // without a lid
  shapes::append(shapes::turned(s), s);
  s.triangles.push_back(s.triangles.front());
  mend_surface(s, weld_tolerance(s));
  EXPECT_EQ(s.triangles.size(), 20u);
}

TEST(MendSurface, AFinOnABodyGoesAndTheBodyStays) {
  SurfaceMesh s = shapes::box({0, 0, 0}, {1, 1, 1});
  const Triangle t = s.triangles[0];
  s.vertices.push_back(s.vertices[t[0]] + Vec3(-3, -4, -5));
  const auto tip = static_cast<Index>(s.vertices.size() - 1);
  s.triangles.push_back({t[0], t[1], tip});
  s.triangles.push_back({t[1], t[0], tip});
  EXPECT_EQ(mended_to(s, 1.0).doubled, 2);
}

TEST(MendSurface, ANegativeToleranceIsRefused) {
  SurfaceMesh s = plate();
  EXPECT_THROW(mend_surface(s, -1.0), InvalidArgument);
  EXPECT_THROW(mend_surface(s, std::numeric_limits<double>::quiet_NaN()), InvalidArgument);
}

}  // namespace
}  // namespace limber
