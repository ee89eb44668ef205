// Materials inside a body: which tets take them, bars of two materials and of one that varies against their closed
// forms, and files of materials.
#include "limber/precompute/material_regions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/mesh/ten_node_tet.h"
#include "limber/precompute/bake.h"
#include "limber/precompute/modal_analysis.h"
#include "limber/precompute/tetrahedralise.h"
#include "mesh_files.h"
#include "regions/assign_regions.h"
#include "tet_box.h"

namespace limber::material_regions {
namespace {

using ::testing::HasSubstr;

constexpr double kPi = std::numbers::pi;
// Aluminium and steel, but for Poisson's ratio.
const Material kSoft{.youngs_modulus = 69e9, .poisson_ratio = 0.0, .density = 2700.0};
const Material kStiff{.youngs_modulus = 207e9, .poisson_ratio = 0.0, .density = 7850.0};

template <class Error>
std::string message_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& e) {
    return e.what();
  }
  return "accepted";
}

/// The faces of a box, named by the half of x that they lie in.
GroupedSurface halves_of(const Vec3& size) {
  const SurfaceMesh boundary = boundary_surface(testing::tet_box(2, 2, 2, size)).surface;
  GroupedSurface faces{.surface = {.vertices = boundary.vertices, .triangles = {}}, .face_of = {}, .groups = {}};
  for (const bool right : {false, true}) {
    const auto first = static_cast<Index>(faces.surface.triangles.size());
    for (const Triangle& t : boundary.triangles) {
      const Vec3 middle = (boundary.vertices[t[0]] + boundary.vertices[t[1]] + boundary.vertices[t[2]]) / 3.0;
      if ((middle.x() > 0.5 * size.x()) == right) faces.surface.triangles.push_back(t);
    }
    const auto count = static_cast<Index>(faces.surface.triangles.size()) - first;
    faces.groups.push_back({.name = right ? "right" : "left", .material = "all", .first = first, .count = count});
  }
  for (std::size_t t = 0; t < faces.surface.triangles.size(); ++t) faces.face_of.push_back(static_cast<Index>(t));
  return faces;
}

/// Volume of the tets of each region of a name.
double volume_of(const TetMesh& mesh, const std::string& name) {
  double volume = 0.0;
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    if (mesh.regions[mesh.tet_region[t]].name == name) volume += signed_volume(mesh, static_cast<Index>(t));
  return volume;
}

TetMesh assigned(TetMesh mesh, const MaterialTable& table, const std::vector<MaterialRegion>& regions,
                 const std::optional<GroupedSurface>& faces = std::nullopt) {
  internal::assign_regions(mesh, table, regions, faces);
  return mesh;
}

TEST(MaterialRegions, LaterOnesCountOverEarlierAndTheTableHasTheRest) {
  const Vec3 size(2.0, 1.0, 1.0);
  SurfaceMesh shell = boundary_surface(testing::tet_box(1, 1, 1, {0.5, 0.5, 0.5})).surface;
  for (Vec3& v : shell.vertices) v += Vec3(1.25, 0.25, 0.25);
  for (Triangle& t : shell.triangles) std::swap(t[1], t[2]);  // inside out
  const TetMesh mesh = assigned(testing::tet_box(32, 16, 16, size), {{"*", kSoft}},
                                {{"half", InsideHalfSpace{.point = Vec3(1.0, 0, 0), .normal = Vec3(-3, 0, 0)}, kStiff},
                                 {"ball", InsideBall{.center = Vec3(0.5, 0.5, 0.5), .radius = 0.4}, kStiff},
                                 {"shell", InsideShells{shell}, kSoft},
                                 {"corner", InsideBox{.low = Vec3(1.5, -1, -1), .high = Vec3(3, 0.5, 0.5)}, kSoft}});
  EXPECT_NEAR(volume_of(mesh, "ball"), 4.0 / 3.0 * kPi * 0.064, 0.02 * 0.268);
  EXPECT_NEAR(volume_of(mesh, "corner"), 0.125, 1e-12);
  EXPECT_NEAR(volume_of(mesh, "shell"), 0.125 - 0.25 * 0.25 * 0.25, 1e-12);
  EXPECT_NEAR(volume_of(mesh, "half"), 1.0 - 0.125 - 0.125 + 0.25 * 0.25 * 0.25, 1e-12);
  EXPECT_NEAR(volume_of(mesh, "*") + volume_of(mesh, "ball"), 1.0, 1e-12);
}

