// Bodies whose natural frequencies are known: writes the surface of each into a folder and prints a line of it,
//   NAME E NU RHO f1 … f10 (of the ring f1 alone)
// in SI units. scripts/natural-frequencies bakes them. Frequencies are those of Ritz's method with polynomials, or
// measured.
#include <cstdio>
#include <filesystem>
#include <functional>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "limber/mesh/surface_mesh.h"
#include "mesh_files.h"
#include "reference/ritz_round.h"
#include "ritz_box.h"
#include "shapes.h"

namespace limber {
namespace {

constexpr int kModes = 10;
const Material kSteel{.youngs_modulus = 2.07e11, .poisson_ratio = 0.3, .density = 7850.0};
const Material kAluminium{.youngs_modulus = 70e9, .poisson_ratio = 0.33, .density = 2700.0};

struct Known {
  std::string name;
  Material material;
  SurfaceMesh surface;
  std::vector<double> hz;
};

double hz_of(double eigenvalue) { return std::sqrt(eigenvalue) / (2.0 * std::numbers::pi); }

Material rubber(double poisson_ratio) {
  return {.youngs_modulus = 5e6, .poisson_ratio = poisson_ratio, .density = 1100.0};
}

Known box(const std::string& name, const Vec3& size, const Material& material, const testing::RitzBox::Degree& degree) {
  const testing::RitzBox ritz((0.5 * size).asDiagonal(), material, degree, kModes);
  Known known{.name = name, .material = material, .surface = shapes::box(Vec3::Zero(), size), .hz = {}};
  for (int m = 0; m < kModes; ++m) known.hz.push_back(hz_of(ritz.eigenvalue(m)));
  return known;
}

Known round(const std::string& name, SurfaceMesh surface, const testing::RoundBody& body, const Material& material,
            const testing::RitzRound::Degree& degree) {
  const testing::RitzRound ritz(body, material, degree);
  Known known{.name = name, .material = material, .surface = std::move(surface), .hz = {}};
  for (std::size_t m = 0; m < kModes; ++m) known.hz.push_back(hz_of(ritz.eigenvalues()[m]));
  return known;
}

constexpr int kSides = 128;  // of what is round

/// A prism inscribed in the cylinder: its section is 4e-4 smaller.
SurfaceMesh cylinder(double radius, double length) {
  SurfaceMesh s;
  s.vertices = {{0.0, 0.0, -0.5 * length}, {0.0, 0.0, 0.5 * length}};
  for (int i = 0; i < kSides; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / kSides;
    for (const double z : {-0.5, 0.5})
      s.vertices.emplace_back(radius * std::cos(angle), radius * std::sin(angle), z * length);
    const Index here = 2 + 2 * i, next = 2 + 2 * ((i + 1) % kSides);
    s.triangles.push_back({0, next, here});
    s.triangles.push_back({1, here + 1, next + 1});
    s.triangles.push_back({here, next, next + 1});
    s.triangles.push_back({here, next + 1, here + 1});
  }
  return s;
}

/// A thin ring, of which the frequency of two waves in its plane is known.
Known ring(double radius, double thickness, double height) {
  Known known{.name = "ring", .material = kSteel, .surface = {}, .hz = {}};
  SurfaceMesh& s = known.surface;
  for (int i = 0; i < kSides; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / kSides;
    for (const auto& [out, up] :
         {std::pair(-0.5, 0.0), std::pair(0.5, 0.0), std::pair(0.5, 1.0), std::pair(-0.5, 1.0)}) {
      const double r = radius + out * thickness;
      s.vertices.emplace_back(r * std::cos(angle), r * std::sin(angle), up * height);
    }
    const Index here = 4 * i, next = 4 * ((i + 1) % kSides);
    for (Index k = 0; k < 4; ++k) {
      s.triangles.push_back({here + k, next + k, next + (k + 1) % 4});
      s.triangles.push_back({here + k, next + (k + 1) % 4, here + (k + 1) % 4});
    }
  }
  const double bending = std::sqrt(kSteel.youngs_modulus / (12.0 * kSteel.density)) * thickness / (radius * radius);
  known.hz = {6.0 / std::sqrt(5.0) * bending / (2.0 * std::numbers::pi)};
  return known;
}

/// An aluminium alloy by laser-Doppler interferometry: Ogi, Sato, Asada and Hirao, Complete mode identification for
/// resonance ultrasound spectroscopy, J. Acoust. Soc. Am. 112 (2002): c11 109.26 GPa and c44 26.72 GPa were fitted to
/// the first 40 frequencies, of which those calculated differ by up to 0.5 %.
Known measured_block() {
  const double c11 = 109.26e9, mu = 26.72e9, lambda = c11 - 2.0 * mu;
  return {.name = "block_measured",
          .material = {.youngs_modulus = mu * (3.0 * lambda + 2.0 * mu) / (lambda + mu),
                       .poisson_ratio = lambda / (2.0 * (lambda + mu)),
                       .density = 2788.0},
          .surface = shapes::box(Vec3::Zero(), {11.92e-3, 10.93e-3, 9.86e-3}),
          .hz = {116716, 143783, 158081, 166500, 169523, 177846, 183875, 186047, 190341, 197386}};
}

const std::vector<std::function<Known()>>& known_bodies() {
  static const std::vector<std::function<Known()>> kBodies{
      [] {
        return box("block", {0.1, 0.08, 0.06}, kSteel, {11, 11, 11});
      },
      [] {
        return box("cube", {0.1, 0.106, 0.114}, kAluminium, {11, 11, 11});
      },
      [] {
        return box("short_bar", {0.16, 0.04, 0.03}, kAluminium, {18, 12, 12});
      },
      [] {
        return box("square_bar", {0.3, 0.02, 0.021}, kSteel, {18, 8, 8});
      },
      [] {
        return box("thin_bar", {0.3, 0.04, 0.01}, kSteel, {26, 10, 8});
      },
      [] {
        return box("plate", {0.2, 0.18, 0.01}, kSteel, {22, 22, 6});
      },
      [] {
        return box("plate_of_2_mm", {0.2, 0.18, 0.002}, kSteel, {22, 22, 4});
      },
      [] { return ring(0.05, 0.002, 0.02); },
      [] {
        return round("cylinder", cylinder(0.02, 0.1), {.half = {0.02, 0.02, 0.05}}, kSteel, {10, 10, 14});
      },
      [] {
        return round("sphere", shapes::sphere(Vec3::Zero(), 0.05, 5),
                     {.half = Vec3::Constant(0.05), .is_ellipsoid = true}, kSteel, {10, 10, 10});
      },
      [] {
        return box("soft_bar_0.3", {0.3, 0.04, 0.02}, rubber(0.3), {18, 8, 8});
      },
      [] {
        return box("soft_bar_0.499", {0.3, 0.04, 0.02}, rubber(0.499), {24, 10, 10});
      },
      [] {
        return box("soft_block_0.499", {0.1, 0.08, 0.06}, rubber(0.499), {11, 11, 11});
      },
      measured_block,
  };
  return kBodies;
}

}  // namespace
}  // namespace limber

int main(int argc, char** argv) {
  using namespace limber;
  if (argc != 2) {
    std::fprintf(stderr, "natural_frequencies FOLDER\n");
    return 2;
  }
  for (const auto& make : known_bodies()) {
    const Known known = make();
    testing::write_obj(std::filesystem::path(argv[1]) / (known.name + ".obj"), known.surface);
    std::printf("%s\t%.10g\t%.10g\t%.10g", known.name.c_str(), known.material.youngs_modulus,
                known.material.poisson_ratio, known.material.density);
    for (const double hz : known.hz) std::printf("\t%.8g", hz);
    std::printf("\n");
  }
  return 0;
}
