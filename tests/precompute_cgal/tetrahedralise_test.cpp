#include "limber/precompute/tetrahedralise.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "limber/core/error.h"
#include "limber/mesh/winding_number.h"
#include "soup.h"

namespace limber {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double kRoundOff = 1e-12;  // volumes are sums of thousands of terms
// The boundary keeps within a tenth of a cell of the surface, as docs/tetrahedralisation.md promises.
constexpr double kBoundaryError = 0.1;
// Exudation of slivers reconnects nodes after the refinement has met the bound.
constexpr double kExudation = 0.1;

Index bodies(const TetMesh& mesh) {
  const auto label = connected_components(mesh);
  return 1 + *std::max_element(label.begin(), label.end());
}

double surface_area(const SurfaceMesh& s) {
  double sum = 0.0;
  for (const Triangle& t : s.triangles)
    sum += 0.5 * (s.vertices[t[1]] - s.vertices[t[0]]).cross(s.vertices[t[2]] - s.vertices[t[0]]).norm();
  return sum;
}

/// A closed band around the z axis, of quadrilaterals cut in two, seen from outside.
SurfaceMesh ring(double radius, double thickness, double height, int sides) {
  SurfaceMesh s;
  const double r[] = {radius - thickness / 2.0, radius + thickness / 2.0}, z[] = {0.0, height};
  for (int i = 0; i < sides; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / sides;
    for (const auto& [in, up] : {std::pair(0, 0), std::pair(1, 0), std::pair(1, 1), std::pair(0, 1)})
      s.vertices.emplace_back(r[in] * std::cos(angle), r[in] * std::sin(angle), z[up]);
    const Index here = 4 * i, next = 4 * ((i + 1) % sides);
    for (Index k = 0; k < 4; ++k) {
      const Index l = (k + 1) % 4;
      s.triangles.push_back({here + k, next + k, next + l});
      s.triangles.push_back({here + k, next + l, here + l});
    }
  }
  return s;
}

template <class Exception>
std::string message_of(const auto& action) {
  try {
    action();
  } catch (const Exception& e) {
    return e.what();
  }
  return "no error";
}

TEST(Tetrahedralise, ABoxKeepsItsEdgesAndSoItsVolumeExactly) {
  Warnings warnings;
  const auto r = tetrahedralise(shapes::box({0, 0, 0}, {1, 2, 0.5}), {.cell_size = 0.25}, warnings);
  EXPECT_FALSE(r.wrapped);
  EXPECT_NEAR(r.volume_before, 1.0, kRoundOff);
  EXPECT_NEAR(r.volume_after, 1.0, kRoundOff);
  EXPECT_TRUE(surface_quality(boundary_surface(r.mesh).surface).closed_manifold());
  ASSERT_EQ(r.mesh.regions.size(), 1u);
  EXPECT_EQ(r.mesh.regions[0].name, "*");
  EXPECT_THAT(warnings, IsEmpty());
}

TEST(Tetrahedralise, NoTetIsMuchLargerThanAsked) {
  Warnings warnings;
  const double cell_size = 0.3;
  const auto r = tetrahedralise(shapes::sphere({0, 0, 0}, 1.0, 3), {.cell_size = cell_size}, warnings);
  for (const Tet& t : r.mesh.tets) {
    // The circumcentre c is as far from all corners: 2 (xₐ − x₀)·(c − x₀) = |xₐ − x₀|².
    Mat3 edges;
    Vec3 squares;
    for (int a = 1; a < 4; ++a) {
      edges.row(a - 1) = r.mesh.nodes[t[a]] - r.mesh.nodes[t[0]];
      squares[a - 1] = edges.row(a - 1).squaredNorm();
    }
    EXPECT_LE((edges.inverse() * squares).norm() / 2.0, cell_size * (1.0 + kExudation));
  }
}

TEST(Tetrahedralise, TheSameInputGivesTheSameBits) {
  Warnings warnings;
  const auto a = tetrahedralise(shapes::soup(), {.cell_size = 0.2}, warnings);
  const auto b = tetrahedralise(shapes::soup(), {.cell_size = 0.2}, warnings);
  EXPECT_EQ(a.mesh.nodes, b.mesh.nodes);
  EXPECT_EQ(a.mesh.tets, b.mesh.tets);
}

TEST(Tetrahedralise, ASoupIsWrappedAndFillsTheSolidItStandsFor) {
  Warnings warnings;
  const double cell_size = 0.15;
  const auto r = tetrahedralise(shapes::soup(), {.cell_size = cell_size}, warnings);
  EXPECT_TRUE(r.wrapped);
  EXPECT_THAT(r.why_wrapped, HasSubstr("boundary edges"));
  EXPECT_THAT(r.why_wrapped, HasSubstr("edges of three or more triangles"));
  const BoundarySurface boundary = boundary_surface(r.mesh);
  EXPECT_TRUE(surface_quality(boundary.surface).closed_manifold());
  EXPECT_EQ(bodies(r.mesh), 1);
  EXPECT_NEAR(r.volume_after, shapes::soup_volume(), kBoundaryError * cell_size * surface_area(boundary.surface));
}

TEST(Tetrahedralise, ABlockWithOneFaultIsMendedAndKeepsItsVolume) {
  const double volume = 0.2 * 0.1 * 0.02;
  SurfaceMesh twice = shapes::box({0, 0, 0}, {0.2, 0.1, 0.02}), flipped = twice, jitter;
  for (const Triangle& t : twice.triangles) {
    const auto base = static_cast<Index>(jitter.vertices.size());
    for (const Index v : t) jitter.vertices.push_back(twice.vertices[v] * (1.0 + 1e-7 * (v % 3)));
    jitter.triangles.push_back({base, base + 1, base + 2});
  }
  twice.triangles.push_back(twice.triangles[4]);
  std::swap(flipped.triangles[4][0], flipped.triangles[4][1]);
  for (const auto& [block, what] :
       {std::pair(twice, "1 doubled triangle dropped"), std::pair(flipped, "1 triangle turned")}) {
    Warnings warnings;
    const auto r = tetrahedralise(block, {.cell_size = 0.03}, warnings);
    EXPECT_FALSE(r.wrapped) << r.why_wrapped;
    EXPECT_TRUE(r.sharp_edges_kept);
    EXPECT_NEAR(r.volume_after, volume, kRoundOff * volume);
    EXPECT_THAT(warnings, ElementsAre(HasSubstr(what)));
    EXPECT_EQ(r.mending.text(), what);
  }
  Warnings warnings;
  const auto r = tetrahedralise(jitter, {.cell_size = 0.03}, warnings);
  EXPECT_FALSE(r.wrapped) << r.why_wrapped;
  EXPECT_NEAR(r.volume_after, volume, 1e-5 * volume);
}

// The offset is 1/1500 of the diagonal, 1.9 % of the thickness, on both sides.
TEST(Tetrahedralise, AWrapTellsTheVolumeThatItAdds) {
  const double volume = 0.2 * 0.2 * 0.01;
  SurfaceMesh block = shapes::box({0, 0, 0}, {0.2, 0.2, 0.01});
  shapes::append(shapes::box({0.05, 0.05, 0.005}, {0.06, 0.06, 0.01}), block);  // overlaps it and adds nothing
  Warnings warnings;
  const auto r = tetrahedralise(block, {.cell_size = 0.03}, warnings);
  EXPECT_TRUE(r.wrapped);
  EXPECT_NEAR(r.wrap_adds, r.volume_before - volume, 0.1 * r.wrap_adds);
  EXPECT_GT(r.wrap_adds, 0.03 * volume);
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("% of volume and mass")));
}