TEST(MaterialRegions, NearestFacesNameTetsAllTheWayOrDownToADepth) {
  const Vec3 size(2.0, 1.0, 1.0);
  const TetMesh box = testing::tet_box(20, 10, 10, size);
  const TetMesh halves = assigned(box, {{"left", kSoft}, {"right", kStiff}}, {}, halves_of(size));
  EXPECT_NEAR(volume_of(halves, "left"), 1.0, 1e-12);
  EXPECT_NEAR(volume_of(halves, "right"), 1.0, 1e-12);
  const TetMesh skin =
      assigned(box, {{"*", kSoft}}, {{"skin", NearFaces{.name = "all", .depth = 0.1}, kStiff}}, halves_of(size));
  EXPECT_NEAR(volume_of(skin, "skin"), 2.0 - 1.8 * 0.8 * 0.8, 0.03);
}

TEST(MaterialRegions, BadOnesAreRefusedInOneLine) {
  const Vec3 size(2.0, 1.0, 1.0);
  const TetMesh box = testing::tet_box(4, 2, 2, size);
  const auto error = [&](const MaterialRegion& region) {
    return message_of<InputError>([&] { assigned(box, {{"*", kSoft}}, {region}, halves_of(size)); });
  };
  EXPECT_THAT(error({"far", InsideBall{.center = Vec3(9, 9, 9), .radius = 1.0}, kStiff}),
              HasSubstr("region \"far\" is empty"));
  EXPECT_THAT(error({"top", NearFaces{.name = "top"}, kStiff}), HasSubstr("no group and no material of that name"));
  MaterialField field{.grid = {.counts = {2, 2, 2}, .step = 0.9 * Mat3::Identity(), .fields = {}}, .rest = kStiff};
  field.grid.fields = {{"density", std::vector<double>(8, 1000.0)}};
  EXPECT_THAT(error({"scan", Everywhere{}, field}), HasSubstr("do not cover it: the tetrahedron at ("));
  field.grid.step *= 3.0;
  EXPECT_EQ(error({"scan", Everywhere{}, field}), "accepted");
  field.grid.fields[0].values[0] = -5e4;
  EXPECT_THAT(error({"scan", Everywhere{}, field}), HasSubstr("density is"));
  SurfaceMesh open = boundary_surface(testing::tet_box(1, 1, 1, size)).surface;
  open.triangles.pop_back();
  EXPECT_THAT(message_of<InvalidArgument>([&] {
                assigned(box, {{"*", kSoft}}, {{"open", InsideShells{open}, kStiff}});
              }),
              HasSubstr("its shells are not closed: 3 edges of one triangle"));
  EXPECT_THAT(message_of<InputError>([&] {
                assigned(box, {}, {{"l", NearFaces{.name = "left"}, kStiff}});
              }),
              HasSubstr("no surface with named faces"));
  EXPECT_THAT(message_of<InputError>([&] {
                assigned(box, {{"*", kSoft}, {"heel", kStiff}}, {});
              }),
              HasSubstr("no region \"heel\""));
}

// Bars along x without lateral contraction (nu = 0): longitudinal waves are those of one dimension, exactly.

/// The lowest modes that move along the bar, Hz.
std::vector<double> longitudinal_hz(TetMesh mesh, const std::vector<MaterialRegion>& regions, std::size_t count) {
  Warnings warnings;
  const std::vector<Material> materials = internal::assign_regions(mesh, {{"*", kStiff}}, regions, std::nullopt);
  add_mid_edge_nodes(mesh);
  const ModalAnalysis a =
      analyse_modes(mesh, materials, {}, {.modes = 24, .mass = MassKind::kConsistent, .certify = false}, warnings);
  std::vector<double> found;
  for (std::size_t m = 0; m < a.eigenvalues.size() && found.size() < count; ++m) {
    const Eigen::Map<const Eigen::Matrix3Xd> w(a.shapes.data() + 3 * m * mesh.nodes.size(), 3, a.nodes);
    if (w.row(0).squaredNorm() > 0.9 * w.squaredNorm()) found.push_back(std::sqrt(a.eigenvalues[m]) / (2.0 * kPi));
  }
  EXPECT_EQ(found.size(), count);
  return found;
}

