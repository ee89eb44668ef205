#include "scene_bodies.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <numbers>
#include <optional>

#include "limber/core/error.h"
#include "limber/mesh/read_mesh.h"
#include "limber/mesh/surface_mesh.h"
#include "limber/precompute/bake.h"
#include "limber/precompute/tetrahedralise.h"
#include "limber/scene/scene_model.h"
#include "scene_library.h"
#include "tet_box.h"

namespace limber::scenes {
namespace {

constexpr const char* kBunnyFile = "/usr/share/glmark2/models/bunny.obj";
constexpr double kBunnyScale = 0.1;

/// How a body is meshed and what it is of.
struct Recipe {
  Vec3 size;                 // m
  std::array<int, 3> cells;  // of its box
  Material material;
  double first_hz, last_hz;  // where its damping ratio is kDampingRatio
};
constexpr double kDampingRatio = 0.03;

const std::map<std::string, Recipe>& recipes() {
  static const std::map<std::string, Recipe> all{
      {"box", {{0.2, 0.2, 0.2}, {4, 4, 4}, {1e7, 0.4, 1100.0}, 100.0, 1000.0}},
      {"brick", {{0.3, 0.24, 0.18}, {2, 2, 2}, {1e7, 0.3, 1000.0}, 100.0, 1000.0}},
      {"bar", {{0.3, 0.06, 0.06}, {8, 2, 2}, {2e6, 0.4, 1000.0}, 10.0, 200.0}},
      {"link", {{0.2, 0.04, 0.04}, {10, 2, 2}, {2e6, 0.4, 1000.0}, 10.0, 200.0}},
      {"bowl", {{0.22, 0.22, 0.09}, {8, 8, 1}, {5e6, 0.4, 1000.0}, 20.0, 400.0}},
      {"bunny", {{0.2, 0.2, 0.2}, {0, 0, 0}, {5e5, 0.4, 1000.0}, 10.0, 200.0}},
  };
  return all;
}

/// A dish with a rounded square rim: a plate bent over a cap of a sphere.
TetMesh bowl_mesh(const Recipe& r) {
  constexpr double kOpening = 1.2;    // rad, from the middle to the rim's nearest point
  constexpr double kRoundness = 0.4;  // 0: a square, 0.5: a disc, whose corners would be flat tets
  const double radius = 0.5 * r.size.x() / std::sin(kOpening), thickness = 0.12 * radius;
  TetMesh mesh = testing::tet_box(r.cells[0], r.cells[1], r.cells[2], Vec3::Ones());
  for (Vec3& node : mesh.nodes) {
    const double x = 2.0 * node.x() - 1.0, y = 2.0 * node.y() - 1.0;
    const double u = x * std::sqrt(1.0 - kRoundness * y * y), v = y * std::sqrt(1.0 - kRoundness * x * x);
    const double length = std::hypot(u, v), angle = kOpening * length;
    const double out = radius - thickness * node.z();
    const double across = length > 0.0 ? std::sin(angle) / length : 0.0;
    node = Vec3(out * across * u, out * across * v, -out * std::cos(angle));
  }
  return mesh;
}

TetMesh bunny_mesh() {
  if (!has_bunny()) throw InputError(std::string(kBunnyFile) + ": is not there; apt-get install glmark2-data");
  Warnings warnings;
  SurfaceMesh surface = read_surface_mesh(kBunnyFile, warnings);
  for (Vec3& p : surface.vertices) p *= kBunnyScale;
  return tetrahedralise(surface, {.cell_size = 0.16 * kBunnyScale, .max_nodes = 1}, warnings).mesh;
}

TetMesh mesh_of(const std::string& name, const Recipe& r) {
  TetMesh mesh = name == "bunny"  ? bunny_mesh()
                 : name == "bowl" ? bowl_mesh(r)
                                  : testing::tet_box(r.cells[0], r.cells[1], r.cells[2], r.size);
  const Vec3 center = volume_properties(mesh).centroid;
  for (Vec3& node : mesh.nodes) node -= center;
  return mesh;
}

/// Each triangle in four, which multiplies vertices by some four.
SurfaceMesh split(const SurfaceMesh& surface) {
  SurfaceMesh fine{.vertices = surface.vertices, .triangles = {}};
  std::map<std::pair<Index, Index>, Index> middles;
  const auto middle = [&](Index a, Index b) {
    const auto [at, is_new] = middles.try_emplace(std::minmax(a, b), static_cast<Index>(fine.vertices.size()));
    if (is_new)
      fine.vertices.push_back(
          0.5 * (surface.vertices[static_cast<std::size_t>(a)] + surface.vertices[static_cast<std::size_t>(b)]));
    return at->second;
  };
  for (const auto& [a, b, c] : surface.triangles) {
    const Index ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
    for (const Triangle& t : {Triangle{a, ab, ca}, Triangle{ab, b, bc}, Triangle{ca, bc, c}, Triangle{ab, bc, ca}})
      fine.triangles.push_back(t);
  }
  return fine;
}

/// The boundary, split until it has about so many vertices or more.
std::optional<SurfaceMesh> drawn_surface(const TetMesh& mesh, int vertices) {
  if (vertices == 0) return std::nullopt;
  SurfaceMesh surface = boundary_surface(mesh).surface;
  while (1.5 * static_cast<double>(surface.vertices.size()) < vertices) surface = split(surface);
  return surface;
}

}  // namespace

bool has_bunny() { return std::filesystem::exists(kBunnyFile); }

Vec3 body_size(const std::string& name) { return recipes().at(name).size; }

Asset bake_body(const std::string& name, const BodyOptions& body) {
  const Recipe& r = recipes().at(name);
  BakeInput input{.name = name, .mesh = mesh_of(name, r)};
  input.render = drawn_surface(input.mesh, body.vertices);
  if (body.touched_as_drawn) input.collision = input.render;
  BakeOptions options;
  options.materials = {{"*", r.material}};
  options.materials["*"].youngs_modulus *= body.stiffness;
  options.analysis.modes = options.limits.max_modes = std::max(body.modes, 1);
  if (body.damped) options.damping = RayleighDamping::from_ratio(kDampingRatio, r.first_hz, r.last_hz);
  options.volume_block = body.volume;
  if (name == "bunny") options.collision_triangles = 300;
  Warnings warnings;
  Asset asset = bake(input, options, warnings).asset;
  if (body.modes == 0) make_rigid(asset, 0);
  return asset;
}

}  // namespace limber::scenes