TEST(Tetrahedralise, AShellInsideIsACavityWhicheverWayItRuns) {
  for (const bool inner_outward : {true, false}) {
    SurfaceMesh hollow = shapes::sphere({0, 0, 0}, 1.0, 3);
    const SurfaceMesh inner = shapes::sphere({0.1, 0, 0}, 0.5, 3);
    shapes::append(inner_outward ? inner : shapes::turned(inner), hollow);
    Warnings warnings;
    const auto r = tetrahedralise(hollow, {.cell_size = 0.25}, warnings);
    const double volume = enclosed_volume(shapes::sphere({0, 0, 0}, 1.0, 3)) - enclosed_volume(inner);
    EXPECT_FALSE(r.wrapped);
    EXPECT_NEAR(r.volume_before, volume, kRoundOff);
    const BoundarySurface boundary = boundary_surface(r.mesh);
    EXPECT_EQ(surface_quality(boundary.surface).components, 2);
    EXPECT_NEAR(r.volume_after, volume, kBoundaryError * 0.25 * surface_area(boundary.surface));
    EXPECT_EQ(warnings.size(), inner_outward ? 1u : 0u);
  }
}

TEST(Tetrahedralise, ABodyMuchSmallerThanACellIsNotLost) {
  SurfaceMesh two = shapes::box({0, 0, 0}, {1, 1, 1});
  shapes::append(shapes::sphere({3, 0, 0}, 0.05, 2), two);
  Warnings warnings;
  const auto r = tetrahedralise(two, {.cell_size = 0.3}, warnings);
  EXPECT_EQ(bodies(r.mesh), 2);
  EXPECT_NEAR(r.volume_after, r.volume_before, 0.01 * r.volume_before);
}