/// Roots of f, ascending, found by sign changes between steps.
std::vector<double> roots(const std::function<double(double)>& f, double step, std::size_t count) {
  std::vector<double> found;
  for (double low = 0.5 * step; found.size() < count; low += step) {
    double a = low, b = low + step;
    if (f(a) * f(b) > 0.0) continue;
    for (int i = 0; i < 100; ++i) {
      const double middle = 0.5 * (a + b);
      (f(a) * f(middle) <= 0.0 ? b : a) = middle;
    }
    found.push_back(0.5 * (a + b));
  }
  return found;
}

TetMesh meshed_bar(const Vec3& size, std::vector<SurfaceMesh> inner = {}) {
  Warnings warnings;
  return tetrahedralise(boundary_surface(testing::tet_box(1, 1, 1, size)).surface,
                        {.quadratic = true, .inner_surfaces = std::move(inner)}, warnings)
      .mesh;
}

// u' = 0 at both ends, u and E u' the same on both sides of the joint:
// Z1 sin(k1 L1) cos(k2 L2) + Z2 cos(k1 L1) sin(k2 L2) = 0, Z = √(E ρ).
std::vector<double> two_materials_hz(double length, double first) {
  const auto impedance = [](const Material& m) { return std::sqrt(m.youngs_modulus * m.density); };
  const auto slowness = [](const Material& m) { return std::sqrt(m.density / m.youngs_modulus); };
  const auto misfit = [&](double hz) {
    const double a = 2.0 * kPi * hz * slowness(kSoft) * first;
    const double b = 2.0 * kPi * hz * slowness(kStiff) * (length - first);
    return impedance(kSoft) * std::sin(a) * std::cos(b) + impedance(kStiff) * std::cos(a) * std::sin(b);
  };
  return roots(misfit, 100.0, 2);
}

TEST(MaterialRegions, ABarOfTwoMaterialsRingsAsItsClosedForm) {
  const double length = 0.3, first = 0.12;
  const std::vector<double> expected = two_materials_hz(length, first);
  const Vec3 size(length, 0.05, 0.03);
  const std::vector<MaterialRegion> regions{
      {"soft", InsideHalfSpace{.point = Vec3(first, 0, 0), .normal = Vec3::UnitX()}, kSoft}};
  const std::vector<double> followed = longitudinal_hz(testing::tet_box(15, 3, 2, size), regions, 2),
                            meshed = longitudinal_hz(meshed_bar(size), regions, 2);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_NEAR(followed[i], expected[i], 1e-4 * expected[i]) << "faces of tets lie in the joint, mode " << i;
    EXPECT_NEAR(meshed[i], expected[i], 0.01 * expected[i]) << "the joint runs along the nearest faces, mode " << i;
  }
}

// The joint lies on no grid. The shell leaves the bar at its end and below, and lies in its other sides.
TEST(MaterialRegions, TetsThatFollowAShellRingAsTheClosedFormOfABarOfTwoMaterials) {
  const double length = 0.3, first = 0.11373, beyond = 0.02;
  const Vec3 size(length, 0.05, 0.03);
  SurfaceMesh shell =
      boundary_surface(testing::tet_box(1, 1, 1, {first + beyond, size.y(), size.z() + beyond})).surface;
  for (Vec3& v : shell.vertices) v -= Vec3(beyond, 0, beyond);
  const std::vector<double> expected = two_materials_hz(length, first),
                            found =
                                longitudinal_hz(meshed_bar(size, {shell}), {{"soft", InsideShells{shell}, kSoft}}, 2);
  for (std::size_t i = 0; i < 2; ++i) EXPECT_NEAR(found[i], expected[i], 2e-4 * expected[i]) << "mode " << i;
}

