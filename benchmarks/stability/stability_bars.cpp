#include "stability_bars.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "constants.h"
#include "limber/precompute/bake.h"
#include "limber/scene/scene_model.h"
#include "tet_box.h"

namespace limber::testing {
namespace {

/// Flat tetrahedra: in every sixth one stands a node a little above the middle of a face, at the angle asked for.
void add_slivers(TetMesh& mesh, double degrees) {
  const std::size_t count = mesh.tets.size();
  for (std::size_t e = 0; e < count; e += 6) {
    const Tet t = mesh.tets[e];
    const auto corner = [&](int i) { return mesh.nodes[static_cast<std::size_t>(t[static_cast<std::size_t>(i)])]; };
    const Vec3 normal = (corner(2) - corner(1)).cross(corner(3) - corner(1));
    const double twice_area = normal.norm();
    const std::array opposite{(corner(3) - corner(2)).norm(), (corner(1) - corner(3)).norm(),
                              (corner(2) - corner(1)).norm()};
    const double perimeter = opposite[0] + opposite[1] + opposite[2];
    const Vec3 incenter = (opposite[0] * corner(1) + opposite[1] * corner(2) + opposite[2] * corner(3)) / perimeter;
    const Vec3 inwards = normal * ((corner(0) - corner(1)).dot(normal) > 0.0 ? 1.0 : -1.0) / twice_area;
    const auto added = static_cast<Index>(mesh.nodes.size());
    mesh.nodes.push_back(incenter + std::tan(degrees * kDegree) * twice_area / perimeter * inwards);
    for (std::size_t i = 0; i < 4; ++i) {
      Tet part = t;
      part[i] = added;
      if (i == 0) {
        mesh.tets[e] = part;
      } else {
        mesh.tets.push_back(part);
        mesh.tet_region.push_back(mesh.tet_region[e]);
      }
    }
  }
}

}  // namespace

TetMesh bar_mesh(const StabilityCase& at) {
  if (at.one_tet) {
    TetMesh mesh;
    mesh.regions = {{.name = "*"}};
    mesh.nodes = {Vec3::Zero(), Vec3(kBarSize.x() * at.size, 0.0, 0.0), Vec3(0.0, kBarSize.y() * at.size, 0.0),
                  Vec3(0.0, 0.0, kBarSize.z() * at.size)};
    mesh.tets = {{0, 1, 2, 3}};
    mesh.tet_region = {0};
    return mesh;
  }
  TetMesh mesh = tet_box(3, 2, 2, at.size * kBarSize);
  if (at.sliver_angle > 0.0) add_slivers(mesh, at.sliver_angle);
  return mesh;
}

Material bar_material(const StabilityCase& at, double weight) {
  return {
      .youngs_modulus = weight * at.youngs_modulus, .poisson_ratio = at.poisson_ratio, .density = weight * at.density};
}

std::shared_ptr<const ModalModel> baked_bar(const StabilityCase& at, double weight, MassKind mass) {
  BakeOptions o;
  o.materials = {{"*", bar_material(at, weight)}};
  o.analysis.modes = o.limits.max_modes = std::max(1, at.modes);
  o.analysis.mass = mass;
  o.volume_block = true;
  const auto bake_it = [&] {
    Warnings warnings;
    return bake({.name = "bar", .mesh = bar_mesh(at)}, o, warnings).asset.bodies[0];
  };
  auto bar = bake_it();
  if (at.modes == 0) return reduce_model(*bar, {});
  if (at.damping_ratio == 0.0) return bar;
  o.damping.stiffness_proportional = 2.0 * at.damping_ratio / std::sqrt(bar->data().eigenvalues.front());
  return bake_it();
}

}  // namespace limber::testing