TEST(Tetrahedralise, AnInsideOutSurfaceIsTurnedWithAWarning) {
  Warnings warnings;
  const auto r = tetrahedralise(shapes::turned(shapes::box({0, 0, 0}, {1, 1, 1})), {.cell_size = 0.3}, warnings);
  EXPECT_NEAR(r.volume_after, 1.0, kRoundOff);
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("inside out")));
}

TEST(Tetrahedralise, ARodAboutOneCellThickHasNoFlatTets) {
  Warnings warnings;
  const auto r = tetrahedralise(shapes::box({0, 0, 0}, {1, 0.02, 0.02}), {}, warnings);
  for (std::size_t i = 0; i < r.mesh.tets.size(); ++i) {
    double longest = 0.0;
    for (const Index a : r.mesh.tets[i])
      for (const Index b : r.mesh.tets[i]) longest = std::max(longest, (r.mesh.nodes[a] - r.mesh.nodes[b]).norm());
    // The regular tet has 6V/L³ = 1/√2; a hundredth of that is where stiffness begins to suffer.
    EXPECT_GT(6.0 * signed_volume(r.mesh, static_cast<Index>(i)), 1e-3 * std::pow(longest, 3));
  }
}

TEST(Tetrahedralise, FiveVerticesAreEnough) {
  SurfaceMesh pyramid;
  pyramid.vertices = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}, {0, 0, 1}};
  pyramid.triangles = {{0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}, {0, 2, 1}, {0, 3, 2}};
  Warnings warnings;
  const auto r = tetrahedralise(pyramid, {}, warnings);
  EXPECT_NEAR(r.volume_after, 4.0 / 3.0, kRoundOff);
  EXPECT_THAT(warnings, IsEmpty());
}

TEST(Tetrahedralise, APlateThinnerThanACellKeepsItsVolumeAndStaysInOnePiece) {
  const double thickness = 0.05;
  Warnings warnings;
  const auto r = tetrahedralise(shapes::box({0, 0, 0}, {1, 1, thickness}), {.cell_size = 0.18}, warnings);
  EXPECT_NEAR(r.volume_after, thickness, kRoundOff);
  EXPECT_EQ(bodies(r.mesh), 1);
  EXPECT_THAT(warnings, IsEmpty());
}

TEST(Tetrahedralise, AThinShellIsWholeAndManifold) {
  SurfaceMesh shell = shapes::sphere({0, 0, 0}, 1.0, 4);
  shapes::append(shapes::turned(shapes::sphere({0, 0, 0}, 0.92, 4)), shell);
  Warnings warnings;
  const auto r = tetrahedralise(shell, {.cell_size = 0.4}, warnings);  // five times as thick as the shell
  EXPECT_NEAR(r.volume_after, r.volume_before, 0.1 * r.volume_before);
  const SurfaceQuality quality = surface_quality(boundary_surface(r.mesh).surface);
  EXPECT_TRUE(quality.closed_manifold());
  EXPECT_EQ(quality.components, 2);
  EXPECT_THAT(warnings, IsEmpty());
}

TEST(Tetrahedralise, WhatIsTooThinForTheBudgetIsRefusedWithTheBudgetItAsksFor) {
  const SurfaceMesh plate = shapes::box({0, 0, 0}, {1, 1, 0.02});
  const TetrahedralisationOptions poor{.cell_size = 0.4, .max_nodes = 1};
  Warnings warnings;
  const std::string message = message_of<ComputationError>([&] { tetrahedralise(plate, poor, warnings); });
  const std::size_t asked = message.find("ask for ");
  ASSERT_NE(asked, std::string::npos) << message;
  const int budget = static_cast<int>(1.1 * std::stod(message.substr(asked + 8)));
  const auto rich = tetrahedralise(plate, {.cell_size = 0.2, .max_nodes = budget}, warnings);
  EXPECT_NEAR(rich.volume_after, rich.volume_before, 0.1 * rich.volume_before);
  EXPECT_THAT(warnings, IsEmpty());
}