// E and ρ as (1 + a x)²: with u = v / (1 + a x), v'' + k² v = 0, and free ends give
// tan kL = a² kL / (k² (1 + a L) + a²).
TEST(MaterialRegions, ABarOfVoxelsThatVaryRingsAsItsClosedForm) {
  const double length = 0.3, a = 3.0 / length;
  MaterialField field{.grid = {.counts = {61, 2, 2}, .step = Vec3(length / 60, 0.06, 0.04).asDiagonal(), .fields = {}},
                      .rest = kStiff};
  for (const auto& [name, base] : {std::pair("youngs_modulus", 1e10), std::pair("density", 1000.0)}) {
    field.grid.fields.push_back({name, {}});
    for (int yz = 0; yz < 4; ++yz)
      for (int i = 0; i < 61; ++i)
        field.grid.fields.back().values.push_back(base * std::pow(1.0 + a * length * i / 60.0, 2));
  }
  const double speed = std::sqrt(1e10 / 1000.0);
  const auto misfit = [&](double hz) {
    const double k = 2.0 * kPi * hz / speed;
    return std::sin(k * length) * (k * k * (1.0 + a * length) + a * a) - a * a * k * length * std::cos(k * length);
  };
  const std::vector<double> expected = roots(misfit, 100.0, 2);
  const std::vector<double> found =
      longitudinal_hz(meshed_bar({length, 0.06, 0.04}), {{"graded", Everywhere{}, field}}, 2);
  for (std::size_t i = 0; i < 2; ++i) EXPECT_NEAR(found[i], expected[i], 0.005 * expected[i]) << i;
}

TEST(MaterialRegions, ABakeTellsVolumesAndMassesAndTheErrorOfAFieldAsOfItsMaterial) {
  const Vec3 size(0.3, 0.06, 0.04);
  BakeOptions options{.materials = {{"*", kStiff}}, .elements = Elements::kQuadratic};
  options.analysis = {.modes = 4, .mass = MassKind::kConsistent};
  BakeInput input{.name = "bar", .mesh = testing::tet_box(6, 2, 1, size)};
  Warnings warnings;
  const BodyReport one = bake(input, options, warnings).bodies.at(0);
  options.regions = {{"left", InsideBox{.low = Vec3(-1, -1, -1), .high = Vec3(0.1, 1, 1)}, kSoft}};
  const BodyReport two = bake(input, options, warnings).bodies.at(0);
  ASSERT_EQ(two.regions.size(), 2u);
  EXPECT_EQ(two.regions[0].name, "left");
  EXPECT_NEAR(two.regions[0].volume, size.prod() / 3.0, 1e-15);
  EXPECT_NEAR(two.regions[0].mass, kSoft.density * size.prod() / 3.0, 1e-12);
  EXPECT_NEAR(two.solid.mass, two.regions[0].mass + two.regions[1].mass, 1e-12);
  // A field of nearly one value: each tet has a material of its own, and the estimate smooths over all of them.
  MaterialField field{.grid = {.counts = {2, 2, 2}, .step = size.asDiagonal(), .fields = {}}, .rest = kStiff};
  field.grid.fields = {{"density", {}}};
  for (int i = 0; i < 8; ++i) field.grid.fields[0].values.push_back(kStiff.density * (1.0 + 1e-9 * i));
  options.regions = {{"field", Everywhere{}, field}};
  const BodyReport varied = bake(input, options, warnings).bodies.at(0);
  ASSERT_EQ(varied.regions.size(), 1u);
  for (std::size_t m = 0; m < 4; ++m) {
    EXPECT_NEAR(varied.modes.frequencies_hz[m], one.modes.frequencies_hz[m], 1e-7 * one.modes.frequencies_hz[m]);
    EXPECT_NEAR(varied.modes.frequency_errors[m], one.modes.frequency_errors[m], 1e-6);
  }
}

class ReadMaterialsFile : public ::testing::Test {
 protected:
  ReadMaterialsFile() { std::filesystem::create_directories(folder_); }
  ~ReadMaterialsFile() override { std::filesystem::remove_all(folder_); }
  MaterialsFile read(const std::string& text) const {
    write_file(folder_ / "materials.json", text);
    Warnings warnings;
    return read_materials_file(folder_ / "materials.json", {.scale = 2.0}, warnings);
  }
  std::string error(const std::string& text) const {
    return message_of<InputError>([&] { read(text); });
  }
  const std::filesystem::path folder_ =
      std::filesystem::path(::testing::TempDir()) /
      ("limber_" + std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()));
};

TEST_F(ReadMaterialsFile, ListsKeepTheirOrderAndObjectsAreTables) {
  EXPECT_EQ(read(R"({"legs": "wood", "*": "rubber"})").table.size(), 2u);
  testing::write_obj(folder_ / "core.obj", boundary_surface(testing::tet_box(1, 1.0)).surface);
  write_file(folder_ / "grid.vtk",
             "# vtk DataFile Version 3.0\nt\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 2 1 1\nSPACING 3 1 1\n"
             "POINT_DATA 2\nSCALARS density float\n1000 2000\n");
  const MaterialsFile file = read(R"([
    {"name": "*", "material": "rubber"},
    {"name": "z", "faces": "legs", "depth": 0.1, "material": "wood"},
    {"name": "y", "shells": "core.obj", "material": {"youngs_modulus": 1e7, "poisson_ratio": 0.4, "density": 1100}},
    {"name": "x", "box": {"low": [0, 0, 0], "high": [1, 2, 3]}, "material": "steel"},
    {"name": "w", "ball": {"center": [1, 2, 3], "radius": 4}, "material": "steel"},
    {"name": "v", "half_space": {"point": [1, 0, 0], "normal": [0, 0, 2]}, "material": "steel"},
    {"name": "u", "voxels": "grid.vtk", "material": "bone"}
  ])");
  EXPECT_EQ(file.table.size(), 1u);
  ASSERT_EQ(file.regions.size(), 6u);
  EXPECT_EQ(std::get<NearFaces>(file.regions[0].shape).depth, 0.1);
  EXPECT_EQ(std::get<InsideShells>(file.regions[1].shape).surface.vertices.back(), Vec3(2, 2, 2));
  EXPECT_EQ(std::get<Material>(file.regions[1].material).density, 1100.0);
  EXPECT_EQ(std::get<InsideBox>(file.regions[2].shape).high, Vec3(1, 2, 3));
  EXPECT_EQ(std::get<InsideBall>(file.regions[3].shape).radius, 4.0);
  EXPECT_EQ(std::get<InsideHalfSpace>(file.regions[4].shape).normal, Vec3(0, 0, 2));
  const std::optional<Material> bone = std::get<MaterialField>(file.regions[5].material).at({3.0, 0.0, 0.0});
  ASSERT_TRUE(bone);
  EXPECT_EQ(bone->density, 1500.0) << "grids are scaled";
  EXPECT_EQ(bone->youngs_modulus, material_preset("bone").youngs_modulus);
  EXPECT_EQ(file.files.size(), 2u);
}

TEST_F(ReadMaterialsFile, MistakesNameFileRegionAndField) {
  EXPECT_THAT(error("[]"), HasSubstr("names no region"));
  EXPECT_THAT(error(R"([{"material": "steel"}])"), HasSubstr("[0]: the key \"name\" is missing"));
  EXPECT_THAT(error(R"([{"name": "a"}])"), HasSubstr("region \"a\": has no \"material\" and no \"voxels\""));
  EXPECT_THAT(error(R"([{"name": "a", "material": "steal"}])"), HasSubstr("did you mean \"steel\"?"));
  EXPECT_THAT(error(R"([{"name": "a", "material": "steel", "bal": {}}])"), HasSubstr("\"bal\" is unknown"));
  EXPECT_THAT(error(R"([{"name": "a", "material": "steel", "faces": "f", "shells": "f"}])"),
              HasSubstr("has \"faces\" and \"shells\", expected one shape"));
  EXPECT_THAT(error(R"([{"name": "a", "material": "steel", "ball": {"center": [0, 0, 0], "radius": -1}}])"),
              HasSubstr("region \"a\": the ball's radius is -1"));
  EXPECT_THAT(error(R"([{"name": "a", "material": "steel", "faces": "f", "depth": 0}])"), HasSubstr("depth is 0"));
  EXPECT_THAT(error(R"([{"name": "a", "material": "steel"}, {"name": "a", "material": "wood"}])"),
              HasSubstr("stands twice without a shape"));
  EXPECT_THAT(error(R"([{"name": "a", "material": "steel", "shells": {"group": "core"}}])"),
              HasSubstr("no surface with groups"));
  EXPECT_THAT(error(R"([{"name": "a", "voxels": "none.vtk"}])"), HasSubstr("none.vtk"));
}

}  // namespace
}  // namespace limber::material_regions