TEST(Tetrahedralise, WrongOptionsAndImpossibleSizesAreOneLineEach) {
  Warnings warnings;
  const SurfaceMesh box = shapes::box({0, 0, 0}, {1, 1, 1});
  const auto with = [&](const TetrahedralisationOptions& options) {
    return [&box, &warnings, options] { tetrahedralise(box, options, warnings); };
  };
  EXPECT_THAT(message_of<InvalidArgument>(with({.cell_size = -1.0})), HasSubstr("cell_size is -1"));
  EXPECT_THAT(message_of<InvalidArgument>(with({.alpha = std::nan("")})), HasSubstr("alpha is nan"));
  EXPECT_THAT(message_of<ComputationError>(with({.cell_size = 1e-4})), HasSubstr("try cell size"));
  EXPECT_THAT(message_of<InvalidArgument>(with({.max_nodes = 0})), HasSubstr("max_nodes is 0"));
  SurfaceMesh open = box;
  open.triangles.pop_back();
  EXPECT_THAT(message_of<ComputationError>([&] { tetrahedralise(open, {.alpha = 1e-5}, warnings); }),
              HasSubstr("try alpha"));
  EXPECT_THAT(message_of<InputError>([&] { tetrahedralise(SurfaceMesh{}, {}, warnings); }), HasSubstr("no triangles"));
}

// Refinement makes cells no wider than a plate is thick.
TEST(Tetrahedralise, ThinPartsGetWideCellsForQuadraticElements) {
  const SurfaceMesh plate = shapes::box({0, 0, 0}, {0.2, 0.1, 0.004});
  Warnings warnings;
  const auto narrow = tetrahedralise(plate, {.cell_size = 0.02}, warnings);
  const auto wide = tetrahedralise(plate, {.cell_size = 0.02, .quadratic = true}, warnings);
  EXPECT_LT(4 * wide.mesh.nodes.size(), narrow.mesh.nodes.size());
  EXPECT_NEAR(wide.volume_after, wide.volume_before, kRoundOff * wide.volume_before) << "sides and edges stay";
  EXPECT_TRUE(surface_quality(boundary_surface(wide.mesh).surface).closed_manifold());
  EXPECT_EQ(bodies(wide.mesh), 1);
  EXPECT_THAT(warnings, IsEmpty());
  const auto again = tetrahedralise(plate, {.cell_size = 0.02, .quadratic = true}, warnings);
  EXPECT_EQ(again.mesh.nodes, wide.mesh.nodes);
  EXPECT_EQ(again.mesh.tets, wide.mesh.tets);
}

TEST(Tetrahedralise, WideCellsStayNearACurvedSurface) {
  const double radius = 0.05, thickness = 0.002, height = 0.02;
  const SurfaceMesh band = ring(radius, thickness, height, 128);
  Warnings warnings;
  const auto r = tetrahedralise(band, {.quadratic = true}, warnings);
  for (const Vec3& x : r.mesh.nodes) {
    const double off = std::abs(std::hypot(x[0], x[1]) - radius) - thickness / 2.0;
    EXPECT_LT(off, 0.05 * thickness);
  }
  EXPECT_NEAR(r.volume_after, r.volume_before, 5e-3 * r.volume_before);
  EXPECT_TRUE(surface_quality(boundary_surface(r.mesh).surface).closed_manifold());
}

// Cells as wide as the section put all nodes on its edges, where tets come out flat: the next tries are finer there
// too.
TEST(Tetrahedralise, ABarOfSquareSectionKeepsItsEdges) {
  for (const double length : {0.1, 0.4}) {
    Warnings warnings;
    const auto r = tetrahedralise(shapes::box({0, 0, 0}, {length, 0.004, 0.004}), {.quadratic = true}, warnings);
    EXPECT_TRUE(r.sharp_edges_kept);
    EXPECT_NEAR(r.volume_after, 1.6e-5 * length, 1e-9 * 1.6e-5 * length);
  }
}

/// Volume of the tets on the inner side of a surface, of which each is asked to lie on one side whole.
double volume_inside(const TetMesh& mesh, const SurfaceMesh& surface) {
  double volume = 0.0;
  Index straddling = 0;
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) {
    Vec3 middle = Vec3::Zero();
    for (const Index n : mesh.tets[i]) middle += 0.25 * mesh.nodes[n];
    int inside = 0;
    for (const Index n : mesh.tets[i])
      inside += std::abs(winding_number(surface, middle + 0.99 * (mesh.nodes[n] - middle))) > 0.5 ? 1 : 0;
    if (inside % 4 != 0) ++straddling;
    if (inside == 4) volume += signed_volume(mesh, static_cast<Index>(i));
  }
  EXPECT_EQ(straddling, 0);
  return volume;
}

/// Moves points of height z by `per_height` · z along x.
SurfaceMesh leaning(SurfaceMesh surface, double per_height) {
  for (Vec3& v : surface.vertices) v.x() += per_height * v.z();
  return surface;
}

TEST(Tetrahedralise, FacesFollowASurfaceInsideOneThatCutsTheBoundaryAndOneThatLiesInIt) {
  const SurfaceMesh box = shapes::box({0, 0, 0}, {1, 0.3, 0.2});
  const std::vector<SurfaceMesh> inner{shapes::box({0.613, 0.0771, 0.0513}, {0.877, 0.211, 0.1493}),
                                       leaning(shapes::box({0.1, -0.1, -0.1}, {0.24, 0.4, 0.3}), 0.5),
                                       shapes::box({0.95, 0, 0}, {1, 0.3, 0.2})};
  const double volumes[] = {0.264 * 0.1339 * 0.098, 0.14 * 0.3 * 0.2, 0.05 * 0.3 * 0.2};
  for (const bool quadratic : {false, true}) {
    Warnings warnings;
    const auto r = tetrahedralise(box, {.quadratic = quadratic, .inner_surfaces = inner}, warnings);
    EXPECT_THAT(warnings, IsEmpty());
    EXPECT_THAT(r.followed, ElementsAre(true, true, true));
    EXPECT_NEAR(r.volume_after, 0.06, kRoundOff);
    for (std::size_t i = 0; i < inner.size(); ++i)
      EXPECT_NEAR(volume_inside(r.mesh, inner[i]), volumes[i], kRoundOff) << i;
  }
}

TEST(Tetrahedralise, NodesBetweenTheSidesOfACurvedSurfaceKeepWithinATenthOfACell) {
  const Vec3 center(0.7, 0, 0);
  const double radius = 0.6, cell = 0.2;
  const SurfaceMesh shell = shapes::sphere(center, radius, 4);  // leaves the ball
  Warnings warnings;
  const auto r =
      tetrahedralise(shapes::sphere({0, 0, 0}, 1.0, 4), {.cell_size = cell, .inner_surfaces = {shell}}, warnings);
  EXPECT_THAT(r.followed, ElementsAre(true));
  std::vector<int> sides(r.mesh.nodes.size());  // of the shell, on which tets at a node lie
  for (const Tet& tet : r.mesh.tets) {
    Vec3 middle = Vec3::Zero();
    for (const Index n : tet) middle += 0.25 * r.mesh.nodes[n];
    for (const Index n : tet) sides[n] |= (middle - center).norm() < radius ? 1 : 2;
  }
  Index between = 0;
  for (std::size_t n = 0; n < sides.size(); ++n) {
    if (sides[n] != 3) continue;
    ++between;
    EXPECT_NEAR((r.mesh.nodes[n] - center).norm(), radius, kBoundaryError * cell);
  }
  EXPECT_GT(between, 50);
}

TEST(Tetrahedralise, AnInnerSurfaceThatIsOpenIsToldNotFollowed) {
  SurfaceMesh open = shapes::box({0.2, 0.2, 0.2}, {0.8, 0.8, 0.8});
  open.triangles.pop_back();
  Warnings warnings;
  const auto r = tetrahedralise(shapes::box({0, 0, 0}, {1, 1, 1}), {.inner_surfaces = {open}}, warnings);
  EXPECT_THAT(r.followed, ElementsAre(false));
}

}  // namespace
}  // namespace limber
